"""BVH: skeletons that move, read and written by pybvh."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError, InputError, MissingPackageError
from wholebody.base.files import read_text, title_of
from wholebody.motion.files.bvh_text import BvhText, parsed
from wholebody.motion.files.text import LARGEST_FILE
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion, longest_way, recognised_unit

STEADY = 0.01
"""Share of the skeleton's size by which the place of a joint in its parent may change before it is told."""

RESTING = 1e-3
"""Radians by which the joints of a rest posture turn at most. Converters put one before the motion."""

FEW = 0.25
"""Share of the angles that change later, of which less are not zero in a rest posture: a tenth in CMU files,
nine tenths in recorded frames."""

JUMP = 3.0
"""How much larger the change from the rest posture to the motion is than the median one within the motion, at least."""


def pybvh() -> ModuleType:
    """Import pybvh.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        pybvh: ModuleType = import_module("pybvh")
    except ImportError:
        raise MissingPackageError("BVH files need pybvh; install it with pip install 'wholebody[motion]'") from None
    return pybvh


def read_motion(path: Path, unit: str | None = None, up: str | None = None) -> SkeletonMotion:
    """Read a moving skeleton, with any order of channels.

    Args:
        path: the file.
        unit: "metres", "centimetres", ... of `UNITS`; recognised by the size of the skeleton if left out.
        up: "y" or "z"; recognised by the rest posture if left out.

    Raises:
        FileFormatError: the file cannot be read; the line is named.
        MissingPackageError: pybvh is not installed.
    """
    library = pybvh()
    found = parsed(read_text(path, "motion", LARGEST_FILE), path.name)
    offsets, root, notes = _offsets(found)
    made = _pybvh_motion(library, found, offsets, root)
    parents = np.array([joint.parent for joint in found.joints], dtype=np.intp)
    if longest_way(parents, offsets) == 0.0:
        raise FileFormatError(f"{path.name}: all joints of the skeleton are at one place; give their offsets")
    if up is None:
        rest = made.rest_up or made.world_up
        up = rest[1] if rest in ("+y", "+z") else "y"
        notes.append(f"{up} is up")
    if unit is None:
        unit = recognised_unit(parents, offsets)
        notes.append(f"lengths are in {unit}")
    if _begins_with_rest(np.asarray(made.joint_angles)[:, 1:]):
        notes.append("the first frame is the rest posture and no part of the motion; it is left out")
        first = 1
    else:
        first = 0
    turn, scale = UP[up], UNITS[unit]
    moving = np.array([bool(joint.channels) for joint in found.joints])
    local = np.tile(np.eye(3), (len(found.table) - first, len(parents), 1, 1))
    local[:, moving] = turn @ made.to_rotmat()[1][first:] @ turn.T
    try:
        return SkeletonMotion.moved(
            tuple(joint.name for joint in found.joints),
            parents,
            scale * offsets @ turn.T,
            local,
            scale * root[first:] @ turn.T,
            made.frame_time,
            title_of(path),
            tuple(notes),
        )
    except InputError as error:
        raise FileFormatError(f"{path.name}: {error}") from None


def _begins_with_rest(angles: Array) -> bool:
    """Whether the first frame is a rest posture, and the second is not.

    No joint but the root turns in it; or few do, and a jump leads to the second frame: in CMU's converted files some
    joints of the rest posture turn by whole degrees.

    Args:
        angles: (frames, joints, 3) of all joints but the root, radians.
    """
    if len(angles) < 2:
        return False
    turns = np.abs(angles) >= RESTING
    if not turns[0].any():
        return bool(turns[1].any())
    moving = np.ptp(angles[1:], axis=0) >= RESTING
    if len(angles) < 3 or not moving.any() or turns[0][moving].mean() >= FEW:
        return False
    ways = np.abs(np.angle(np.exp(1j * np.diff(angles, axis=0)))).max(axis=(1, 2))
    return bool(ways[0] > JUMP * np.median(ways[1:]))


def _columns(found: BvhText) -> list[dict[tuple[str, str], Array]]:
    """The channels of each joint: (axis, kind) to its numbers (n,)."""
    columns, at = [], 0
    for joint in found.joints:
        columns.append({channel: found.table[:, at + k] for k, channel in enumerate(joint.channels)})
        at += len(joint.channels)
    return columns


def _offsets(found: BvhText) -> tuple[Array, Array, list[str]]:
    """Offsets (j, 3), the way of the root (n, 3), and notes; positions of joints stand in place of their offsets."""
    offsets = np.array([joint.offset for joint in found.joints])
    columns = _columns(found)
    size = longest_way(np.array([joint.parent for joint in found.joints]), offsets)
    notes = []
    for k, joint in enumerate(found.joints[1:], 1):
        for axis in range(3):
            values = columns[k].get(("XYZ"[axis], "position"))
            if values is not None:
                offsets[k, axis] = values.mean()
                if np.ptp(values) > STEADY * size:
                    notes.append(f"the length of the bone to {joint.name} changes; its mean is taken")
    root = np.stack([columns[0]["XYZ"[axis], "position"] for axis in range(3)], axis=1)
    offsets[0] = 0.0  # the root's channels are its place in the world
    return offsets, root, notes


def _pybvh_motion(library: ModuleType, found: BvhText, offsets: Array, root: Array) -> Any:
    """The motion in pybvh's classes; rotations that a joint lacks are zero."""
    nodes = library.bvhnode
    made: list[Any] = []
    angles = []
    for k, (joint, values) in enumerate(zip(found.joints, _columns(found), strict=True)):
        offset = offsets[k].tolist()
        order = [axis for axis, kind in joint.channels if kind == "rotation"]
        order += [axis for axis in "XYZ" if axis not in order]
        if k == 0:
            node = nodes.BvhRoot(joint.name, offset, ["X", "Y", "Z"], order, [], None)
        elif joint.channels:
            node = nodes.BvhJoint(joint.name, offset, order, [], made[joint.parent])
        else:
            node = nodes.BvhEndSite(joint.name, offset, made[joint.parent])
        if k:
            made[joint.parent].children = [*made[joint.parent].children, node]
        made.append(node)
        if joint.channels:
            zero = np.zeros(len(found.table))
            angles.append(np.stack([np.radians(values.get((axis, "rotation"), zero)) for axis in order], axis=1))
    return library.Bvh(
        nodes=made,
        root_pos=root,
        joint_angles=np.stack(angles, axis=1),
        frame_time=found.dt,
        world_up="+y",
    )
