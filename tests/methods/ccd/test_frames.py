"""Overlap removed frame by frame: free of it, within limits and cones, near to what is tracked, and back at the end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.stability.bodies import Builder
from wholebody.geometry.penetration import global_depth
from wholebody.methods.ccd.frames import resolve_overlap


def _wall(figure: wb.Figure) -> tuple[wb.Scene, list[Any]]:
    scene = wb.Scene(figure).add(wb.Box((0.1, 3.0, 3.0)), name="wall", at=(0.6, 0.0, 1.5))
    return scene, [figure.posture(name) for name in ("standing", "arms_forward", "standing")]


def _table(figure: wb.Figure) -> tuple[wb.Scene, list[Any]]:
    scene = wb.Scene(figure).add(wb.Box((0.6, 1.6, 0.04)), name="table", at=(0.6, 0.0, 0.95))
    standing = figure.posture("standing")
    above = figure.with_joints(standing, {"right_shoulder_flexion": 1.2, "right_elbow_flexion": 0.9})
    press = figure.with_joints(above, {"right_shoulder_flexion": 0.75})
    left = figure.with_joints(press, {"right_shoulder_abduction": -0.3})
    return scene, [above, press, left, press, above]


def _torso(figure: wb.Figure) -> tuple[wb.Scene, list[Any]]:
    standing = figure.posture("standing")
    across = {"flexion": 0.4, "rotation": 0.9, "abduction": -0.2}
    inside = {f"right_shoulder_{name}": value for name, value in across.items()} | {"right_elbow_flexion": 1.6}
    return wb.Scene(figure), [standing, figure.with_joints(standing, inside), standing]


def _arms(figure: wb.Figure) -> tuple[wb.Scene, list[Any]]:
    front = figure.posture("arms_forward")
    crossed = {"right_shoulder_abduction": -0.5, "left_shoulder_abduction": -0.5}
    return wb.Scene(figure), [front, figure.with_joints(front, crossed), front]


def _corner(figure: wb.Figure) -> tuple[wb.Scene, list[Any]]:
    scene, postures = _wall(figure)
    scene.add(wb.Box((3.0, 0.1, 3.0)), name="side", at=(0.0, -0.4, 1.5))
    aside = figure.with_joints(postures[1], {"right_shoulder_abduction": 0.4})
    return scene, [postures[0], postures[1], aside, postures[1], postures[0]]


SCENES = {"wall": _wall, "table": _table, "torso": _torso, "arms": _arms, "corner": _corner}


@pytest.mark.parametrize("name", ["table", "torso"])
def test_no_frame_overlaps_and_the_last_is_what_is_tracked(
    name: str,
    avatar: wb.Figure,
    track: Callable[..., Any],
    deepest: Callable[..., float],
    outside: Callable[..., float],
) -> None:
    scene, postures = SCENES[name](avatar)
    frames = track(avatar, *postures, frames=15)
    rng, q, pushed = np.random.default_rng(0), frames[0], 0
    for wanted in frames + [frames[-1]] * 20:
        before = q
        result = resolve_overlap(scene, q, wanted, rng)
        q = result.q
        assert np.isfinite(q).all()
        depth = deepest(scene, q)
        assert depth <= 1e-3
        assert result.deepest == pytest.approx(depth, abs=5e-6)
        assert avatar.within_limits(q)
        assert outside(avatar, q) <= 1e-9
        assert scene.sweep(before, q, 4e-3) is None
        pushed += result.iterations > 0
    assert max(deepest(scene, wanted) for wanted in frames[::5]) > 0.02
    assert pushed > 10
    assert np.abs(pin.difference(avatar.model, q, frames[-1])).max() <= 1e-3


def test_a_hand_slides_along_what_stops_it(avatar: wb.Figure, track: Callable[..., Any]) -> None:
    """The tracked hand is under the table and moves sideways: the shown one stays above and moves as far."""
    scene, postures = _table(avatar)
    rng, q, data = np.random.default_rng(0), postures[0], avatar.model.createData()

    def tip(posture: Any) -> Any:
        pin.forwardKinematics(avatar.model, data, posture)
        return pin.updateFramePlacement(avatar.model, data, avatar.frame_id("right_wrist")).translation.copy()

    shown, tracked = [], []
    for wanted in track(avatar, *postures[:3]):
        q = resolve_overlap(scene, q, wanted, rng).q
        shown.append(tip(q)[1])
        tracked.append(tip(wanted)[1])
    way = tracked[-1] - tracked[40]
    assert abs(way) > 0.05
    assert shown[-1] - shown[40] == pytest.approx(way, rel=0.5)


def test_the_same_seed_gives_the_same_frames(avatar: wb.Figure, track: Callable[..., Any]) -> None:
    runs = []
    for _ in range(2):
        scene, postures = _arms(avatar)
        rng, q = np.random.default_rng(8), postures[0]
        for wanted in track(avatar, *postures, frames=10):
            q = resolve_overlap(scene, q, wanted, rng).q
        runs.append(q)
    assert (runs[0] == runs[1]).all()


def test_things_that_come_over_a_limb_push_it_out(avatar: wb.Figure, deepest: Callable[..., float]) -> None:
    scene = wb.Scene(avatar).add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(1.0, -0.3, 1.0))
    q, rng = avatar.posture("arms_forward"), np.random.default_rng(0)
    for k in range(30):
        scene.move("box", at=(1.0 - 0.01 * k, -0.25, 1.38))
        q = resolve_overlap(scene, q, avatar.posture("arms_forward"), rng).q
        assert deepest(scene, q) <= 1e-3


def test_what_is_left_is_said_of_the_posture_that_is_shown(avatar: wb.Figure, deepest: Callable[..., float]) -> None:
    """A thing in the pelvis, which no chain moves: nothing frees it, and no posture that was tried speaks for it."""
    standing = avatar.posture("standing")
    for depth in (3e-4, 2e-2):
        scene = wb.Scene(avatar).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=(-0.5, 0.0, 0.95))
        contacts = scene.contacts(standing, within=1.0)
        box = [k for k, pair in enumerate(contacts.pair) if "box" in {scene.piece_owner[i] for i in pair}]
        nearest = min(box, key=lambda k: float(contacts.distance[k]))
        assert "pelvis" in {scene.piece_owner[i] for i in contacts.pair[nearest]}
        scene.move("box", at=(-0.5 + float(contacts.distance[nearest]) + depth, 0.0, 0.95))
        result = resolve_overlap(scene, standing, avatar.posture("arms_forward"), np.random.default_rng(0))
        assert deepest(scene, result.q) > 1e-4
        assert result.deepest == pytest.approx(deepest(scene, result.q), abs=5e-6)


def test_cancelling_normals_do_not_hold_a_link_inside(
    planar_arm: Callable[..., Any], deepest: Callable[..., float]
) -> None:
    """A link on both sides of a thin wall: PD_g is zero there (figure 4b of Schmidl and Lin), but not beside it."""
    scene = wb.Scene(planar_arm((0.3, 0.3, 0.3)))
    scene.attach(wb.Sphere(0.02), to="link2", name="knob", at=(0.15, 0.06, 0.0))
    scene.add(wb.Box((0.2, 0.03, 0.4)), name="wall", at=(0.75, 0.03, 0.0))
    straight = np.zeros(3)
    contacts = scene.contacts(straight, within=0.0)
    assert len(contacts.distance) == 2
    assert global_depth(-contacts.distance, contacts.normal) == pytest.approx(np.zeros(3), abs=1e-6)
    problem = wb.Problem(scene, straight, goals=[wb.Point("tip", (0.9, 0.0, 0.0))])
    for seed in range(5):
        (q,) = wb.methods.CCD(seed=seed).tracker(problem, 0.1).overlap_resolutions(straight)
        assert deepest(scene, q) <= 1e-4
        assert np.abs(q).max() < 0.7


def test_a_joint_that_moves_no_point_follows_what_is_tracked() -> None:
    builder = Builder("arm with a bare joint")
    turn = builder.joint("ry", "turn")
    builder.rod(turn, (0.3, 0.0, 0.0), 0.02)
    builder.rod(builder.joint("ry", "fore", parent=turn, at=(0.3, 0.0, 0.0)), (0.3, 0.0, 0.0), 0.02)
    builder.joint("rz", "bare", parent=turn, at=(0.1, 0.0, 0.0))
    scene = wb.Scene(builder.figure()).add(wb.Sphere(0.1), name="ball", at=(0.5, 0.0, -0.2))
    wanted = np.array([0.4, 0.0, 0.5])
    assert scene.overlapping(wanted).pair.size
    q = np.zeros(3)
    for _ in range(5):
        q = resolve_overlap(scene, q, wanted, np.random.default_rng(0)).q
    assert q[2] == pytest.approx(0.5)
    assert not scene.overlapping(q).pair.size


@pytest.mark.parametrize("bad", [np.zeros(3), np.full(38, np.nan)])
def test_postures_that_are_none_are_refused(bad: Any, avatar: wb.Figure) -> None:
    with pytest.raises(wb.InputError, match="q_wanted"):
        resolve_overlap(wb.Scene(avatar), avatar.neutral, bad, np.random.default_rng(0))


@pytest.mark.parametrize("shoulder", [np.pi / 4, 0.4])
def test_a_forearm_that_lies_on_a_table_keeps_its_direction_while_it_is_held_there(
    shoulder: float, avatar: wb.Figure
) -> None:
    """It is moved out by translation, A8 of Schmidl and Lin: the elbow is lifted as much as the wrist, and stays so.

    The elbow's axis is not parallel to that of the shoulder's flexion, so the upper arm turns about its long axis too.
    """
    start = avatar.posture("standing").copy()
    for joint, angle in (("right_shoulder_flexion", shoulder), ("right_elbow_flexion", np.pi / 2 - shoulder)):
        start[avatar.model.joints[avatar.joint_id(joint)].idx_q] = angle
    elbow = avatar.placement(start, "right_forearm").translation
    scene = wb.Scene(avatar).add(wb.Box((0.14, 0.5, 0.04)), name="table", at=(elbow[0] + 0.13, elbow[1], 1.0))
    low, high = 0.95, 1.25
    for _ in range(30):
        scene.move("table", at=(elbow[0] + 0.13, elbow[1], 0.5 * (low + high)))
        touches = len(scene.contacts(start, 1e-4).distance) > 0
        low, high = (low, 0.5 * (low + high)) if touches else (0.5 * (low + high), high)
    scene.move("table", at=(elbow[0] + 0.13, elbow[1], low - 0.002))
    turns, q, rng = [], start, np.random.default_rng(0)
    for frame in range(45):
        wanted = start.copy()
        wanted[2] -= 0.04 * min(frame / 30, 1.0)
        q = resolve_overlap(scene, q, wanted, rng).q
        shown, tracked = (avatar.placement(posture, "right_forearm") for posture in (q, wanted))
        turns.append(np.degrees(np.linalg.norm(pin.log3(shown.rotation.T @ tracked.rotation))))
    assert shown.translation[2] - tracked.translation[2] > 0.03
    assert max(turns) < 0.1
    assert np.ptp(turns[-10:]) < 0.01


@pytest.mark.parametrize(
    ("turns", "direction"),
    [
        ((0.0, 0.2, 0.43), (0.0, -1.0, 0.0)),
        ((-0.2, 0.2, 0.33), (0.0, -1.0, 0.0)),
        ((0.429, 0.073, 0.803), (0.099, 0.299, 0.949)),
    ],
)
def test_a_forearm_that_a_thing_moves_aside_keeps_its_direction(
    turns: tuple[float, ...], direction: tuple[float, ...], avatar: wb.Figure
) -> None:
    """A plate flush with the forearm moves it: it is translated, however often.

    Once nearly along the upper arm, where the elbow gets out on its sphere only by a longer way aside.
    """
    start = avatar.posture("standing").copy()
    for name, turn in zip(("shoulder_flexion", "shoulder_abduction", "elbow_flexion"), turns, strict=True):
        start[avatar.model.joints[avatar.joint_id(f"right_{name}")].idx_q] += turn
    joint, wrist = (avatar.placement(start, name).translation for name in ("right_forearm", "right_hand"))
    along = (wrist - joint) / np.linalg.norm(wrist - joint)
    out = np.array(direction) - along * (along @ direction)
    out /= np.linalg.norm(out)
    axes, middle = np.stack([out, np.cross(along, out), along], axis=1), joint + 0.45 * (wrist - joint)
    scene = wb.Scene(avatar).add(wb.Box((0.04, 0.5, 0.16)), name="plate")
    low, high = 0.0, 0.3
    for _ in range(25):
        scene.move("plate", at=pin.SE3(axes, middle + 0.5 * (low + high) * out))
        touches = len(scene.contacts(start, 1e-4).distance) > 0
        low, high = (0.5 * (low + high), high) if touches else (low, 0.5 * (low + high))
    q, rng, most = start, np.random.default_rng(0), 0.0
    for frame in range(40):
        scene.move("plate", at=pin.SE3(axes, middle + (high - 0.05 * min(frame / 30, 1.0)) * out))
        q = resolve_overlap(scene, q, start, rng).q
        shown, tracked = (avatar.placement(posture, "right_forearm") for posture in (q, start))
        most = max(most, float(np.degrees(np.linalg.norm(pin.log3(shown.rotation.T @ tracked.rotation)))))
    assert np.linalg.norm(shown.translation - tracked.translation) > 0.03
    assert most < 0.4


def test_a_forearm_that_an_edge_moves_aside_keeps_its_direction_to_its_round_end(avatar: wb.Figure) -> None:
    """The edge slides along the forearm to the elbow, where its normal is no more that of the shaft."""
    turns = {"right_shoulder_flexion": -0.073, "right_shoulder_abduction": 0.835, "right_elbow_flexion": 1.098}
    start = avatar.with_joints(avatar.posture("standing"), turns)
    at = pin.SE3(pin.exp3(np.array([1.643, 1.759, 1.466])), np.array([0.0781, -0.3132, 1.1684]))
    scene = wb.Scene(avatar).add(wb.Box((0.06, 0.14, 0.06)), name="bar", at=at)
    q, rng, most = start, np.random.default_rng(0), 0.0
    for frame in range(40):
        moved = min(frame / 30, 1.0) * np.array([-0.0142, -0.0374, 0.0008])
        scene.move("bar", at=pin.SE3(at.rotation, at.translation + moved))
        q = resolve_overlap(scene, q, start, rng).q
        shown, tracked = (avatar.placement(posture, "right_forearm") for posture in (q, start))
        most = max(most, float(np.degrees(np.linalg.norm(pin.log3(shown.rotation.T @ tracked.rotation)))))
    assert np.linalg.norm(shown.translation - tracked.translation) > 0.02
    assert most < 0.5


@pytest.mark.parametrize(("frames", "width", "at"), [(30, 0.10, 0.11), (8, 0.14, 0.15)])
def test_a_forearm_that_a_table_lifts_keeps_its_direction(
    frames: int, width: float, at: float, avatar: wb.Figure
) -> None:
    """A level table, not flush with the forearm, rises by 80 mm; the elbow rises as much as the wrist."""
    turns = {"right_shoulder_flexion": 0.64, "right_shoulder_abduction": 0.3, "right_elbow_flexion": 1.03}
    start = avatar.with_joints(avatar.posture("standing"), turns)
    joint, wrist = (avatar.placement(start, name).translation for name in ("right_forearm", "right_hand"))
    under = joint + at * (wrist - joint) / np.linalg.norm(wrist - joint)
    scene = wb.Scene(avatar).add(wb.Box((width, 0.1, 0.04)), name="table")
    low, high = -0.4, 0.0
    for _ in range(25):
        scene.move("table", at=under + (0.0, 0.0, 0.5 * (low + high)))
        touches = len(scene.contacts(start, 1e-4).distance) > 0
        low, high = (low, 0.5 * (low + high)) if touches else (0.5 * (low + high), high)
    q, rng, most = start, np.random.default_rng(0), 0.0
    for frame in range(frames + 10):
        scene.move("table", at=under + (0.0, 0.0, low + 0.08 * min((frame + 1) / frames, 1.0)))
        q = resolve_overlap(scene, q, start, rng).q
        shown, tracked = (avatar.placement(posture, "right_forearm") for posture in (q, start))
        most = max(most, float(np.degrees(np.linalg.norm(pin.log3(shown.rotation.T @ tracked.rotation)))))
    assert shown.translation[2] - tracked.translation[2] > 0.06
    assert most < 1.0
