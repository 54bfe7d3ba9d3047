"""Hands that rest on the own body, of people of another size: a man touches his head, a hip, a thigh; hands meet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.test_ground import flat, walker
from tests.motion.test_retargeting import person
from tests.motion.test_things import robot, with_hands
from wholebody.motion.holds import Holds
from wholebody.motion.posture_fit import Fitter
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.thing_contacts import own_rests

STARTS = {
    "head": {"right_shoulder_flexion": 1.6, "right_elbow_flexion": 2.0},
    "pelvis": {"right_shoulder_abduction": 0.7, "right_elbow_flexion": 1.4},
    "right_thigh": {
        **{f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in (
            ("hip_flexion", 1.2), ("knee_flexion", 1.0), ("ankle_dorsiflexion", 0.3))},
        "right_shoulder_flexion": 0.6, "right_elbow_flexion": 0.5,
    },
}  # fmt: skip
HELD = slice(6, 26)  # frames in which the source touches


def touching(part: str, folder: Path) -> tuple[SkeletonMotion, wb.Clip]:
    """A man of 1.8 m brings his palm to a part of his body, keeps it there, leans if it is the head, and lets go."""
    man = wb.load("human", stature=1.8)
    scene = wb.Scene(man).add(wb.HalfSpace(), name="floor")
    start = man.grounded(man.with_joints(man.posture("standing"), STARTS[part]), scene)
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    goals = [wb.tasks.Touch("right_palm", part)]
    held = wb.solve(wb.Problem(scene, start=start, goals=goals, constraints=feet, balance=False))
    assert held.status == "solved"
    found = [pin.interpolate(man.model, start, held.q, share) for share in np.linspace(0.0, 1.0, 6, endpoint=False)]
    lean = man.joint_values(held.q)["spine1_flexion"] if part == "head" else None
    for sway in 0.1 * np.sin(np.linspace(0.0, np.pi, HELD.stop - HELD.start)):
        found.append(held.q if lean is None else man.with_joints(held.q, {"spine1_flexion": lean + sway}))
    found += [pin.interpolate(man.model, held.q, start, share) for share in np.linspace(0.1, 1.0, 6)]
    clip = wb.Clip(man, np.array(found), 1 / 30, part)
    return wb.motion.read_skeleton(clip.write(folder / "touching.bvh")), clip


def to_part(clip: wb.Clip, part: str) -> np.ndarray:
    """(n,) distance of the right hand to a part of the body, by coal; (n, 3) the palm in the part's axes."""
    figure, model = clip.figure, clip.figure.model
    palm, hand, base = (figure.frame_id(name) for name in ("right_palm", "right_hand", part))
    own, other = (
        [one for one in figure.geometry.geometryObjects if one.parentJoint == model.frames[index].parentJoint]
        for index in (hand, base)
    )
    data, found = model.createData(), []
    for q in clip.q:
        pin.framesForwardKinematics(model, data, q)
        mine, theirs = (
            [
                (one.geometry, coal.Transform3s(at.rotation, at.translation))
                for one in pieces
                for at in [data.oMi[one.parentJoint] * one.placement]
            ]
            for pieces in (own, other)
        )
        apart = [
            coal.distance(*one, *beside, coal.DistanceRequest(), coal.DistanceResult())
            for one in mine
            for beside in theirs
        ]
        found.append([min(apart), *data.oMf[base].actInv(np.array(data.oMf[palm].translation))])
    return np.array(found)


@pytest.mark.parametrize(("part", "stature"), [("head", 1.9), ("pelvis", 1.5)])
def test_a_hand_that_rests_on_the_body_does_so(part: str, stature: float, tmp_path: Path) -> None:
    motion, source = touching(part, tmp_path)
    assert to_part(source, part)[HELD, 0].max() < 1e-3
    figure = wb.load("human", sex="female" if stature < 1.7 else "male", stature=stature)
    clip = wb.retarget(motion, figure)
    held = to_part(clip, part)[HELD][2:-2]  # when a hand is slow
    assert np.abs(held[:, 0]).max() < 1e-3
    assert np.ptp(held[:, 1:], axis=0).max() < 2e-3  # the hand may turn a little about its middle
    assert wb.check(clip).colliding == 0
    if stature < 1.7:  # larger people happen to come near
        loose = to_part(wb.retarget(motion, figure, ground=None), part)[HELD][2:-2, 0]
        assert np.abs(loose).max() > 2e-3


def test_hands_of_a_walk_swing_past_the_thighs(shared_data: Path) -> None:
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_35_01.bvh").part(0, 60)
    assert to_part(wb.retarget(motion, wb.load("human")), "right_thigh")[:, 0].min() > 0.02


def test_an_arm_that_swings_little_touches_no_hip() -> None:
    """Swings of 5 cm either way in 1.4 s: at each end the hand is slower than 0.15 m/s for a third of a second."""
    names = ("hips", "left_hip", "right_hip", "right_wrist")
    places, time = np.zeros((90, 4, 3)), np.arange(90) / 30.0
    places[:, :, 2] = 1.0
    places[:, 1:, 1] = 0.1, -0.1, -0.21
    rests = []
    for far in (0.05, 0.0):
        places[:, 3, 0] = far * np.sin(2.0 * np.pi / 1.4 * time)
        turns = np.tile(np.eye(3), (90, 4, 1, 1))
        motion = SkeletonMotion(names, np.array([-1, 0, 0, 0]), places[0] - places[0, :1], turns, places, 1 / 30)
        rests.append(own_rests(motion, {name: name for name in names[1:]}, {"right_wrist": 1.0}, []))
    assert [[(rest.thing, rest.first, rest.end) for rest in each] for each in rests] == [[], [("pelvis", 0, 90)]]


def hand_distance(clip: wb.Clip, ends: str) -> np.ndarray:
    """(n,) distance of the pieces of one hand to those of the other, by coal."""
    figure, found = clip.figure, []
    data, placed = figure.model.createData(), figure.geometry.createData()
    joints = [figure.model.frames[figure.frame_id(f"{side}_{ends}")].parentJoint for side in ("left", "right")]
    for q in clip.q:
        pin.updateGeometryPlacements(figure.model, data, figure.geometry, placed, q)
        left, right = (
            [
                (piece.geometry, coal.Transform3s(at.rotation, at.translation))
                for piece, at in zip(figure.geometry.geometryObjects, placed.oMg, strict=True)
                if joint in figure.model.supports[piece.parentJoint]
            ]
            for joint in joints
        )
        found.append(
            min(
                coal.distance(*one, *other, coal.DistanceRequest(), coal.DistanceResult())
                for one in left
                for other in right
            )
        )
    return np.array(found)


def meeting() -> SkeletonMotion:
    """A person of 1.75 m whose hands are 5 cm apart before the chest."""
    low, high = 0.0, 1.2
    while high - low > 1e-6:  # how far the arms, which point forward, are turned inward
        motion = person(12)
        local = np.tile(np.eye(3), (12, len(motion.names), 1, 1))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            local[:, motion.names.index(f"{side}_shoulder")] = pin.utils.rotate("z", -sign * 0.5 * (np.pi + low + high))
        root = np.tile([0.0, 0.0, 0.94], (12, 1))
        motion = SkeletonMotion.moved(motion.names, motion.parents, motion.offsets, local, root, 1 / 30, "meeting")
        motion = with_hands(motion)
        hands = [
            motion.positions[:, [motion.names.index(f"{side}_{part}") for part in ("wrist", "hand")]].mean(axis=1)
            for side in ("left", "right")
        ]
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (hands[0] - hands[1])[0, 1] > 0.05 else (low, middle)
    return motion


def test_wrists_without_pieces_meet_as_far_apart_as_hands_that_touch(tmp_path: Path) -> None:
    """The recorded hands are 5 cm apart; wrists keep 6 cm, and the forearms, which have pieces, stay apart."""
    figure = robot(tmp_path, 0.01)
    clip = wb.retarget(meeting(), figure)
    data, apart = figure.model.createData(), []
    for q in clip.q:
        pin.forwardKinematics(figure.model, data, q)
        left, right = (
            data.oMi[figure.model.getJointId(f"{side}_wrist_yaw_joint")].translation for side in ("left", "right")
        )
        apart.append(np.linalg.norm(left - right))
    assert min(apart) > 0.058
    assert max(apart) < 0.068
    assert wb.check(clip).colliding == 0


@pytest.mark.parametrize("stature", [1.5, None])
def test_hands_that_meet_in_the_recording_meet(stature: float | None, tmp_path: Path) -> None:
    """Hands of a person of 1.75 m are 5 cm apart, as palms that touch are; those of others touch, a robot's too."""
    motion = meeting()
    figure = robot(tmp_path) if stature is None else wb.load("human", stature=stature)
    clip = wb.retarget(motion, figure)
    apart = hand_distance(clip, "wrist_yaw" if stature is None else "hand")
    assert apart.min() > 0.0
    assert apart.max() < 1e-3
    assert wb.check(clip).colliding == 0
    assert np.ptp(clip.q[:, :3], axis=0).max() < 5e-3  # who stands still in the recording does so
    alone = hand_distance(wb.retarget(motion, figure, ground=None), "wrist_yaw" if stature is None else "hand")
    assert np.abs(alone).min() > 2e-3


def test_what_cannot_be_reached_is_known_after_the_first_pass(
    human: wb.Figure, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second time around costs a part of the first one."""
    motion, _ = walker(flat, 1.5)
    step, steps = Fitter.step, list[object]()

    def counted(self: Fitter, *given: Any, **named: Any) -> np.ndarray:
        steps.append(given)
        return step(self, *given, **named)

    monkeypatch.setattr(Fitter, "step", counted)
    wb.retarget(motion, human)
    once, gone = len(steps), [True, False]
    monkeypatch.setattr(Holds, "give_up", lambda self: gone.pop(0))
    wb.retarget(motion, human)
    assert not gone
    assert once < len(steps) - once < 1.4 * once
