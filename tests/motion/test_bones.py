"""The angles between the bones of a recording and those of a figure are measured, and great ones are told."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

import wholebody as wb
from tests.motion.test_ground import flat, walker
from wholebody.motion.retargeting import said_of
from wholebody.motion.skeleton import SkeletonMotion

NAMES = {"skeleton": {"left_shoulder": "a", "left_elbow": "b", "left_wrist": "c"}}


def arm(human: wb.Figure, turn: float) -> tuple[SkeletonMotion, wb.Clip]:
    """A figure that keeps still, and its own arm whose forearm is turned by an angle about an axis across it."""
    q = human.neutral
    at = [human.placement(q, f"left_{part}").translation for part in ("shoulder", "elbow", "wrist")]
    upper, lower = at[1] - at[0], at[2] - at[1]
    across = np.cross(lower, (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    lower = np.cos(turn) * lower + np.sin(turn) * np.cross(across, lower)
    motion = SkeletonMotion.moved(
        ("a", "b", "c"), np.array([-1, 0, 1]), np.array([np.zeros(3), upper, lower]),
        np.tile(np.eye(3), (3, 3, 1, 1)), np.tile(at[0], (3, 1)), 0.02,
    )  # fmt: skip
    return motion, wb.Clip(human, np.array([q] * 3), 0.02)


@pytest.mark.parametrize("turn", [0.0, 0.2, 0.5])
def test_the_angle_of_a_turned_bone_is_found(turn: float, human: wb.Figure) -> None:
    errors = wb.motion.bone_errors(*arm(human, turn), NAMES)
    assert errors["left_shoulder to left_elbow"] == pytest.approx(np.zeros(3), abs=1e-7)
    assert errors["left_elbow to left_wrist"] == pytest.approx(np.full(3, turn), abs=1e-7)
    told = said_of(errors)
    assert told == (
        "" if turn < 0.26 else "bones differ from the recording's (median): left_elbow to left_wrist by 29 degrees"
    )


def test_a_figure_that_cannot_follow_is_told(human: wb.Figure) -> None:
    motion, clip = arm(human, -1.2)  # the elbow does not bend backwards
    with pytest.warns(UserWarning, match=r"retarget: motion: bones differ .*left_elbow to left_wrist by \d+ degrees"):
        wb.retarget(motion, human, names=NAMES)
    with pytest.raises(wb.InputError, match="2 frames and the motion 3"):
        wb.motion.bone_errors(motion, wb.Clip(human, clip.q[:2], 0.02), NAMES)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert max(map(np.max, wb.motion.bone_errors(motion, clip, NAMES).values())) == pytest.approx(1.2)


def test_the_feet_of_who_hangs_in_a_scene_are_not_flat(human: wb.Figure) -> None:
    """The left foot rests on what the scene does not have, toes down: its sole is flat without the scene alone."""
    motion, _ = walker(flat, 3.0)
    at, foot = np.repeat(motion.positions[:1], 90, axis=0), motion.names.index("left_foot")
    at[:, [foot, foot - 1, foot - 2], 2] += 0.3 + 0.25 * np.abs(np.linspace(-1.0, 1.0, 90))[:, None] ** 8
    at[:, foot, 2] -= 0.05
    raised = dataclasses.replace(motion, positions=at)
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    clip = wb.Clip(human, np.array([human.neutral] * 90), motion.dt)
    found = wb.motion.bone_errors(raised, clip, scene=scene)["left_ankle to left_toe"]
    ends = [human.placement(human.neutral, f"left_{part}").translation for part in ("ankle", "toes")]
    recorded = np.arctan2(at[:, foot, 2] - at[:, foot - 1, 2], at[:, foot, 0] - at[:, foot - 1, 0])
    (x, _, z) = ends[1] - ends[0]
    assert found == pytest.approx(np.abs(recorded - np.arctan2(z, x)), abs=1e-3)
    assert wb.motion.bone_errors(raised, clip)["left_ankle to left_toe"].max() < 1e-3
    with pytest.raises(wb.InputError, match="several figures"):
        wb.motion.bone_errors(raised, clip, scene=wb.Scene({"a": human, "b": human}))


@pytest.mark.parametrize("bend", [0.4, 1.8])
def test_the_place_of_a_hand_bends_the_elbow_that_no_joint_is_known_for(bend: float, human: wb.Figure) -> None:
    q = human.with_joints(human.neutral, {"left_shoulder_flexion": 0.8, "left_elbow_flexion": bend})
    straight = human.with_joints(q, {"left_elbow_flexion": 0.1})
    parts = ("hip", "knee", "ankle", "shoulder", "wrist")
    names = ["pelvis", *(f"{side}_{part}" for side in ("left", "right") for part in parts)]
    places = np.array(
        [[human.placement(each, name).translation for name in names] for each in [q] * 6 + [straight] * 2]
    )
    still = np.tile(np.eye(3), (*places.shape[:2], 1, 1))
    parents = np.array([-1, *[0] * (len(names) - 1)])
    motion = SkeletonMotion(tuple(names), parents, places[0] - places[0, 0], still, places, 0.05)
    with pytest.warns(UserWarning, match="left_elbow"):
        clip = wb.retarget(motion, human)
    for k in range(4):
        assert human.joint_values(clip.q[k])["left_elbow_flexion"] == pytest.approx(bend, abs=0.2)
    assert "left_shoulder to left_wrist" in wb.motion.bone_errors(motion, clip)
