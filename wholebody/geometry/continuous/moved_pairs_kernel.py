"""The pairs that moved by more than their distance, as compiled loops: see `moved_pairs`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.pieces import ENDLESS

ARC = 1.1  # largest ratio of an arc to its chord, for the rotations of one step


@compiled()
def far_moved(
    before: Array, after: Array, table: tuple[Indices, Array, Array],
    near: tuple[Indices, Array, float, Indices, Array, float],
) -> Indices:  # fmt: skip
    """Pairs (k,) that moved by more than their distance; placements (n, 4, 3), `near` pairs, distances."""
    pairs, widths, reach = table
    number_before, distance_before, within_before, number_after, distance_after, within_after = near
    count = len(before)
    motion = np.empty(count)
    for i in range(count):
        center, turn = 0.0, 0.0
        for k in range(3):
            center += (after[i, 3, k] - before[i, 3, k]) ** 2
            for j in range(3):
                turn += (after[i, j, k] - before[i, j, k]) ** 2
        far = reach[i] if np.isfinite(reach[i]) else 0.0
        motion[i] = ARC * (np.sqrt(center) + np.sqrt(0.5 * turn) * far)
    apart = np.full(len(pairs), max(within_before, 0.0))
    for c in range(len(number_before)):
        apart[number_before[c]] = max(distance_before[c], 0.0)
    apart_after = np.full(len(pairs), max(within_after, 0.0))
    for c in range(len(number_after)):
        apart_after[number_after[c]] = max(distance_after[c], 0.0)
    found = np.empty(len(pairs), dtype=np.intp)
    kept = 0
    for p in range(len(pairs)):
        first, second = pairs[p, 0], pairs[p, 1]
        way = motion[first] + motion[second]
        if way <= widths[p] + apart[p] + apart_after[p]:
            continue
        radii = reach[first] + reach[second]
        room = widths[p]
        room += max(_between(before, first, second) - radii, apart[p])
        room += max(_between(after, first, second) - radii, apart_after[p])
        if way <= room:
            continue
        if ARC * _seen(before, after, first, second, reach[second]) <= room:
            continue
        if ARC * _seen(before, after, second, first, reach[first]) <= room:
            continue
        found[kept] = p
        kept += 1
    return found[:kept]


@compiled()
def kept_apart(
    before: Array, after: Array, table: tuple[Indices, Array, Array, Array, Indices, Array, Indices, Array],
    known: tuple[Array, Array, Array, Array],
) -> bool:  # fmt: skip
    """Whether each pair keeps its distance; see `moved_pairs.kept_apart`."""
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
    if bent < room and _seen(before, after, a, b, reach[b]) <= room - bent:
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


@compiled(inner=True)
def _between(placements: Array, first: int, second: int) -> float:
    """Distance of two pieces' origins."""
    total = 0.0
    for k in range(3):
        total += (placements[first, 3, k] - placements[second, 3, k]) ** 2
    return float(np.sqrt(total))


@compiled(inner=True)
def _seen(before: Array, after: Array, carrier: int, other: int, reach: float) -> float:
    """Largest motion of a point of a piece in the axes of another one."""
    shift, turn = 0.0, 0.0
    for j in range(3):
        along = 0.0
        for k in range(3):
            along += (after[other, 3, k] - after[carrier, 3, k]) * after[carrier, j, k]
            along -= (before[other, 3, k] - before[carrier, 3, k]) * before[carrier, j, k]
        shift += along**2
        for i in range(3):
            turned = 0.0
            for k in range(3):
                turned += after[other, i, k] * after[carrier, j, k] - before[other, i, k] * before[carrier, j, k]
            turn += turned**2
    angle = np.sqrt(0.5 * turn)
    if angle <= 1e-12:
        angle = 0.0
    return float(np.sqrt(shift) + angle * (reach if np.isfinite(reach) else ENDLESS))
