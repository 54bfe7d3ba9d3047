"""The frame loop on a hand above a table: what is shown is never inside, and as near to the tracker as can be."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.tasks import ReachCones
from wholebody.tracking import FrameLoop, follow
from wholebody.tracking.qp_strategy import CLEARANCE


def at(hand: wb.Figure, x: float, z: float, posture: str = "relaxed") -> Any:
    q = hand.posture(posture)
    q[0], q[2] = x, z
    return q


def test_free_motion_is_followed_exactly(hand: wb.Figure, scene: wb.Scene) -> None:
    q = np.array([at(hand, 0.01 * k, 0.5) for k in range(20)])
    shown = follow(scene, wb.Clip(hand, q, 1 / 60), rigid=True)
    np.testing.assert_allclose(shown.q, q, atol=1e-9)
    assert not shown.pairs.any()
    assert not shown.joints.any()
    assert (shown.seconds >= shown.contact_seconds + shown.solve_seconds - 1e-6).all()


@pytest.mark.parametrize("posture", ["relaxed", "grip"])
def test_the_hand_slides_on_the_table_as_a_whole(
    hand: wb.Figure, scene: wb.Scene, least_distance: Any, posture: str
) -> None:
    resting = hand.posture(posture)[2]  # of the wrist, with the lowest point at z = 0
    heights = np.concatenate([np.linspace(0.15, -0.08, 25), np.full(25, -0.08)])
    q = np.array([at(hand, 0.004 * k, z, posture) for k, z in enumerate(heights)])
    recording = follow(scene, wb.Clip(hand, q, 1 / 60), rigid=True)
    assert min(least_distance(scene, shown) for shown in recording.q) > 0.0
    last = recording.q[-1]
    # The nearest place is straight above: the height at which the lowest point is one clearance over the table.
    assert last[2] == pytest.approx(resting + CLEARANCE, abs=2e-4)
    np.testing.assert_allclose(last[:2], q[-1, :2], atol=2e-3)
    np.testing.assert_allclose(last[7:], q[-1, 7:], atol=2e-3)  # the fingers follow the glove


def test_the_rigid_hand_is_displaced_by_its_global_depth(hand: wb.Figure, scene: wb.Scene, least_distance: Any) -> None:
    """With ccd: pure translation along the table's normal, the fingers exactly as the glove has them."""
    q = np.array([at(hand, 0.004 * k, z) for k, z in enumerate(np.linspace(0.15, -0.05, 40))])
    recording = follow(scene, wb.Clip(hand, q, 1 / 60), overlap="ccd", rigid=True)
    assert min(least_distance(scene, shown) for shown in recording.q) >= 0.0
    np.testing.assert_allclose(recording.q[:, 3:], q[:, 3:], atol=1e-9)
    np.testing.assert_allclose(recording.q[-1, :2], q[-1, :2], atol=1e-3)
    assert 0.0 <= recording.q[-1, 2] - hand.posture("relaxed")[2] < 2e-3
    assert recording.pairs[-1] > 0
    assert recording.iterations[-1] > 0
    assert not recording.joints.any()  # as a whole, by no joint


def test_opposed_normals_cancel_and_the_last_free_place_is_kept(hand: wb.Figure, least_distance: Any) -> None:
    """Figure 4b: in a slot narrower than the hand PD_g has no way out; the hand stops before it."""
    scene = wb.Scene(hand)
    for name, sign in (("left cheek", 1.0), ("right cheek", -1.0)):
        scene.add(wb.Box((0.3, 0.2, 0.4)), name=name, at=(0.4, sign * 0.13, 0.2))
    q = np.array([at(hand, x, 0.2) for x in np.linspace(-0.2, 0.3, 40)])
    for overlap, allowed in (("ccd", 1e-3), ("qp", 1e-5)):
        recording = follow(scene, wb.Clip(hand, q, 1 / 60), overlap=overlap, rigid=True)
        assert min(least_distance(scene, shown) for shown in recording.q) > -allowed
        assert least_distance(scene, q[-1]) < -0.005
        assert recording.q[-1, 0] < q[-1, 0] - 0.05


def test_attraction_goes_on_at_rest(hand: wb.Figure, scene: wb.Scene) -> None:
    loop = FrameLoop(scene, at(hand, 0.0, 0.3), rigid=True)
    target = at(hand, 0.8, 0.3)
    way = [float(np.linalg.norm(loop.frame(target).q[:3] - target[:3])) for _ in range(40)]
    assert all(later < earlier or later < 1e-9 for earlier, later in pairwise(way))
    assert way[-1] < 1e-9
    assert way[0] > 0.7  # it does not jump there


def test_what_is_released_is_back_within_thirty_frames(hand: wb.Figure, scene: wb.Scene) -> None:
    down, up = at(hand, 0.0, -0.1), at(hand, 0.1, 0.3, "open")
    loop = FrameLoop(scene, at(hand, 0.0, 0.2), rigid=True)
    for _ in range(40):
        loop.frame(down)
    assert np.abs(pin.difference(hand.model, down, loop.shown)).max() > 0.1
    for _ in range(30):
        loop.frame(up)
    assert np.abs(pin.difference(hand.model, up, loop.shown)).max() < 1e-3


def test_nothing_is_jumped_over(hand: wb.Figure, least_distance: Any) -> None:
    scene = wb.Scene(hand).add(wb.Box((2.0, 2.0, 0.004)), name="sheet", at=(0.0, 0.0, 0.0))
    loop = FrameLoop(scene, at(hand, 0.0, 0.4), rigid=True)
    for _ in range(30):
        before = loop.shown
        frame = loop.frame(at(hand, 0.0, -0.4))
        for share in np.linspace(0.0, 1.0, 6):
            assert least_distance(scene, pin.interpolate(hand.model, before, frame.q, share)) > -1e-4
    assert loop.shown[2] > 0.0


def test_the_same_seed_gives_the_same_frames(hand: wb.Figure) -> None:
    q = np.array([at(hand, 0.005 * k, 0.1 - 0.01 * k) for k in range(20)])
    runs = []
    for _ in range(2):
        scene = wb.Scene(hand).add(wb.HalfSpace(), name="table")
        runs.append(follow(scene, wb.Clip(hand, q, 1 / 60), seed=5, rigid=True).q)
    np.testing.assert_array_equal(runs[0], runs[1])


def test_a_start_in_penetration_is_freed_and_noted(hand: wb.Figure, scene: wb.Scene, least_distance: Any) -> None:
    deep = at(hand, 0.0, 0.02)
    recording = follow(scene, wb.Clip(hand, [deep, deep], 1 / 60), rigid=True)
    assert recording.notes[0].startswith("frame 0: ")
    assert "inside table" in recording.notes[0]
    assert recording.notes[1] == ""
    assert least_distance(scene, recording.q[0]) > 0.0


def test_a_start_that_cannot_be_freed_is_refused() -> None:
    arm = wb.load("avatar").reduced(["right_wrist_flexion", "right_wrist_deviation"])
    place = pin.neutral(arm.model)
    scene = wb.Scene(arm)
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, place)
    wrist = data.oMf[arm.frame_id("right_hand")].translation
    scene.add(wb.Box((0.8, 0.7, 0.6)), name="boulder", at=wrist + [0.03, -0.36, 0.05])
    with pytest.raises(wb.InputError, match=r"frame 0: right_hand is .* mm inside boulder.*begin the track outside"):
        follow(scene, wb.Clip(arm, [place], 1 / 60))


def test_a_dropped_out_frame_is_held_and_noted(hand: wb.Figure, scene: wb.Scene) -> None:
    loop = FrameLoop(scene, at(hand, 0.0, 0.3), rigid=True)
    shown = loop.frame(at(hand, 0.01, 0.3)).q
    lost = at(hand, 0.02, 0.3)
    lost[9] = np.nan
    unturned = at(hand, 0.02, 0.3)
    unturned[3:7] = 0.0
    for bad in (lost, lost[:-1], unturned):
        frame = loop.frame(bad)
        np.testing.assert_array_equal(frame.q, shown)
        assert f"frame {loop.count - 1}" in frame.note
        assert "the figure stays" in frame.note
    assert loop.frame(at(hand, 0.02, 0.3)).note == ""


def test_tracked_angles_out_of_limits_are_shown_at_the_limit(hand: wb.Figure, scene: wb.Scene) -> None:
    loop = FrameLoop(scene, at(hand, 0.0, 0.3), rigid=True)
    bent = hand.with_joints(at(hand, 0.0, 0.3), {"right_index_pip_flexion": 3.5})
    for _ in range(30):
        shown = loop.frame(bent).q
    assert hand.within_limits(shown)
    np.testing.assert_allclose(shown, hand.clamp(bent), atol=1e-9)


@pytest.mark.parametrize("overlap", ["ccd", "qp"])
def test_a_tracked_limb_out_of_its_reach_cone_is_shown_in_it(overlap: str) -> None:
    avatar = wb.load("avatar")
    scene, standing = wb.Scene(avatar), avatar.posture("standing")
    behind = {"right_shoulder_flexion": -0.9, "right_shoulder_abduction": -0.6}
    apart = {"left_hip_flexion": -0.6, "left_hip_abduction": 0.9}
    tracked = avatar.clamp(avatar.with_joints(standing, behind | apart))
    cones = ReachCones().resolve(scene, standing)
    assert cones.value(scene.state(tracked)).min() < -0.3
    loop = FrameLoop(scene, standing, overlap=overlap)
    for _ in range(40):
        shown = loop.frame(tracked).q
        assert cones.value(scene.state(shown)).min() > -1e-6
    before, after = (np.linalg.norm(pin.difference(avatar.model, q, tracked)) for q in (standing, shown))
    assert after < 0.6 * before


def test_settings_are_checked(hand: wb.Figure, scene: wb.Scene) -> None:
    with pytest.raises(wb.errors.UnknownNameError, match="overlap"):
        FrameLoop(scene, hand.neutral, overlap="springs")
    with pytest.raises(wb.InputError, match="dt"):
        FrameLoop(scene, hand.neutral, dt=0.0)
    for start in (hand.neutral[:-1], np.full(hand.model.nq, np.nan), np.zeros(hand.model.nq)):
        with pytest.raises(wb.InputError, match="frame 0"):
            FrameLoop(scene, start)


def test_driven_objects_come_first(hand: wb.Figure, scene: wb.Scene) -> None:
    """In every frame: the tracked posture within limits, then removal of overlap, then the check of the way."""
    loop = FrameLoop(scene, at(hand, 0.0, 0.3), rigid=True)
    order: list[str] = []

    class Spy:
        sweep_tolerance = 1e-4

        def resolve(self, shown: Any, tracked: Any) -> Any:
            order.append("resolve")
            assert hand.within_limits(tracked)
            np.testing.assert_array_equal(shown, loop.shown)
            return strategy.resolve(shown, tracked)

    strategy, loop._strategy = loop._strategy, Spy()
    whole_sweep = scene.sweep

    def sweep(*ways: Any, **options: Any) -> Any:
        order.append("sweep")
        return whole_sweep(*ways, **options)

    scene.sweep = sweep  # type: ignore[method-assign]
    done: list[int] = []
    tracks = [at(hand, 0.0, 0.3 - 0.02 * k) for k in range(3)]
    for tracked in tracks:
        loop.frame(tracked)
        done.append(loop.count)
    assert order == ["resolve", "sweep"] * 3
    assert done == [1, 2, 3]


@pytest.mark.parametrize("stop", [False, True], ids=["free", "a wall behind it"])
def test_a_ball_takes_half_of_an_overlap_where_both_give_way(planar_arm: Any, stop: bool) -> None:
    scene, place, angle = wb.Scene(planar_arm((0.5, 0.4))), np.array((0.3, 0.13, 0.0)), 0.1
    scene.add(wb.Sphere(0.1), name="ball", at=place, body=wb.Body(mass=1.0))
    if stop:
        scene.add(wb.Box((0.5, 0.1, 0.5)), name="wall", at=(0.3, 0.2801, 0.0))
    loop = FrameLoop(scene, np.zeros(2), touching=["ball"], give_way="both")
    frame = loop.frame(np.array((angle, 0.0)))
    out = np.array((-np.sin(angle), np.cos(angle), 0.0))
    depth = 0.1 + 0.02 - float(out @ place)  # of the ball in the first link, whose radius is 2 cm
    moved = scene.objects["ball"].placement.translation - place
    if stop:
        assert abs(moved[1]) < 3e-4
    else:
        assert moved == pytest.approx(0.5 * depth * out, abs=1e-6)
    assert not frame.note
    assert -scene.contacts(frame.q, 0.0).distance.min(initial=0.0) < 1e-4
    wanted = float(np.arctan2(*(place + moved)[1::-1])) - float(np.arcsin(0.12 / np.linalg.norm(place + moved)))
    assert frame.q[0] == pytest.approx(wanted, abs=5e-3)  # the link touches the ball


def test_who_gives_way_is_checked(planar_arm: Any) -> None:
    with pytest.raises(wb.InputError, match="give_way"):
        FrameLoop(wb.Scene(planar_arm((0.5,))), np.zeros(1), give_way="thing")  # type: ignore[arg-type]
