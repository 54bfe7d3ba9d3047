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
    """Return the pairs (k,) that moved against each other by more than their distance; placements are (n, 4, 3).

    `table`: `pairs`, `widths` and `reach` of the pair table; `near`: near pairs, distances, query distance, twice.
    """
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
def kept_apart(before: Array, after: Array, table: tuple[Indices, Array], known: tuple[Array, Array, Array]) -> bool:
    """Whether each pair moves by no more than it may; see `moved_pairs.kept_apart`."""
    pairs, reach = table
    room, most, bent = known
    for p in range(len(pairs)):
        if most[p] > room[p]:
            if bent[p] >= room[p]:
                return False
            a, b = pairs[p, 0], pairs[p, 1]
            left = room[p] - bent[p]
            if _seen(before, after, a, b, reach[b]) > left and _seen(before, after, b, a, reach[a]) > left:
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
