"""Which pairs can be near, and the distances of those that are, as compiled loops: see `proximity`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.memory_views import RESULT_FIRST
from wholebody.geometry.records import ContactRoom, Memory, PieceArrays


@compiled(inner=True)
def travel(placement: Array, last: Array, reach: Array, travelled: Array) -> None:
    """Add to `travelled` (n,) how far a point of each piece can have moved since `last`, and renew `last`.

    A point x of a piece moves by at most |t1 - t0| + |R1 - R0| |x|, with the Frobenius norm of R1 - R0.

    Args:
        placement: (n, 4, 3) where the pieces are now; see `Contacts.placements`.
        last: (n, 4, 3) where they were when this was asked last; is overwritten.
        reach: (n,) radius of each piece about its origin; may be infinite.
        travelled: (n,) metres since the beginning; grows.
    """
    for i in range(len(reach)):
        shift = 0.0
        turn = 0.0
        for k in range(3):
            change = placement[i, 3, k] - last[i, 3, k]
            shift += change * change
            last[i, 3, k] = placement[i, 3, k]
            for j in range(3):
                change = placement[i, j, k] - last[i, j, k]
                turn += change * change
                last[i, j, k] = placement[i, j, k]
        if turn > 0.0:
            travelled[i] += np.sqrt(shift) + np.sqrt(turn) * reach[i]
        elif shift > 0.0:
            travelled[i] += np.sqrt(shift)


@compiled(inner=True)
def bound_by_boxes(placement: Array, half: Array, extent: Array) -> None:
    """Write half the sizes (n, 3) of boxes along the world's axes about boxes along the pieces' own into `extent`."""
    for i in range(len(half)):
        for k in range(3):
            total = 0.0
            for j in range(3):
                total += abs(placement[i, j, k]) * half[i, j]
            extent[i, k] = total


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
def cull(placement: Array, pieces: PieceArrays, memory: Memory, within: float, most: Array) -> int:
    """Pairs that may be nearer than `within`, in the order of the pairs: they go to the front of `memory.index`.

    A pair is left out where one of three lower bounds of its signed distance is not below that: the bound when it
    was last looked at, less what both pieces have moved since; the gap between spheres about the pieces; the gap
    between boxes along the world's axes about them. All three bound the distance in penetration too.

    Args:
        placement: (n, 4, 3) where the pieces are.
        pieces: see `PieceArrays`.
        memory: see `Memory`; its bounds are renewed for pairs that the spheres or boxes leave out.
        within: metres.
        most: (p,) for one pair each, in place of `within` where it is less.

    Returns:
        How many there are.
    """
    travelled, bound, index, extent = memory.travelled, memory.bound, memory.index, memory.extent
    pairs, reach = pieces.pairs, pieces.reach
    bound_by_boxes(placement, pieces.half, extent)
    count = 0
    for p in range(len(pairs)):
        a, b = pairs[p, 0], pairs[p, 1]
        way = travelled[a] + travelled[b]
        near = min(within, most[p])
        if bound[p] - way >= near:
            continue
        gap = outer_gap(placement, reach, extent, a, b)
        if gap >= near:
            bound[p] = gap + way
            continue
        index[count] = p
        count += 1
    return count


@compiled()
def gather(
    results: Array,
    index: Indices,
    pieces: PieceArrays,
    memory: Memory,
    accuracy: float,
    within: float,
    most: Array,
    room: ContactRoom,
) -> tuple[int, bool]:
    """Copy the results of the pairs nearer than `within`, and remember the distances of all that were asked.

    Args:
        results: (p, 20) of coal; see `memory_views.result_view`.
        index: (k,) the pairs that were asked.
        pieces: see `PieceArrays`.
        memory: see `Memory`; its bounds are renewed.
        accuracy: metres to which a distance is known, and share of it.
        within: metres.
        most: (p,) see `cull`.
        room: for the contacts.

    Returns:
        How many are near, and whether one of them needs its normal repaired.
    """
    pairs, points_meet, travelled, bound = pieces.pairs, pieces.points_meet, memory.travelled, memory.bound
    nearest, vectors, number, pair = room
    count = 0
    broken = False
    for p in index:
        a, b = pairs[p, 0], pairs[p, 1]
        distance = results[p, RESULT_FIRST]
        bound[p] = distance - accuracy * (1.0 + abs(distance)) + travelled[a] + travelled[b]
        if not distance < min(within, most[p]):
            continue
        nearest[count], number[count] = distance, p
        for k in range(9):
            vectors[k // 3, count, k % 3] = results[p, RESULT_FIRST + 1 + k]
        pair[count, 0], pair[count, 1] = a, b
        broken = broken or distance <= points_meet[p]
        count += 1
    return count, broken


@compiled(inner=True)
def renew(marked: Indices, before: int, index: Indices, count: int, changed: Indices) -> tuple[int, int]:
    """Make ``marked[:before]`` the same pairs as ``index[:count]``, both in ascending order.

    Returns:
        How many pairs are marked no longer, and how many newly; they go to the front of `changed`, in this order.
    """
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
    placement: Array, pieces: PieceArrays, memory: Memory, before: int, within: float, most: Array
) -> tuple[int, int, int]:
    """`travel`, `cull` and `renew`; `before` pairs are marked.

    Returns:
        How many pairs may be near, how many of those that were marked are so no longer, and how many are newly.
    """
    travel(placement, memory.last, pieces.reach, memory.travelled)
    count = cull(placement, pieces, memory, within, most)
    gone, came = renew(memory.marked, before, memory.index, count, memory.changed)
    return count, gone, came
