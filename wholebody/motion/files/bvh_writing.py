"""Clips as BVH, and clips that were written so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.files import Scratch
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import Frames, Motion
from wholebody.motion.files.bvh import pybvh
from wholebody.motion.files.euler import angles_about
from wholebody.motion.files.nodes import OFF, nodes_of, postures, rotations, wrapped
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion

ORDER = "ZXY"
"""Order of rotations, as most writers of BVH have it."""

UNIT = "centimetres"
"""Unit of length: with six digits after the point, 1e-8 m."""


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as BVH: y up, z forward, centimetres, one joint for all of the figure's joints at one place.

    Raises:
        InputError: a joint of the figure slides, or the file cannot be written.
        MissingPackageError: pybvh is not installed.
    """
    library = pybvh()
    kinds = library.bvhnode
    nodes = nodes_of(motion.figure)
    local, root = rotations(motion.figure, nodes, motion.q)
    back, scale = UP["y"].T, 1.0 / UNITS[UNIT]
    made: list[Any] = []
    for node in nodes:
        offset = (scale * back @ node.offset).tolist()
        if node.parent < 0:
            made.append(kinds.BvhRoot(node.name, offset, ["X", "Y", "Z"], list(ORDER), [], None))
        else:
            made.append(kinds.BvhJoint(node.name, offset, list(ORDER), [], made[node.parent]))
            made[node.parent].children = [*made[node.parent].children, made[-1]]
        if node.tip is not None:
            end = kinds.BvhEndSite(f"{node.name}_end", (scale * back @ node.tip).tolist(), made[-1])
            made[-1].children = [end]
    tree = _depth_first(made[0])
    written = library.Bvh(
        nodes=tree,
        root_pos=scale * root @ back.T,
        joint_angles=_angles(back @ local @ back.T)[:, [made.index(node) for node in tree if node in made]],
        frame_time=motion.dt,
        world_up="+y",
    )
    with Scratch() as folder:
        library.write_bvh_file(written, folder / "clip.bvh")
        content = (folder / "clip.bvh").read_text()
    return write_file(path, content)


def own(motion: SkeletonMotion, figure: Figure) -> Frames | None:
    """Postures of a skeleton that is the figure's own, as `write` writes it; None for any other skeleton."""
    try:
        nodes = nodes_of(figure)
    except InputError:
        return None
    names = {name: k for k, name in enumerate(motion.names)}
    if any(node.name not in names for node in nodes):
        return None
    at = [names[node.name] for node in nodes]
    for node, joint in zip(nodes, at, strict=True):
        if np.abs(motion.offsets[joint] - node.offset).max() > OFF:
            return None
        if node.parent >= 0 and motion.parents[joint] != at[node.parent]:
            return None
    world = motion.rotations[:, at]
    local = np.array(world)
    local[:, 1:] = np.swapaxes(world[:, [node.parent for node in nodes[1:]]], 2, 3) @ world[:, 1:]
    q = postures(figure, nodes, local, motion.positions[:, at[0]])
    return None if q is None else Frames(q, motion.dt, motion.name)


def _depth_first(node: Any) -> list[Any]:
    """A node and all below it, in the order of the file."""
    return [node, *(below for child in getattr(node, "children", []) for below in _depth_first(child))]


def _angles(local: Array) -> Array:
    """Euler angles (n, nodes, 3), radians, without flips: of the two solutions the one nearer to the frame before."""
    frames, count = local.shape[:2]
    axes = np.eye(3)[["XYZ".index(axis) for axis in ORDER]]
    first = np.stack([angles_about(Rotation.from_matrix(local[:, node]), axes) for node in range(count)], axis=1)
    other = first * (1.0, -1.0, 1.0) + np.pi
    found = np.array(first)
    for k in range(1, frames):
        near = [found[k - 1] + wrapped(choice[k] - found[k - 1]) for choice in (first, other)]
        jumps = [np.abs(choice - found[k - 1]).sum(axis=1) for choice in near]
        found[k] = np.where((jumps[1] < jumps[0])[:, None], near[1], near[0])
    return found
