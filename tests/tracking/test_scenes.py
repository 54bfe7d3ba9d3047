"""Every scene around its first contact: judged pair by pair, and between the frames too."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.assessment.motion import assess_motion
from wholebody.tasks import ReachCones
from wholebody.tracking import Recording, build_scene, follow, gallery, judge
from wholebody.tracking.scenes import InteractionScene

BEFORE, AFTER = 7, 19


@cache
def first_contact(name: str) -> tuple[InteractionScene, wb.Clip]:
    """A scene, and its track from just before it first goes into something; made once for both ways out."""
    made = build_scene(name)
    assert len(made.track) >= 600
    coarse = np.arange(0, len(made.track), 6)
    first = int(coarse[np.argmax(assess_motion(made.scene, made.track.q[coarse], 1.0).depth > 5e-3)])
    return made, made.track[first - BEFORE : first + AFTER]


@pytest.mark.parametrize(
    ("name", "overlap", "allowed"),
    [("hand_in_corner", "qp", 1e-5), ("two_arms_and_leg", "ccd", 1e-3)],
)
def test_the_shown_figure_stays_outside(name: str, overlap: str, allowed: float, least_distance: Any) -> None:
    made, part = first_contact(name)
    scene = made.scene
    recording = follow(scene, part, overlap=overlap, rigid=made.rigid)
    assert min(least_distance(scene, q) for q in part.q) < -0.01  # the tracked one goes in
    assert min(least_distance(scene, q) for q in recording.q) > -allowed
    for a, b in zip(recording.q[:-1:2], recording.q[1::2], strict=True):
        assert least_distance(scene, pin.interpolate(scene.model, a, b, 0.5)) > -max(allowed, 1e-4)
    assert all(scene.figure.within_limits(q) for q in recording.q)
    assert bool(scene.figure.cones) == (not made.rigid)  # every avatar is judged by its cones
    if scene.figure.cones:
        cones = ReachCones().resolve(scene, part.q[0])
        assert min(cones.value(scene.state(q)).min() for q in recording.q) > -1e-6
    free = judge(scene, recording).tracked_depth < 1e-5
    apart = [np.abs(pin.difference(scene.model, *pair)).max() for pair in zip(part.q, recording.q, strict=True)]
    assert max(np.array(apart)[free]) < 0.05  # the clearance is kept where the tracked posture only comes near
    assert sum(bool(note) for note in recording.notes) <= (0 if overlap == "qp" else 6)


def test_the_gallery_has_two_rooms_and_some_twenty_things() -> None:
    figure = wb.load("avatar")
    scene = gallery(figure)
    assert 20 <= len(scene.objects) <= 25
    owners = scene.piece_owner
    assert owners.count("torus") > 5
    q = figure.posture("standing")
    q[0] = -2.5
    assert not scene.contacts(q, within=-1e-6).distance.size  # there is room to stand
    walls = [name for name in scene.objects if "wall" in name]
    assert len(walls) == 6


def test_frames_cut_or_repeat_the_script() -> None:
    whole = build_scene("hand_on_table").track
    np.testing.assert_array_equal(build_scene("hand_on_table", frames=30).track.q, whole.q[:30])
    longer = build_scene("hand_on_table", frames=len(whole) + 5).track
    np.testing.assert_array_equal(longer.q[-5:], whole.q[:5])
    assert not np.array_equal(build_scene("hand_on_table", seed=1).track.q, whole.q)
    with pytest.raises(wb.UnknownNameError, match="hand_on_table"):
        build_scene("hand_on_tabel")


def test_judging_finds_what_is_planted(hand: wb.Figure, scene: wb.Scene) -> None:
    """A hand that is shown 5 mm deep, that jumps through the table, and that leaves a limit."""

    def at(z: float) -> Any:
        q = hand.posture("relaxed")
        q[2] = z
        return q

    rest = hand.posture("relaxed")[2]  # the wrist when the lowest part is on the table
    bent = hand.with_joints(at(rest + 0.2), {"right_index_pip_flexion": 3.0})
    shown = [at(rest + 0.2), at(rest - 0.005), at(-0.8), bent, *[at(rest + 0.2)] * 40]
    tracked = [at(rest + 0.2), at(rest - 0.03), at(-0.8), bent, *[at(rest + 0.2)] * 40]
    count = len(shown)
    zeros, none = np.zeros(count), np.zeros(count, dtype=np.intp)
    judged = judge(
        scene,
        Recording(
            np.array(shown), np.array(tracked), 0.02, "qp", zeros, zeros, zeros, zeros, none, none, none, ("",) * count
        ),
    )
    assert judged.depth[1] == pytest.approx(0.005, abs=1e-4)
    assert judged.tracked_depth[1] == pytest.approx(0.03, abs=1e-4)
    assert judged.tracked_pairs[1] >= 1
    assert 2 in judged.passed
    assert 3 in judged.passed
    assert judged.limit_violation == pytest.approx(3.0 - hand.limits.upper.max(), abs=0.3)
    assert judged.root_distance[1] == pytest.approx(0.025)
    assert judged.distance[0] == 0.0
    assert judged.returns == ((2, 0),)


def test_by_ccd_root_and_trunk_follow_into_a_wall() -> None:
    """They stay no farther behind than the tracked posture is deep, though every limb could be at its angles."""
    built = build_scene("two_arms_and_leg", frames=150)
    recording = follow(built.scene, built.track, overlap="ccd")
    tracked, shown = recording.tracked[-1], recording.q[-1]
    deep = -built.scene.contacts(tracked, within=0.0).distance.min()
    assert 0.1 < deep < 0.2  # m
    assert np.linalg.norm(shown[:3] - tracked[:3]) < deep


def test_by_ccd_what_rests_against_a_thing_stays_still() -> None:
    """The tracked posture goes into a wall and stays there: 30 frames later nothing of the shown one moves."""
    built = build_scene("two_arms_and_leg", frames=150)
    postures = built.track.q[[*range(105), *[105] * 50]]
    shown = follow(built.scene, wb.Clip(built.scene.figure, postures, built.track.dt), overlap="ccd").q[-20:]
    assert np.abs(pin.difference(built.scene.model, shown[0], postures[-1])).max() > 0.1  # rad: kept out
    assert np.abs(shown - shown[0]).max() < 1e-9
