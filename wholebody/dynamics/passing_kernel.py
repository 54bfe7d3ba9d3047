"""Whether pieces can have passed into or through each other during a step, as compiled loops.

Along a fixed direction the heights of all points of two pieces change linearly while the pieces move straight, and by
no more than the sag of an arc while they turn. So if the direction parts them before and after a step, it parts them
all the time, but for the sags.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled


@compiled()
def highest(
    piece: int,
    placement: Array,
    direction: Array,
    sign: float,
    points: Array,
    start: Indices,
    count: Indices,
    radius: Array,
    axes: Array,
    plane: Array,
) -> float:
    """Greatest height of a piece along a direction, times `sign`.

    Args:
        piece: its index.
        placement: (pieces, 4, 3).
        direction: (3,) unit vector in the world.
        sign: 1.0 or -1.0.
        points: (points, 3) swept points of all pieces.
        start: (pieces,) the first of each.
        count: (pieces,) how many.
        radius: (pieces,) around the points.
        axes: (pieces, 3) semi-axes of an ellipsoid; zero for others.
        plane: (pieces, 4) normal and offset of a half-space; zero for others.
    """
    base = 0.0
    local = np.empty(3)
    for k in range(3):
        base += sign * direction[k] * placement[piece, 3, k]
    for i in range(3):
        local[i] = 0.0
        for k in range(3):
            local[i] += sign * direction[k] * placement[piece, i, k]
    if count[piece] > 0:
        best = -np.inf
        for p in range(start[piece], start[piece] + count[piece]):
            best = max(best, points[p, 0] * local[0] + points[p, 1] * local[1] + points[p, 2] * local[2])
        return float(base + best + radius[piece])
    aligned = plane[piece, 0] * local[0] + plane[piece, 1] * local[1] + plane[piece, 2] * local[2]
    if aligned > 0.5:
        return float(base + plane[piece, 3]) if aligned > 1.0 - 1e-9 else np.inf
    if axes[piece, 0] > 0.0:
        square = 0.0
        for i in range(3):
            square += (axes[piece, i] * local[i]) ** 2
        return float(base + np.sqrt(square))
    return np.inf


@compiled()
def doubtful(
    pair: Indices,
    gap: Array,
    normal: Array,
    gap_after: Array,
    normal_after: Array,
    before: Array,
    after: Array,
    body: Indices,
    shift: Array,
    angle: Array,
    lever: Array,
    fall: float,
    depth: float,
    points: Array,
    start: Indices,
    count: Indices,
    radius: Array,
    axes: Array,
    plane: Array,
    found: Mask,
) -> int:
    """How many of the near pairs may have been deeper in each other than `depth` during a step.

    Args:
        pair: (k, 2) pieces of the contacts before the step.
        gap: (k,) their distances.
        normal: (k, 3) from the first to the second.
        gap_after: (k,) at least their distances after it.
        normal_after: (k, 3) normals after it; zero where none is known.
        before: (pieces, 4, 3) placements.
        after: (pieces, 4, 3).
        body: (pieces,) of which each is part.
        shift: (n, 3) ways of the centres of mass, metres.
        angle: (n,) by which each has turned, radians.
        lever: (n,) greatest distance of a point from its centre of mass, metres.
        fall: sag of the relative way because of gravity, metres.
        depth: metres.
        points: as in `highest`, and so the rest.
        start: (pieces,).
        count: (pieces,).
        radius: (pieces,).
        axes: (pieces, 3).
        plane: (pieces, 4).
        found: (k,) room for which they are; all false.
    """
    doubts = 0
    for c in range(len(pair)):
        p, q = pair[c, 0], pair[c, 1]
        a, b = body[p], body[q]
        way = 0.0
        for k in range(3):
            way += (shift[b, k] - shift[a, k]) ** 2
        way = np.sqrt(way)
        turn = angle[a] * lever[a] + angle[b] * lever[b]
        sag = 0.125 * (angle[a] ** 2 * lever[a] + angle[b] ** 2 * lever[b]) + fall
        # to be in each other on the way, and out again, they move by both gaps at least
        if way + turn + sag <= max(gap[c], 0.0) + max(gap_after[c], 0.0) + depth:
            continue
        end = _part(pair[c], normal[c], after, points, start, count, radius, axes, plane)
        if min(gap[c], end) - sag > -depth:
            continue
        known = normal_after[c, 0] != 0.0 or normal_after[c, 1] != 0.0 or normal_after[c, 2] != 0.0
        # as seen from one of the bodies, the points of the other also turn with the first
        both = angle[a] + angle[b]
        sag = 0.125 * both * both * (lever[a] + lever[b] + max(gap[c], 0.0) + way) + 0.25 * both * way + fall
        until, since = 0.0, 1.0  # shares of the step until which the first direction parts, and since which the last
        for own in (p, q):
            turned = _carried(normal[c], before[own], after[own])
            end = _part(pair[c], turned, after, points, start, count, radius, axes, plane)
            until = max(until, _share(gap[c] - sag, end - sag, -depth))
            if known:
                turned = _carried(normal_after[c], after[own], before[own])
                end = _part(pair[c], turned, before, points, start, count, radius, axes, plane)
                since = min(since, 1.0 - _share(gap_after[c] - sag, end - sag, -depth))
        if until < since:
            found[c] = True
            doubts += 1
    return doubts


@compiled(inner=True)
def _share(start: float, end: float, least: float) -> float:
    """Share of the way from a start to an end on which a value that changes linearly is not below the least one."""
    if end >= least:
        return 1.0 if start >= least else 0.0
    return 0.0 if start <= least else (start - least) / (start - end)


@compiled(inner=True)
def _carried(direction: Array, before: Array, after: Array) -> Array:
    """A direction (3,) that turns with a piece, after it; placements (4, 3)."""
    result = np.zeros(3)
    for i in range(3):
        along = before[i, 0] * direction[0] + before[i, 1] * direction[1] + before[i, 2] * direction[2]
        for k in range(3):
            result[k] += along * after[i, k]
    return result


@compiled(inner=True)
def _part(
    pair: Indices,
    direction: Array,
    placement: Array,
    points: Array,
    start: Indices,
    count: Indices,
    radius: Array,
    axes: Array,
    plane: Array,
) -> float:
    """By how much a direction parts two pieces, metres."""
    low = -highest(pair[1], placement, direction, -1.0, points, start, count, radius, axes, plane)
    return low - highest(pair[0], placement, direction, 1.0, points, start, count, radius, axes, plane)
