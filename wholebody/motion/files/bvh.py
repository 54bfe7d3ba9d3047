"""BVH: skeletons that move, with any order of channels; clips are written with one order."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import read_foreign_text, title_of
from wholebody.base.files import write as write_file
from wholebody.figures.figure import Figure
from wholebody.motion.files.base import LARGEST_FILE, Frames, Motion
from wholebody.motion.files.bvh_text import BvhText, parsed
from wholebody.motion.files.nodes import OFF, Node, angles_about, nodes_of, postures, rotations, wrapped
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion, longest_way
from wholebody.motion.structure import recognised_unit, stands_along


def read_motion(path: Path, unit: str | None = None, up: str | None = None) -> SkeletonMotion:
    """Read a moving skeleton; see `wholebody.motion.reading.read_skeleton`."""
    found = parsed(read_foreign_text(path, "motion", LARGEST_FILE), path.name)
    mark, _, rest = found.joints[0].name.partition(":")
    ours = mark == MARK and bool(rest)
    if ours:
        unit, up, found.joints[0].name = unit or MARK, up or "y", rest
    parents, offsets = found.parents, np.array([joint.offset for joint in found.joints])
    notes = [*found.notes, *_mean_offsets(found, parents, offsets)]
    angles, local = _rotations(found)
    if longest_way(parents, offsets) == 0.0:
        raise FileFormatError(f"{path.name}: all joints of the skeleton are at one place; give their offsets")
    top = 0 if ours else _moved_joint(found, parents, offsets)
    names = tuple(joint.name for joint in found.joints)
    first = int(not ours and _begins_with_rest(angles[:, 1:]))
    if up is None:
        up = _up(names, parents, offsets, top)
        notes.append(f"{up} is up")
        other = _other_up(up, parents, offsets, local[first:], found.positions(0)[first:])
        if other != up:
            notes[-1] = f"{other} is up in the motion, though {up} is in the rest posture"
            up = other
    if unit is None:
        unit = recognised_unit(parents, offsets)
        notes.append(f"lengths are in {unit}")
    if first:
        notes.append("the first frame is the rest posture and no part of the motion; it is left out")
    if top:
        notes = [note for note in notes if f"the bone to {names[top]} changes" not in note]
        notes.append(f"{names[top]} moves below {names[0]}, which is left out")
    scale = UNITS[unit] * UP[up]
    local, root = UP[up] @ local[first:] @ UP[up].T, found.positions(0)[first:] @ scale.T
    try:
        motion = SkeletonMotion.moved(
            names, parents, offsets @ scale.T, local, root, found.dt, title_of(path), tuple(notes)
        )
        motion = _lengthened(motion, found, first, scale)
        return _from(top, motion) if top else motion
    except InputError as error:
        raise FileFormatError(f"{path.name}: {error}") from None


def _lengthened(motion: SkeletonMotion, found: BvhText, first: int, scale: Array) -> SkeletonMotion:
    """The motion with the places of the joints where the lengths of bones change."""
    moving = [found.moves(joint) for joint in range(len(found.joints))]
    if not any(moving[1:]):
        return motion
    positions = np.array(motion.positions)
    for joint in range(1, len(moving)):
        parent = motion.parents[joint]
        step: Array = found.positions(joint)[first:] @ scale.T if moving[joint] else motion.offsets[joint]
        turned = np.einsum("nij,nj->ni", motion.rotations[:, parent], np.broadcast_to(step, (len(motion), 3)))
        positions[:, joint] = positions[:, parent] + turned
    return replace(motion, positions=positions)


def _from(top: int, motion: SkeletonMotion) -> SkeletonMotion:
    """The part of a moving skeleton from a joint on."""
    kept, parents = [top], [-1]
    for joint in range(top + 1, len(motion.parents)):
        if motion.parents[joint] in kept:
            parents.append(kept.index(int(motion.parents[joint])))
            kept.append(joint)
    offsets = motion.offsets[kept]
    offsets[0] = 0.0
    return SkeletonMotion(
        tuple(motion.names[joint] for joint in kept), np.array(parents), offsets, motion.rotations[:, kept],
        motion.positions[:, kept], motion.dt, motion.name, motion.notes,
    )  # fmt: skip


def _moved_joint(found: BvhText, parents: Indices, offsets: Array) -> int:
    """The joint whose positions move the skeleton below a root that carries nothing else; 0 for the root itself."""
    size, at = longest_way(parents, offsets), 0
    while True:
        below = [k for k in range(len(parents)) if parents[k] == at and found.joints[k].channels]
        if len(below) != 1:
            return 0
        at = below[0]
        if np.ptp(found.positions(at), axis=0).max() > 0.01 * size:
            return at


def _begins_with_rest(angles: Array) -> bool:
    """Whether only the first frame is a rest posture, by angles (frames, joints, 3) without the root's."""
    # No joint turns in it, or few do and a jump follows: in CMU's files some of its joints turn by whole degrees.
    if len(angles) < 2:
        return False
    still = 1e-3  # rad
    size = np.abs(angles)
    if not (size[0] >= still).any():
        return bool((size[1] >= still).any())
    moving = np.ptp(angles[1:], axis=0) >= still
    # a tenth of the angles that change later turn more than a little in CMU's rest postures, nine tenths in others
    turns = size[0] >= np.maximum(still, 0.1 * np.median(size[1:], axis=0))
    if len(angles) < 3 or not moving.any() or turns[moving].mean() >= 0.25:
        return False
    turned = np.abs(np.angle(np.exp(1j * np.diff(angles, axis=0)))).max(axis=(1, 2))
    return bool(turned[0] > 3.0 * np.median(turned[1:]))


def _mean_offsets(found: BvhText, parents: Indices, offsets: Array) -> list[str]:
    """Put mean positions of joints in place of their offsets (j, 3); sentences on those that change."""
    size, notes = longest_way(parents, offsets), []
    for k, joint in enumerate(found.joints[1:], 1):
        for axis, values in enumerate(found.positions(k).T if found.moves(k) else ()):
            offsets[k, axis] = values.mean()
            if np.ptp(values) > 0.01 * size:
                notes.append(f"the length of the bone to {joint.name} changes; its mean is that of the rest posture")
    offsets[0] = 0.0  # the root's channels are its place in the world
    return list(dict.fromkeys(notes))


def _rotations(found: BvhText) -> tuple[Array, Array]:
    """Angles (n, moving joints, 3), radians, and rotations of all joints in their parents (n, joints, 3, 3)."""
    angles, local = list[Array](), np.tile(np.eye(3), (len(found.table), len(found.joints), 1, 1))
    for k, (joint, values) in enumerate(zip(found.joints, found.columns, strict=True)):
        if joint.channels:
            order = [axis for axis, kind in joint.channels if kind == "rotation"]
            order += [axis for axis in "XYZ" if axis not in order]
            zero = np.zeros(len(found.table))
            angles.append(np.stack([np.radians(values.get((axis, "rotation"), zero)) for axis in order], axis=1))
            local[:, k] = Rotation.from_euler("".join(order), angles[-1]).as_matrix()
    return np.stack(angles, axis=1), local


def _up(joints: Sequence[str], parents: Indices, offsets: Array, root: int = 0) -> str:
    """The axis that is up in the rest posture: towards the head, or else of the largest extent; "y" for any but z."""
    rest = np.zeros_like(offsets)
    for k in range(root + 1, len(parents)):
        rest[k] = rest[parents[k]] + offsets[k]
    names = [joint.lower() for joint in joints]
    tops = (rest[names.index(name)] for name in ("head", "neck", "chest", "spine") if name in names)
    extent = np.ptp(rest, axis=0)
    most = int(np.argmax(extent))
    way = next((top for top in tops if np.linalg.norm(top) > 1e-6), np.eye(3)[most] * rest[:, most].mean())
    axis = int(np.argmax(np.abs(way)))
    return "z" if axis == 2 and way[axis] >= 0.0 else "y"


def _other_up(up: str, parents: Indices, offsets: Array, local: Array, root: Array) -> str:
    """The other axis where a person stands along it on the ground, as a root that is turned makes it; else `up`."""
    other = "z" if up == "y" else "y"
    picked, names = np.linspace(0, len(local) - 1, min(len(local), 16)).astype(np.intp), map(str, range(len(parents)))
    motion = SkeletonMotion.moved(tuple(names), parents, offsets, local[picked], root[picked], 1.0)
    return other if stands_along(motion, "xyz".index(other)) else up


ORDER = "ZXY"  # of rotations, as most writers of BVH have it
MARK = "centimetres"  # before the name of a root, as a name space: an own file that would not be recognised as such


def write(motion: Motion, path: Path) -> Path:
    """Write a clip as BVH: y up, z forward, centimetres, one joint for all of the figure's joints at one place."""
    nodes = nodes_of(motion.figure)
    local, places = rotations(motion.figure, nodes, motion.q)
    back, scale = UP["y"].T, 1.0 / UNITS["centimetres"]  # six digits of which are 1e-8 m
    lines, order = ["HIERARCHY"], list[int]()

    def add(number: int, indent: str) -> None:
        node = nodes[number]
        order.append(number)
        kind = "JOINT" if indent else "ROOT"
        channels = "6 Xposition Yposition Zposition" if number in moved else "3"
        rotating = " ".join(f"{axis}rotation" for axis in ORDER)
        name = node.name if indent or plain else f"{MARK}:{node.name}"
        lines.extend([f"{indent}{kind} {name}", f"{indent}{{", offset(indent, node.offset)])
        lines.append(f"{indent}\tCHANNELS {channels} {rotating}")
        for child, other in enumerate(nodes):
            if other.parent == number:
                add(child, f"{indent}\t")
        if node.tip is not None:
            lines.extend([f"{indent}\tEnd Site", f"{indent}\t{{", offset(f"{indent}\t", node.tip), f"{indent}\t}}"])
        lines.append(f"{indent}}}")

    def offset(indent: str, place: Array) -> str:
        return f"{indent}\tOFFSET " + " ".join(f"{value:.6f}" for value in (scale * back @ place).tolist())

    angles = np.degrees(_angles(back @ local @ back.T))
    moved = [k for k, node in enumerate(nodes) if node.free or not k]
    plain = len(moved) == 1 and _recognised(nodes, scale * back, angles, back @ local @ back.T, places[:, 0])
    add(0, "")
    lines += ["MOTION", f"Frames: {len(motion.q)}", f"Frame Time: {motion.dt:.10g}", ""]
    values = [each for k in order for each in ([scale * places[:, k] @ back.T] if k in moved else []) + [angles[:, k]]]
    table = io.StringIO()
    np.savetxt(table, np.column_stack(values), fmt="%.6f")
    return write_file(path, "\n".join(lines) + table.getvalue())


def _recognised(nodes: list[Node], scale: Array, angles: Array, local: Array, root: Array) -> bool:
    """Whether a reader recognises unit, axes and first frame of the file by itself."""
    ends = [(k, node.tip) for k, node in enumerate(nodes) if node.tip is not None]
    parents = np.array([node.parent for node in nodes] + [k for k, _ in ends], dtype=np.intp)
    offsets = np.array([node.offset for node in nodes] + [tip for _, tip in ends]) @ scale.T
    names = [node.name for node in nodes] + ["end"] * len(ends)
    known = recognised_unit(parents, offsets) == MARK and _up(names, parents, offsets) == "y"
    still = np.tile(np.eye(3), (len(local), len(ends), 1, 1))
    known = known and _other_up("y", parents, offsets, np.hstack([local, still]), root @ scale.T) == "y"
    return known and not _begins_with_rest(np.radians(angles[:, 1:]))


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
        if not node.free and np.abs(motion.offsets[joint] - node.offset).max() > OFF:
            return None
        if node.parent >= 0 and motion.parents[joint] != at[node.parent]:
            return None
    world = motion.rotations[:, at]
    local = np.array(world)
    local[:, 1:] = np.swapaxes(world[:, [node.parent for node in nodes[1:]]], 2, 3) @ world[:, 1:]
    q = postures(figure, nodes, local, motion.positions[:, at])
    return None if q is None else Frames(q, motion.dt, motion.name)


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
