"""The pairs that moved by more than their distance, and planes between them, as compiled loops: see `moved_pairs`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled


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
    """Return the pairs (k,) that moved against each other by more than their distance.

    Args:
        before: (n, 4, 3) placements of the pieces before the motion.
        after: the same after the motion.
        pairs: (p, 2).
        widths: (p,) of both pieces of a pair together.
        reach: (n,) of the pieces from their origins; infinite where endless.
        number_before: pairs that were near before.
        distance_before: their distances.
        within_before: query distance before; all other pairs were farther apart.
        number_after: pairs that are near after.
        distance_after: their distances.
        within_after: query distance after.
        arc: largest ratio of an arc to its chord.
        endless: value used for an infinite reach.
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
def separated(
    doubtful: Indices,
    before: Array,
    after: Array,
    number: Indices,
    pair: Indices,
    normal: Array,
    point_a: Array,
    point_b: Array,
    points: Array,
    first_point: Indices,
    radius: Array,
    reach: Array,
    overlap: float,
) -> Mask:
    """Return whether the plane between the pieces of a pair before a motion, fixed to either, parts them after it (k,).

    Args:
        doubtful: (k,) pairs; those that were not near before are not separated.
        before: (n, 4, 3) placements of the pieces before the motion.
        after: the same after the motion.
        number: (c,) pairs that were near before.
        pair: (c, 2) their pieces.
        normal: (c, 3) from the first piece to the second.
        point_a: (c, 3) nearest point of the first.
        point_b: (c, 3) and of the second.
        points: (m, 3) swept points of all pieces, one piece after the other.
        first_point: (n + 1,) where those of each piece begin.
        radius: (n,) around the points.
        reach: (n,) of the pieces from their origins.
        overlap: metres by which a piece may be beyond the plane.
    """
    found = np.zeros(len(doubtful), dtype=np.bool_)
    for k in range(len(doubtful)):
        for c in range(len(number)):
            if number[c] == doubtful[k]:
                a, b = pair[c, 0], pair[c, 1]
                found[k] = _beyond(
                    before, after, a, b, normal[c], 1.0, point_a[c], points[first_point[b] : first_point[b + 1]],
                    radius[b], reach[b], overlap,
                ) or _beyond(
                    before, after, b, a, normal[c], -1.0, point_b[c], points[first_point[a] : first_point[a + 1]],
                    radius[a], reach[a], overlap,
                )  # fmt: skip
                break
    return found


@compiled(inner=True)
def _beyond(
    before: Array,
    after: Array,
    carrier: int,
    other: int,
    normal: Array,
    sign: float,
    point: Array,
    points: Array,
    radius: float,
    reach: float,
    overlap: float,
) -> bool:
    """Whether a piece stays beyond a plane that is fixed to another one, also on the arcs between both placements."""
    if len(points) == 0:
        return False
    local_normal, height, apart = np.empty(3), 0.0, 0.0
    for j in range(3):
        along, place = 0.0, 0.0
        for i in range(3):
            along += sign * before[carrier, j, i] * normal[i]
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
