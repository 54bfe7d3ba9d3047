"""Pairs that keep a distance all along a motion, by its two ends; compiled loops."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.continuous.moved_pairs_kernel import seen_motion
from wholebody.geometry.proximity import PairTable


def kept_apart(table: PairTable, before: Array, after: Array, known: tuple[Array, Array, Array, Array]) -> bool:
    """Whether all pairs keep their distances between two placements (n, 4, 3) of the pieces.

    A pair keeps it where its chord is short, or where the same face of one piece has all of the other one in front of
    it at both ends: between them points are at most so far from the straight way between their two places in the
    face's frame.

    `known`, metres: (pairs,) how far each may move, and how far it moves at most; (pairs, 2) twice as far as its way
    leaves the chord, as the first piece sees it and as the second one does; (pairs,) its least distance on the way.
    """
    pieces = table.radius, table.axis, table.first_point, table.points, table.first_face, table.faces
    return bool(_all_kept(before, after, (table.pairs, table.reach, *pieces), known))


@compiled()
def _all_kept(
    before: Array, after: Array, table: tuple[Indices, Array, Array, Array, Indices, Array, Indices, Array],
    known: tuple[Array, Array, Array, Array],
) -> bool:  # fmt: skip
    """Whether each pair keeps its distance; see `kept_apart`."""
    pairs, reach, radius, axis, first_point, points, first_face, faces = table
    room, most, bent, least = known
    pieces = reach, radius, axis, first_point, points, first_face, faces
    for p in range(len(pairs)):
        if most[p] > room[p]:
            a, b = pairs[p, 0], pairs[p, 1]
            if not (
                _keeps(before, after, pieces, (a, b), (room[p], bent[p, 0], least[p]))
                or _keeps(before, after, pieces, (b, a), (room[p], bent[p, 1], least[p]))
            ):
                return False
    return True


@compiled(inner=True)
def _keeps(
    before: Array, after: Array, pieces: tuple[Array, Array, Array, Indices, Array, Indices, Array],
    pair: tuple[int, int], known: tuple[float, float, float],
) -> bool:  # fmt: skip
    """Whether a pair keeps its distance, as its first piece sees its second one."""
    reach, radius, axis, first_point, points, first_face, faces = pieces
    (a, b), (room, bent, least) = pair, known
    if bent < room and seen_motion(before, after, a, b, reach[b]) <= room - bent:
        return True
    return _in_front(before, after, (radius, axis, first_point, points, first_face, faces), a, b, least + 0.5 * bent)


@compiled(inner=True)
def _in_front(
    before: Array, after: Array, pieces: tuple[Array, Array, Indices, Array, Indices, Array], a: int, b: int,
    height: float,
) -> bool:  # fmt: skip
    """Whether a face of a piece, or the side of a capsule, has another one `height` in front of it at both ends."""
    radius, axis, first_point, points, first_face, faces = pieces
    if first_point[b] == first_point[b + 1]:
        return False
    for f in range(first_face[a], first_face[a + 1]):
        n = faces[f, 0], faces[f, 1], faces[f, 2]
        above = faces[f, 3] + height + radius[a] + radius[b]
        if _above(before, a, b, n, first_point, points, above) and _above(after, a, b, n, first_point, points, above):
            return True
    if radius[a] <= 0.0:
        return False
    # from the middle of a capsule or a sphere to the other piece's, across its axis
    n0, n1, n2 = _across(before, a, b, axis)
    m0, m1, m2 = _across(after, a, b, axis)
    n0, n1, n2 = n0 + m0, n1 + m1, n2 + m2
    size = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if size < 1e-6:
        return False
    n = n0 / size, n1 / size, n2 / size
    above = height + radius[a] + radius[b]
    return _above(before, a, b, n, first_point, points, above) and _above(after, a, b, n, first_point, points, above)


@compiled(inner=True)
def _across(placements: Array, a: int, b: int, axis: Array) -> tuple[float, float, float]:
    """The unit direction across a piece's axis in its own frame to the other one's origin."""
    n0, n1, n2 = 0.0, 0.0, 0.0
    for k in range(3):
        away = placements[b, 3, k] - placements[a, 3, k]
        n0 += away * placements[a, 0, k]
        n1 += away * placements[a, 1, k]
        n2 += away * placements[a, 2, k]
    along = n0 * axis[a, 0] + n1 * axis[a, 1] + n2 * axis[a, 2]
    n0, n1, n2 = n0 - along * axis[a, 0], n1 - along * axis[a, 1], n2 - along * axis[a, 2]
    size = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2) + 1e-12
    return n0 / size, n1 / size, n2 / size


@compiled(inner=True)
def _above(
    placements: Array, a: int, b: int, n: tuple[float, float, float], first_point: Indices, points: Array, above: float
) -> bool:
    """Whether all swept points of a piece are `above` the origin of another one, along a direction in its frame."""
    shift, d0, d1, d2 = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        world = n[0] * placements[a, 0, k] + n[1] * placements[a, 1, k] + n[2] * placements[a, 2, k]
        shift += world * (placements[b, 3, k] - placements[a, 3, k])
        d0 += world * placements[b, 0, k]
        d1 += world * placements[b, 1, k]
        d2 += world * placements[b, 2, k]
    for i in range(first_point[b], first_point[b + 1]):
        if shift + d0 * points[i, 0] + d1 * points[i, 1] + d2 * points[i, 2] < above:
            return False
    return True


def compiled_kernel() -> ModuleType:
    """This module, with its loop compiled or loaded from the cache."""
    none, places, pairs = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp)
    pieces = none, np.zeros((0, 3)), places, np.zeros((0, 3)), places, np.zeros((0, 4))
    placements = np.zeros((0, 4, 3))
    _all_kept(placements, placements, (pairs, none, *pieces), (none, none, np.zeros((0, 2)), none))
    return sys.modules[__name__]
