"""Which pairs can be near, and the distances of those that are, as compiled loops: see `proximity`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.memory_views import RESULT_FIRST
from wholebody.geometry.pieces import COAL_ACCURACY


@compiled(inner=True)
def travel(placement: Array, last: Array, reach: Array, travelled: Array, half: Array, extent: Array) -> None:
    """Add to `travelled` (n,) how far a point of each piece can have moved since `last`, and renew `last` (n, 4, 3).

    Boxes about those that turned are renewed too; see `bound_by_boxes`.
    """
    # A point x moves by at most |t1 - t0| + |R1 - R0| |x|, with the Frobenius norm.
    for i in range(len(reach)):
        shift = 0.0
        turn = 0.0
        for k in range(3):
            change = placement[i, 3, k] - last[i, 3, k]
            shift += change * change
            for j in range(3):
                change = placement[i, j, k] - last[i, j, k]
                turn += change * change
        if turn > 0.0:
            travelled[i] += np.sqrt(shift) + np.sqrt(turn) * reach[i]
            bound_by_box(placement, half, extent, i)
        elif shift > 0.0:
            travelled[i] += np.sqrt(shift)
        if turn + shift > 0.0:
            for k in range(3):
                for j in range(4):
                    last[i, j, k] = placement[i, j, k]


@compiled(inner=True)
def bound_by_box(placement: Array, half: Array, extent: Array, i: int) -> None:
    """Write half the size (n, 3) of a box along the world's axes about a box along a piece's own into `extent`."""
    for k in range(3):
        total = 0.0
        for j in range(3):
            total += abs(placement[i, j, k]) * half[i, j]
        extent[i, k] = total


@compiled(inner=True)
def bound_by_boxes(placement: Array, half: Array, extent: Array) -> None:
    """The same of all pieces (n,)."""
    for i in range(len(half)):
        bound_by_box(placement, half, extent, i)


@compiled(inner=True)
def outer_gap(placement: Array, reach: Array, extent: Array, a: int, b: int) -> float:
    """A lower bound of the signed distance of two pieces: the gap between the spheres or the boxes about them."""
    square = 0.0
    boxes = -np.inf
    for k in range(3):
        apart = abs(placement[a, 3, k] - placement[b, 3, k])
        square += apart * apart
        boxes = max(boxes, apart - extent[a, k] - extent[b, k])
    gap: float = max(boxes, np.sqrt(square) - reach[a] - reach[b])
    return gap


@compiled(inner=True)
def balls_around(placement: Array, reach: Array, first: Indices, members: Indices, ball: Array) -> None:
    """Write centre and radius of a ball around each body, whose pieces are ``members[first[c]:first[c + 1]]``."""
    for c in range(len(first) - 1):
        count = first[c + 1] - first[c]
        for k in range(3):
            total = 0.0
            for m in range(first[c], first[c + 1]):
                total += placement[members[m], 3, k]
            ball[c, k] = total / count
        radius = 0.0
        for m in range(first[c], first[c + 1]):
            i = members[m]
            square = 0.0
            for k in range(3):
                square += (placement[i, 3, k] - ball[c, k]) ** 2
            radius = max(radius, np.sqrt(square) + reach[i])
        ball[c, 3] = radius


@compiled(inner=True)
def ball_gap(ball: Array, body: int, placement: Array, reach: Array, piece: int) -> float:
    """A lower bound of the distances of all pieces of a body from another piece."""
    square = 0.0
    for k in range(3):
        square += (placement[piece, 3, k] - ball[body, k]) ** 2
    gap: float = np.sqrt(square) - ball[body, 3] - reach[piece]
    return gap


@compiled()
def gather(
    results: Array, index: Indices, known: tuple[Indices, Array, Array], within: float, most: Array,
    room: tuple[Array, Array, Indices, Indices],
) -> tuple[int, bool]:  # fmt: skip
    """Copy the results of the pairs nearer than `within`, and remember the distances of all that were asked.

    Args:
        results: (pairs, 20) of coal; see `memory_views.result_view`.
        index: (k,) the pairs that were asked.
        known: `pairs`, `travelled` and `bound`, as for `look`; bounds are renewed.
        within: metres.
        most: (pairs,) see `look`.
        room: for distances (k,), for normals and the nearest points on first and second pieces (3, k, 3), for the
            places of the pairs (k,), and for their pieces (k, 2).

    Returns:
        How many are near, and whether one of them needs its normal repaired.
    """
    pairs, travelled, bound = known
    nearest, vectors, number, pair = room
    count = 0
    broken = False
    for p in index:
        a, b = pairs[p, 0], pairs[p, 1]
        distance = results[p, RESULT_FIRST]
        bound[0, p] = distance - 10.0 * COAL_ACCURACY * (1.0 + abs(distance)) + travelled[a] + travelled[b]
        if not distance < min(within, most[p]):
            continue
        nearest[count], number[count] = distance, p
        for k in range(9):
            vectors[k // 3, count, k % 3] = results[p, RESULT_FIRST + 1 + k]
        pair[count, 0], pair[count, 1] = a, b
        broken = broken or distance <= bound[1, p]
        count += 1
    return count, broken


@compiled()
def bound_from_below(results: Array, index: Indices, known: tuple[Indices, Array, Array], least: Array) -> None:
    """Write distances of the pairs (k,) that were asked, and bounds from below of all others, to `least` (pairs,).

    For `results`, `index` and `known` see `gather`.
    """
    pairs, travelled, bound = known
    for p in index:
        distance = results[p, RESULT_FIRST]
        approach = travelled[pairs[p, 0]] + travelled[pairs[p, 1]]
        bound[0, p] = distance - 10.0 * COAL_ACCURACY * (1.0 + abs(distance)) + approach
    for p in range(len(pairs)):
        least[p] = bound[0, p] - travelled[pairs[p, 0]] - travelled[pairs[p, 1]]
    for p in index:
        least[p] = results[p, RESULT_FIRST]


@compiled(inner=True)
def renew(marked: Indices, before: int, index: Indices, count: int, changed: Indices) -> tuple[int, int]:
    """Make ``marked[:before]`` the pairs ``index[:count]``, both ascending; the numbers gone and new, in `changed`."""
    gone, came, k = 0, 0, 0
    for m in range(before):
        while k < count and index[k] < marked[m]:
            k += 1
        if k == count or index[k] != marked[m]:
            changed[gone] = marked[m]
            gone += 1
    m = 0
    for k in range(count):
        while m < before and marked[m] < index[k]:
            m += 1
        if m == before or marked[m] != index[k]:
            changed[gone + came] = index[k]
            came += 1
    for k in range(count):
        marked[k] = index[k]
    return gone, came


@compiled()
def look(
    placement: Array, known: tuple[Indices, Array, Array, Array, Array, Array, Array, Indices],
    blocks: tuple[Indices, Indices, Indices, Indices, Indices, Array], within: float, most: Array, before: int,
    whole: bool,
) -> tuple[int, int, int]:  # fmt: skip
    """Pairs that may be nearer than `within`, in the order of the pairs: their places go to the front of `marks[0]`.

    A pair is left out where one of three lower bounds of its signed distance is not below that: the bound when it
    was last looked at, less what both pieces have moved since; the gap between spheres about the pieces; the gap
    between boxes along the world's axes about them. All three bound the distance in penetration too. Before, a block
    of pairs is left out where the gap between spheres about a body and about the other piece is not below that.

    Args:
        placement: (n, 4, 3) where the pieces are; see `Contacts.placements`.
        known: `pairs`, `reach` and `half` of the pair table; `last` (n, 4, 3), where the pieces were when this was
            asked last; `travelled` (n,), how far each can have moved since the beginning, see `travel`; `bound`
            (2, pairs), a lower bound of the distance when a pair was last looked at, plus what both had travelled
            then, and the distance at and below which coal may have no normal; sizes (n, 3) of the boxes there;
            `marks` (3, pairs), room for the answer, the pairs of the last one, and those that differ, see `renew`.
        blocks: those of the pair table; room (c + 1, 4) for balls around the bodies.
        within: metres.
        most: (pairs,) for one pair each, in place of `within` where it is less.
        before: how many the last answer had.
        whole: whether the bounds of all pairs are wanted, so that no block is left out.

    Returns:
        How many pairs may be near, how many of those that were marked are so no longer, and how many are newly.
    """
    pairs, reach, half, last, travelled, _, extent, marks = known
    begin, second, body, first, members, ball = blocks
    index = marks[0]
    travel(placement, last, reach, travelled, half, extent)
    count, upto = 0, len(second)
    if whole or upto == 0:
        upto = 0
        count = _look_at(placement, known, within, most, 0, len(pairs), 0)
    else:
        balls_around(placement, reach, first, members, ball)
    for b in range(upto):
        if second[b] < 0 or not ball_gap(ball, body[b], placement, reach, second[b]) >= within:
            count = _look_at(placement, known, within, most, begin[b], begin[b + 1], count)
    gone, came = renew(marks[1], before, index, count, marks[2])
    return count, gone, came


@compiled(inner=True)
def _look_at(
    placement: Array, known: tuple[Indices, Array, Array, Array, Array, Array, Array, Indices], within: float,
    most: Array, begin: int, end: int, count: int,
) -> int:  # fmt: skip
    """Look at the pairs from `begin` to `end`, after `count` that may be near; how many may be then."""
    pairs, reach, _, _, travelled, bound, extent, marks = known
    for p in range(begin, end):
        a, b = pairs[p, 0], pairs[p, 1]
        approach = travelled[a] + travelled[b]
        near = min(within, most[p])
        if bound[0, p] - approach >= near:
            continue
        gap = outer_gap(placement, reach, extent, a, b)
        if gap >= near:
            bound[0, p] = gap + approach
            continue
        marks[0, count] = p
        count += 1
    return count
