"""Hands that rest on the own body, of people of another size: a man touches his head, a hip, a thigh."""

from __future__ import annotations

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.motion.skeleton import SkeletonMotion

STARTS = {
    "head": {"right_shoulder_flexion": 1.6, "right_elbow_flexion": 2.0},
    "pelvis": {"right_shoulder_abduction": 0.7, "right_elbow_flexion": 1.4},
    "right_thigh": {
        **{f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in (
            ("hip_flexion", 1.2), ("knee_flexion", 1.0), ("ankle_dorsiflexion", 0.3))},
        "right_shoulder_flexion": 0.6, "right_elbow_flexion": 0.5,
    },
}  # fmt: skip
HELD = slice(6, 22)  # frames in which the source touches


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


@pytest.mark.parametrize(("part", "stature"), [("head", 1.9), ("pelvis", 1.5), ("right_thigh", 1.5)])
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
    motion = wb.motion.read_skeleton(shared_data / "mocap" / "cmu_35_01.bvh")
    assert to_part(wb.retarget(motion, wb.load("human")), "right_thigh")[:, 0].min() > 0.02
