"""Which pairs moved by more than lay between them, as compiled loops: see `moved_pairs`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.compiled import compiled

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@compiled()
def far_moved(
    before: Array,
    after: Array,
    pairs: Indices,
    widths: Array,
    reach: Array,
    number_before: Indices,
    distance_before: Array,
    within_before: float,
    number_after: Indices,
    distance_after: Array,
    within_after: float,
    arc: float,
    endless: float,
) -> Indices:
    """Return the pairs (k,) that moved against each other by more than lay between them.

    Args:
        before: (n, 4, 3) placements of the pieces.
        after: the same, later.
        pairs: (p, 2).
        widths: (p,) of both pieces of a pair together.
        reach: (n,) of the pieces from their origins; infinite where endless.
        number_before: pairs that were measured before.
        distance_before: their distances.
        within_before: what all others were farther apart than.
        number_after: pairs that were measured after.
        distance_after: their distances.
        within_after: what all others are farther apart than.
        arc: length of an arc over its chord, at the most.
        endless: what counts for an infinite reach.
    """
    count = len(before)
    motion = np.empty(count)
    for i in range(count):
        center, turn = 0.0, 0.0
        for k in range(3):
            center += (after[i, 3, k] - before[i, 3, k]) ** 2
            for j in range(3):
                turn += (after[i, j, k] - before[i, j, k]) ** 2
        far = reach[i] if np.isfinite(reach[i]) else 0.0
        motion[i] = arc * (np.sqrt(center) + np.sqrt(0.5 * turn) * far)
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
        if _seen(before, after, first, second, reach[second], arc, endless) <= room:
            continue
        if _seen(before, after, second, first, reach[first], arc, endless) <= room:
            continue
        found[kept] = p
        kept += 1
    return found[:kept]


@compiled()
def _between(placements: Array, first: int, second: int) -> float:
    """Distance of two pieces' origins."""
    total = 0.0
    for k in range(3):
        total += (placements[first, 3, k] - placements[second, 3, k]) ** 2
    return float(np.sqrt(total))


@compiled()
def _seen(before: Array, after: Array, carrier: int, other: int, reach: float, arc: float, endless: float) -> float:
    """Longest way that any point of a piece made in the axes of another one."""
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
    return float(arc * (np.sqrt(shift) + angle * (reach if np.isfinite(reach) else endless)))
