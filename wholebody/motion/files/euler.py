"""Angles about three axes in turn, which files of skeletons hold, also where such angles are not unique."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array

LOCKED = 1e-6
"""Radians from gimbal lock: six digits of a degree, as BVH has, say nothing there of the first and the third angle."""


def angles_about(turned: Rotation, axes: Array) -> Array:
    """Angles (n, 3) of rotations about axes (3, 3), rows, each turned by the ones before; radians.

    In gimbal lock only the sum or the difference of the first and the third angle is known. The third one is then that
    of the nearest frame without, so that no angle jumps for a frame; zero where all frames are locked.

    Args:
        turned: n rotations, frame by frame.
        axes: unit vectors; the second is orthogonal to both others.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        found: Array = turned.as_davenport(axes, "intrinsic")
    first_is_third = abs(float(axes[0] @ axes[2])) > 0.5
    locked = np.abs(np.sin(found[:, 1]) if first_is_third else np.cos(found[:, 1])) < LOCKED
    free = np.flatnonzero(~locked)
    if not locked.any() or not len(free):
        return found
    at = np.flatnonzero(locked)
    after = np.minimum(np.searchsorted(free, at), len(free) - 1)
    before = np.maximum(after - 1, 0)
    near = np.where(at - free[before] < np.abs(free[after] - at), free[before], free[after])
    found[at, 2] = found[near, 2]
    back = Rotation.from_rotvec(-found[at, 2:] * axes[2]) * Rotation.from_rotvec(-found[at, 1:2] * axes[1])
    found[at, 0] = (turned[at] * back).as_rotvec() @ axes[0]
    return found
