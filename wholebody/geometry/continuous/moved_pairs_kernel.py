"""The pairs that moved by more than their distance, and planes between them, as compiled loops: see `moved_pairs`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.geometry.records import Contacts, PieceArrays, QueryResult


@compiled()
def far_moved(pieces: PieceArrays, before: QueryResult, after: QueryResult, arc: float, endless: float) -> Indices:
    """Return the pairs (k,) that moved against each other by more than their distance.

    Args:
        pieces: see `PieceArrays`.
        before: the near pairs before the motion; all others were farther apart than its query distance.
        after: the near pairs after it.
        arc: largest ratio of an arc to its chord.
        endless: value used for an infinite reach.
    """
    pairs, widths, reach = pieces.pairs, pieces.widths, pieces.reach
    start, end = before.contacts.placements, after.contacts.placements
    count = len(start)
    motion = np.empty(count)
    for i in range(count):
        center, turn = 0.0, 0.0
        for k in range(3):
            center += (end[i, 3, k] - start[i, 3, k]) ** 2
            for j in range(3):
                turn += (end[i, j, k] - start[i, j, k]) ** 2
        far = reach[i] if np.isfinite(reach[i]) else 0.0
        motion[i] = arc * (np.sqrt(center) + np.sqrt(0.5 * turn) * far)
    apart, apart_after = _apart(before, len(pairs)), _apart(after, len(pairs))
    found = np.empty(len(pairs), dtype=np.intp)
    kept = 0
    for p in range(len(pairs)):
        first, second = pairs[p, 0], pairs[p, 1]
        way = motion[first] + motion[second]
        if way <= widths[p] + apart[p] + apart_after[p]:
            continue
        radii = reach[first] + reach[second]
        room = widths[p]
        room += max(_between(start, first, second) - radii, apart[p])
        room += max(_between(end, first, second) - radii, apart_after[p])
        if way <= room:
            continue
        if _seen(start, end, first, second, reach[second], arc, endless) <= room:
            continue
        if _seen(start, end, second, first, reach[first], arc, endless) <= room:
            continue
        found[kept] = p
        kept += 1
    return found[:kept]


@compiled(inner=True)
def _apart(placed: QueryResult, count: int) -> Array:
    """(count,) distances of all pairs, at least 0; of those that are not near the query distance."""
    number, distance = placed.contacts.number, placed.contacts.distance
    apart = np.full(count, max(placed.within, 0.0))
    for c in range(len(number)):
        apart[number[c]] = max(distance[c], 0.0)
    return apart


@compiled()
def separated(doubtful: Indices, pieces: PieceArrays, before: Contacts, after: Array, overlap: float) -> Mask:
    """Return whether the plane between the pieces of a pair before a motion, fixed to either, parts them after it (k,).

    Args:
        doubtful: (k,) pairs; those that were not near before are not separated.
        pieces: see `PieceArrays`.
        before: the near pairs before the motion.
        after: (n, 4, 3) placements of the pieces after it.
        overlap: metres by which a piece may be beyond the plane.
    """
    found = np.zeros(len(doubtful), dtype=np.bool_)
    number = before.number
    for k in range(len(doubtful)):
        for c in range(len(number)):
            if number[c] == doubtful[k]:
                a, b, normal = before.pair[c, 0], before.pair[c, 1], before.normal[c]
                found[k] = _beyond(
                    pieces, before.placements, after, a, b, normal, before.point_a[c], overlap
                ) or _beyond(pieces, before.placements, after, b, a, -normal, before.point_b[c], overlap)
                break
    return found


@compiled(inner=True)
def _beyond(
    pieces: PieceArrays, before: Array, after: Array, carrier: int, other: int, normal: Array, point: Array,
    overlap: float,
) -> bool:  # fmt: skip
    """Whether a piece stays beyond a plane that is fixed to another one, also on the arcs between both placements."""
    points = pieces.points[pieces.first_point[other] : pieces.first_point[other + 1]]
    if len(points) == 0:
        return False
    radius, reach = pieces.radius[other], pieces.reach[other]
    local_normal, height, apart = np.empty(3), 0.0, 0.0
    for j in range(3):
        along, place = 0.0, 0.0
        for i in range(3):
            along += before[carrier, j, i] * normal[i]
            place += before[carrier, j, i] * (point[i] - before[carrier, 3, i])
        local_normal[j] = along
        height += along * place
        apart += (before[other, 3, j] - point[j]) ** 2
    least, angle = np.inf, 0.0
    for placed in (before, after):
        world = np.zeros(3)  # the normal now
        for i in range(3):
            for j in range(3):
                world[i] += placed[carrier, j, i] * local_normal[j]
        for p in range(len(points)):
            own = 0.0
            for i in range(3):
                at = placed[other, 3, i] - placed[carrier, 3, i]
                for j in range(3):
                    at += points[p, j] * placed[other, j, i]
                own += world[i] * at
            least = min(least, own - height - radius)
    for piece in (carrier, other):
        turned = 0.0
        for j in range(3):
            for i in range(3):
                turned += (after[piece, j, i] - before[piece, j, i]) ** 2
        angle += np.sqrt(0.5 * turned)
    arc = 0.125 * angle * angle * (reach + np.sqrt(apart))
    return bool(least - arc > -overlap)


@compiled(inner=True)
def _between(placements: Array, first: int, second: int) -> float:
    """Distance of two pieces' origins."""
    total = 0.0
    for k in range(3):
        total += (placements[first, 3, k] - placements[second, 3, k]) ** 2
    return float(np.sqrt(total))


@compiled(inner=True)
def _seen(before: Array, after: Array, carrier: int, other: int, reach: float, arc: float, endless: float) -> float:
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
    return float(arc * (np.sqrt(shift) + angle * (reach if np.isfinite(reach) else endless)))
