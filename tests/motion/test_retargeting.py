"""Retargeting: real recordings and made-up skeletons, judged by forward kinematics of the figure alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.tasks import ReachCones

CLIPS = (
    *(f"cmu_{name}" for name in ("02_01", "02_03", "02_04", "02_06", "02_07", "35_01", "49_18")),
    *("cmu_12_01_cgspeed", "cmu_13_26_cgspeed_30fps", "deepmimic_getup_facedown"),
)
BONES = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
SIDES = ("left", "right")


@pytest.fixture(scope="module")
def human() -> Figure:
    return wb.load("human")


def bone(clip: wb.Clip, first: str, second: str) -> np.ndarray:
    """Unit directions (n, 3) from one frame of the figure to another."""
    model, data = clip.figure.model, clip.figure.model.createData()
    ways = []
    for q in clip.q:
        pin.framesForwardKinematics(model, data, q)
        a, b = (data.oMf[clip.figure.frame_id(name)].translation for name in (first, second))
        ways.append(b - a)
    return np.array(ways) / np.linalg.norm(ways, axis=1)[:, None]


def within(clip: wb.Clip) -> bool:
    cones = ReachCones().resolve(wb.Scene(clip.figure), clip.figure.neutral)
    state = wb.Scene(clip.figure).state(clip.q[0])
    return all(clip.figure.within_limits(q, 0.0) and cones.value(state.update(q)).min() > -1e-5 for q in clip.q)


def person(frames: int = 20, tall: float = 1.0, walking: bool = False) -> SkeletonMotion:
    """A skeleton with the names of SMPL that lifts its arms, and walks on the spot in which its left foot stands."""
    offsets = {
        "pelvis": ("", (0.0, 0.0, 0.0)), "left_hip": ("pelvis", (0.0, 0.09, -0.05)),
        "left_knee": ("left_hip", (0.0, 0.0, -0.42)), "left_ankle": ("left_knee", (0.0, 0.0, -0.41)),
        "left_foot": ("left_ankle", (0.13, 0.0, -0.05)), "right_hip": ("pelvis", (0.0, -0.09, -0.05)),
        "right_knee": ("right_hip", (0.0, 0.0, -0.42)), "right_ankle": ("right_knee", (0.0, 0.0, -0.41)),
        "right_foot": ("right_ankle", (0.13, 0.0, -0.05)), "spine3": ("pelvis", (0.0, 0.0, 0.3)),
        "neck": ("spine3", (0.0, 0.0, 0.2)), "head": ("neck", (0.02, 0.0, 0.12)),
        "left_shoulder": ("spine3", (0.0, 0.18, 0.15)), "left_elbow": ("left_shoulder", (0.0, 0.28, 0.0)),
        "left_wrist": ("left_elbow", (0.0, 0.26, 0.0)), "right_shoulder": ("spine3", (0.0, -0.18, 0.15)),
        "right_elbow": ("right_shoulder", (0.0, -0.28, 0.0)), "right_wrist": ("right_elbow", (0.0, -0.26, 0.0)),
    }  # fmt: skip
    names = tuple(offsets)
    parents = np.array([names.index(parent) if parent else -1 for parent, _ in offsets.values()])
    local = np.tile(np.eye(3), (frames, len(names), 1, 1))
    for k in range(frames):
        lift = -1.2 + 1.5 * k / max(1, frames - 1)
        local[k, names.index("left_shoulder")] = pin.utils.rotate("x", lift)
        local[k, names.index("right_shoulder")] = pin.utils.rotate("x", -lift)
        local[k, names.index("right_hip")] = pin.utils.rotate("y", -0.8 * k / frames if walking else 0.0)
    root = np.tile([0.0, 0.0, 0.94], (frames, 1))
    return SkeletonMotion.moved(
        names, parents, tall * np.array([o for _, o in offsets.values()]), local, tall * root, 1 / 30
    )


@pytest.mark.parametrize("name", CLIPS)
def test_real_recordings_keep_the_directions_of_their_limbs(name: str, human: Figure, shared_data: Path) -> None:
    motion = wb.read_skeleton(shared_data / "mocap" / f"{name}.bvh")
    motion = motion.part(0, min(60, len(motion)))
    clip = wb.retarget(motion, human)
    assert len(clip) == len(motion)
    assert clip.dt == motion.dt
    assert within(clip)
