"""How well a retargeted clip follows its skeleton: the angle between each bone and that of the figure."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import instance
from wholebody.base.errors import InputError
from wholebody.motion.clip import Clip
from wholebody.motion.roles import Roles, matched
from wholebody.motion.skeleton import SkeletonMotion, checked_motion

LIMB = {"arm": ("shoulder", "elbow", "wrist", "hand"), "leg": ("hip", "knee", "ankle", "toe")}
LOUD = 0.2618
"""Radians: a median error of a bone from which retargeting warns, 15 degrees."""


def bone_errors(
    motion: SkeletonMotion,
    clip: Clip,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
) -> dict[str, Array]:
    """The angle (n,) in radians between each bone of a skeleton and that of a figure, by the bone's two ends.

    Args:
        motion: the skeleton.
        clip: the motion of the figure, from `retarget`, frame by frame the same.
        names: as for `retarget`.

    Returns:
        Errors by names such as "left_shoulder to left_elbow"; a bone without both ends, or without a length, has none.

    Raises:
        InputError: the clip has another number of frames, or no bones are known to belong to the figure.
    """
    motion = checked_motion(motion, "bone_errors: motion")
    instance(clip, Clip, "bone_errors: clip", "give that of wb.retarget(motion, figure)")
    if len(clip) != len(motion):
        raise InputError(
            f"bone_errors: the clip has {len(clip)} frames and the motion {len(motion)}; give its own clip"
        )
    return errors_of(motion, clip, matched(motion.names, clip.figure, names))


def errors_of(motion: SkeletonMotion, clip: Clip, roles: Roles) -> dict[str, Array]:
    """The same with known roles."""
    model, data = clip.figure.model, clip.figure.model.createData()
    frames = {role: clip.figure.frame_id(frame) for role, frame in roles.frames.items()}
    places = {role: np.empty((len(clip), 3)) for role in frames}
    for k, q in enumerate(clip.q):
        pin.framesForwardKinematics(model, data, q)
        for role, frame in frames.items():
            places[role][k] = data.oMf[frame].translation
    found = {}
    for side in ("left", "right"):
        for limb in LIMB.values():
            for first, second in pairwise(limb):
                ends = f"{side}_{first}", f"{side}_{second}"
                if not all(end in places for end in ends):
                    continue
                theirs, ours = (
                    there[ends[1]] - there[ends[0]]
                    for there in (
                        {end: motion.positions[:, motion.names.index(roles.joints[end])] for end in ends},
                        places,
                    )
                )
                lengths = np.linalg.norm(theirs, axis=1) * np.linalg.norm(ours, axis=1)
                if lengths.min() > 1e-9:
                    across = np.linalg.norm(np.cross(theirs, ours), axis=1)
                    found[" to ".join(ends)] = np.arctan2(across, np.einsum("ni,ni->n", theirs, ours))
    return found


def said_of(errors: Mapping[str, Array]) -> str:
    """A sentence on bones whose median error is loud; empty without one."""
    loud = {name: float(np.degrees(np.median(values))) for name, values in errors.items() if np.median(values) > LOUD}
    listed = ", ".join(
        f"{name} by {angle:.0f} degrees" for name, angle in sorted(loud.items(), key=lambda one: -one[1])
    )
    return f"bones differ from the recording's (median): {listed}" if loud else ""
