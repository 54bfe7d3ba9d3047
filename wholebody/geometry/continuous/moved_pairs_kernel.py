"""The pairs that moved by more than their distance, as compiled loops: see `moved_pairs`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.pieces import ENDLESS
from wholebody.geometry.proximity_kernel import ball_gap, balls_around

ARC = 1.1  # largest ratio of an arc to its chord, for the rotations of one step


@compiled()
def far_moved(
    before: Array, after: Array, table: tuple[Indices, Array, Array],
    blocks: tuple[Indices, Indices, Indices, Indices, Indices],
    near: tuple[Indices, Array, float, Indices, Array, float],
) -> Indices:  # fmt: skip
    """Return the pairs (k,) that moved against each other by more than their distance; placements are (n, 4, 3).

    `table`: `pairs`, `widths` and `reach` of the pair table; `blocks`: its own; `near`: near pairs, distances, query
    distance, twice.
    """
    pairs, _, reach = table
    begin, second, body, first, members = blocks
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
    found = np.empty(len(pairs), dtype=np.intp)
    if len(second) == 0:
        return found[: _far_moved(before, after, table, near, motion, (0, len(pairs), 0), found)]
    ball = np.empty((2, len(first), 4))
    balls_around(before, reach, first, members, ball[0])
    balls_around(after, reach, first, members, ball[1])
    fastest = np.zeros(len(first))
    for c in range(len(first) - 1):
        for m in range(first[c], first[c + 1]):
            fastest[c] = max(fastest[c], motion[members[m]])
    kept = 0
    for b in range(len(second)):
        one, other = body[b], second[b]
        far = False
        if other >= 0:
            room = max(ball_gap(ball[0], one, before, reach, other), 0.0)
            room += max(ball_gap(ball[1], one, after, reach, other), 0.0)
            far = fastest[one] + motion[other] <= room
        if not far:
            kept = _far_moved(before, after, table, near, motion, (begin[b], begin[b + 1], kept), found)
    return found[:kept]


@compiled(inner=True)
def _far_moved(
    before: Array, after: Array, table: tuple[Indices, Array, Array],
    near: tuple[Indices, Array, float, Indices, Array, float], motion: Array, part: tuple[int, int, int],
    found: Indices,
) -> int:  # fmt: skip
    """Add pairs of a part, first and end, to those found so far; how many these are then."""
    pairs, widths, reach = table
    begin, end, kept = part
    for p in range(begin, end):
        first, second = pairs[p, 0], pairs[p, 1]
        travel = motion[first] + motion[second]
        if travel <= widths[p]:
            continue
        radii = reach[first] + reach[second]
        free_before, free_after = _between(before, first, second) - radii, _between(after, first, second) - radii
        if travel <= widths[p] + max(free_before, 0.0) + max(free_after, 0.0):
            continue
        room = widths[p]
        room += max(free_before, _apart(near[0], near[1], near[2], p))
        room += max(free_after, _apart(near[3], near[4], near[5], p))
        if travel <= room:
            continue
        if ARC * seen_motion(before, after, first, second, reach[second]) <= room:
            continue
        if ARC * seen_motion(before, after, second, first, reach[first]) <= room:
            continue
        found[kept] = p
        kept += 1
    return kept


@compiled(inner=True)
def _apart(number: Indices, distance: Array, within: float, pair: int) -> float:
    """How far a pair is apart: by its distance if it is near, else by the query distance."""
    for c in range(len(number)):
        if number[c] == pair:
            return float(max(distance[c], 0.0))
    return max(within, 0.0)


@compiled(inner=True)
def _between(placements: Array, first: int, second: int) -> float:
    """Distance of two pieces' origins."""
    total = 0.0
    for k in range(3):
        total += (placements[first, 3, k] - placements[second, 3, k]) ** 2
    return float(np.sqrt(total))


@compiled(inner=True)
def seen_motion(before: Array, after: Array, carrier: int, other: int, reach: float) -> float:
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
