"""Skeletons of animated node trees, as glTF and FBX have them: nodes with any axes, bound to a body in some posture."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import FileFormatError, InputError
from wholebody.motion.clip import MOST_FRAMES
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion, longest_way
from wholebody.motion.structure import limb_pairs, recognised_unit


class NodeMotion(NamedTuple):
    """An animated tree: y up, z forward, metres as its format has it."""

    # names and parents: of the k nodes; -1 for those on top
    names: Sequence[str]
    parents: Indices
    worlds: Array  # (n, k, 4, 4) placements in the world
    bind: Array  # (k, 4, 4) placements in the posture in which a body is bound to them, or in which they rest
    dt: float  # seconds
    notes: tuple[str, ...] = ()  # sentences on what was chosen

    def skeleton(self, joints: Collection[int], title: str, unit: str | None, up: str | None) -> SkeletonMotion:
        """The skeleton of some nodes and those between them, metres, z up; its binding posture has no rotations."""
        kept = _joined(self.parents, joints)
        parents = np.array([kept.index(int(self.parents[node])) if at else -1 for at, node in enumerate(kept)])
        turn, notes = UP[up or "y"], list(self.notes)
        worlds, bind = self.worlds[:, kept], self.bind[kept]
        bound = rigid(bind[:, :3, :3])
        offsets = np.zeros((len(kept), 3))
        offsets[1:] = bind[1:, :3, 3] - bind[parents[1:], :3, 3]
        size = longest_way(parents, offsets)
        if size == 0.0:
            raise FileFormatError(f"{title}: all joints of the skeleton are at one place")
        if unit is None:
            unit = "metres"
            if limb_pairs(parents, offsets) and not 0.5 < size < 5.0:  # m, from foot to head: exporters forget the unit
                unit = recognised_unit(parents, offsets)
                notes += [f"lengths are in {unit}, though the format has metres"] if unit != "metres" else []
        scale = UNITS[unit]
        rotations = turn @ (rigid(worlds[:, :, :3, :3]) @ np.swapaxes(bound, 1, 2)) @ turn.T
        try:
            return SkeletonMotion(
                tuple(self.names[node] for node in kept), parents, scale * offsets @ turn.T, rotations,
                scale * worlds[:, :, :3, 3] @ turn.T, self.dt, title, tuple(notes),
            )  # fmt: skip
        except InputError as error:
            raise FileFormatError(f"{title}: {error}") from None


def _joined(parents: Indices, joints: Collection[int]) -> list[int]:
    """The nodes, and those between them and the nearest one above all, parents before children."""
    chains = []
    for joint in joints:
        way = [joint]
        while parents[way[-1]] >= 0:
            way.append(int(parents[way[-1]]))
        chains.append(way[::-1])
    common = 0
    while len({way[common] if common < len(way) else -1 for way in chains}) == 1 and common < min(map(len, chains)):
        common += 1
    if not common:
        raise FileFormatError("the joints of the skeleton hang on no common node; give each skeleton a file of its own")
    depth = {node: level for way in chains for level, node in enumerate(way)}
    return sorted({node for way in chains for node in way[common - 1 :]}, key=lambda node: (depth[node], node))


def rigid(matrices: Array) -> Array:
    """The rotations (..., 3, 3) nearest to matrices that scale too."""
    u, _, vt = np.linalg.svd(matrices)
    sign = np.linalg.det(u @ vt)
    u[..., :, 2] *= sign[..., None]
    return np.asarray(u @ vt)


def steps_of(times: Array, longest: float, title: str) -> tuple[Array, float, bool]:
    """Times of frames, their step, and whether keyframes are at equal steps up to `longest`; otherwise every 1/60 s."""
    keys = np.unique(np.asarray(times, dtype=float))
    keys = keys[np.r_[True, np.diff(keys) > 1e-4]]  # s: rounding of single precision
    if len(keys) < 2:
        return keys, 1.0 / 30.0, True
    span, step = float(keys[-1] - keys[0]), float(np.median(np.diff(keys)))
    count = round(span / step)
    even = len(keys) > 2 and bool(np.abs((keys - keys[0]) / (span / count) % 1.0 - 0.5).min() > 0.45)
    even = (even or len(keys) == 2) and step <= longest
    if not even:
        count = max(1, round(span * 60.0))
    if count >= MOST_FRAMES:
        raise FileFormatError(f"{title}: {count + 1} frames; give at most {MOST_FRAMES}")
    return np.linspace(keys[0], keys[-1], count + 1), rounded_step(span / count), even


def rounded_step(dt: float) -> float:
    """A time step of single precision as it was meant: a whole number of frames a second, or of microseconds."""
    for meant in (1.0 / max(1, round(1.0 / dt)), round(dt, 6)):
        if abs(meant - dt) < 1e-6 * dt:
            return meant
    return dt
