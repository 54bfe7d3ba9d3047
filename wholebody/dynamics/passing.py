"""Whether pieces can have been in each other within a step, where both ends of it are free.

Along a fixed direction the heights of all points of two pieces change linearly while the pieces move straight, and by
no more than the sag of an arc while they turn. So if the direction parts them before and after a step, it parts them
all the time, but for the sags. The normals at both ends settle most pairs so (`doubtful`). The others are followed on
their way in parts, along each of which the direction at its start parts the pieces.
"""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.pieces import ContactFinder, SweptPoints
from wholebody.geometry.proximity import Contacts

PASSING = 1e-4  # m: depth up to which pieces may dip into each other on the way


class StepStart:
    """The start of a step: positions, rotations and velocities, and the pairs within margins (n,) of both bodies."""

    def __init__(self, state: BodiesState, near: Contacts, margin: Array, finder: ContactFinder) -> None:
        self.near, self.margin, self.kept = near, margin, state.copies()
        self._finder, self._active = finder, state.active

    def widen(self, travel: Array) -> None:
        """Let the margins be at least the travel (n,) of the bodies, metres: a blow may have made them faster."""
        if (travel > self.margin).any():
            self.margin = np.maximum(self.margin, travel)
            self.near = self._finder.near(self.kept[0], self.kept[1], self.margin, self._active)


class Way(NamedTuple):
    """How bodies moved during a step, and the near pairs at both ends of it."""

    pair: Indices  # (k, 2) pieces
    body: Indices  # (pieces,) the body of each piece
    gap: Array  # (2, k) their distances before the step, and at least those after it
    normal: Array  # (2, k, 3) from the first to the second; after it zero where none is known
    placement: Array  # (2, pieces, 4, 3) of all pieces
    shift: Array  # (n, 3) displacements of the centres of mass, metres
    angle: Array  # (n,) by which each has turned, radians
    lever: Array  # (n,) greatest distance of a point from its centre of mass, metres
    fall: float  # sag of the relative displacement because of gravity, metres


def free_between(
    state: BodiesState, before: StepStart, after: Contacts, margin: Array, travel: Array, time: float, gravity: float
) -> bool:
    """Whether no pieces can have been deeper than `PASSING` within a step; margins and travels (n,) [m]."""
    before.widen(travel)
    pieces, near = state.pieces, before.near
    found = np.full(len(pieces.table.pairs), -1, dtype=np.intp)
    found[after.number] = np.arange(len(after.number))
    found = found[near.number]
    listed = found >= 0
    gap, normal = margin[pieces.body[near.pair]].sum(axis=1), np.zeros((len(listed), 3))
    gap[listed], normal[listed] = after.distance[found[listed]], after.normal[found[listed]]
    way = Way(
        near.pair, pieces.body, np.stack([near.distance, gap]), np.stack([near.normal, normal]),
        np.stack([near.placements, after.placements]), state.bodies.position - before.kept[0],
        np.linalg.norm(state.spin, axis=1) * time, pieces.lever, gravity * time**2 / 8.0,
    )  # fmt: skip
    doubts = np.zeros(len(near.pair), dtype=bool)
    if doubtful(way, pieces.swept, doubts) > 50:  # more are not followed
        return False
    return not any(_can_meet(state, before, pair, way) for pair in near.pair[doubts].tolist())


def _can_meet(state: BodiesState, before: StepStart, pair: list[int], way: Way) -> bool:
    """Whether two pieces can have met within a step, which is followed in parts."""
    pieces, placements = state.pieces, way.placement[0]
    first, second = pair
    a, b = (int(pieces.body[k]) for k in pair)
    turns = [pin.log3(state.bodies.rotation[k] @ before.kept[1][k].T) for k in (a, b)]
    shapes = [pieces.table.geometry.geometryObjects[k].geometry for k in pair]
    sag = float(_sag(way, a, b))
    both, shift = float(way.angle[a] + way.angle[b]), float(np.linalg.norm(way.shift[b] - way.shift[a]))
    size = float(pieces.lever[a] + pieces.lever[b])
    placed = placements.copy()

    def place(at: float) -> None:
        for piece, body, turn in zip(pair, (a, b), turns, strict=True):
            rotation, start = pin.exp3(at * turn), placements[piece]
            centre = before.kept[0][body]
            placed[piece, :3] = start[:3] @ rotation.T
            placed[piece, 3] = rotation @ (start[3] - centre) + centre + at * way.shift[body]

    request, at, looks, part = coal.DistanceRequest(), 0.0, 0, 1.0
    while at < 1.0:
        place(at)
        result = coal.DistanceResult()
        poses = [coal.Transform3s(placed[k, :3].T, placed[k, 3]) for k in pair]
        distance = coal.distance(shapes[0], poses[0], shapes[1], poses[1], request, result)
        if distance < -PASSING:
            return True
        normal, part = np.array(result.normal), min(2.0 * part, 1.0 - at)
        # seen from a body that turns by w, a point at r with velocity v has at most the acceleration
        # |w|^2 |r| + 2 |w| |v| beside its own; a path sags by an eighth of that
        carried = sag + 0.125 * both**2 * (size + max(distance, 0.0) + shift) + 0.25 * both * shift
        while True:
            place(at + part)
            looks += 1
            if looks > 64:  # what would need more is doubtful
                return True
            if any(
                min(distance, float(apart(first, second, along, placed, pieces.swept))) - part * part * bend > -PASSING
                for along, bend in (
                    (normal, sag),
                    *((pin.exp3(part * turn) @ normal, carried) for turn in turns),
                )
            ):
                break
            part *= 0.5
        at += part
    return False


@compiled()
def highest(piece: int, placement: Array, direction: Array, sign: float, swept: SweptPoints) -> float:
    """Greatest height of a piece along a direction (3,), times `sign`, 1.0 or -1.0."""
    base = 0.0
    local = np.empty(3)
    for k in range(3):
        base += sign * direction[k] * placement[piece, 3, k]
    for i in range(3):
        local[i] = 0.0
        for k in range(3):
            local[i] += sign * direction[k] * placement[piece, i, k]
    start, plane, axes = swept.start[piece], swept.plane[piece], swept.axes[piece]
    if swept.number[piece] > 0:
        best, points = -np.inf, swept.points
        for p in range(start, start + swept.number[piece]):
            best = max(best, points[p, 0] * local[0] + points[p, 1] * local[1] + points[p, 2] * local[2])
        return float(base + best + swept.radius[piece])
    aligned = plane[0] * local[0] + plane[1] * local[1] + plane[2] * local[2]
    if aligned > 0.5:
        return float(base + plane[3]) if aligned > 1.0 - 1e-9 else np.inf
    if axes[0] > 0.0:
        square = 0.0
        for i in range(3):
            square += (axes[i] * local[i]) ** 2
        return float(base + np.sqrt(square))
    return np.inf


@compiled()
def apart(first: int, second: int, direction: Array, placement: Array, swept: SweptPoints) -> float:
    """By how much a direction parts two pieces, metres."""
    low = -highest(second, placement, direction, -1.0, swept)
    return float(low - highest(first, placement, direction, 1.0, swept))


@compiled()
def _sag(way: Way, a: int, b: int) -> float:
    """Largest deviation of a point's path on one body, in the frame of the other, from the straight line, metres."""
    turned = way.angle[a] ** 2 * way.lever[a] + way.angle[b] ** 2 * way.lever[b]
    return float(0.125 * turned + way.fall)


@compiled()
def doubtful(way: Way, swept: SweptPoints, found: Mask) -> int:
    """How many of the near pairs may have been deeper in each other than `PASSING` during a step; which, in `found`."""
    doubts = 0
    for c in range(len(way.pair)):
        p, q = way.pair[c, 0], way.pair[c, 1]
        a, b = way.body[p], way.body[q]
        shift = 0.0
        for k in range(3):
            shift += (way.shift[b, k] - way.shift[a, k]) ** 2
        shift = np.sqrt(shift)
        turn = way.angle[a] * way.lever[a] + way.angle[b] * way.lever[b]
        sag, gap, gap_after = _sag(way, a, b), way.gap[0, c], way.gap[1, c]
        # to be in each other on the way, and out again, they move by both gaps at least
        if shift + turn + sag <= max(gap, 0.0) + max(gap_after, 0.0) + PASSING:
            continue
        if min(gap, apart(p, q, way.normal[0, c], way.placement[1], swept)) - sag > -PASSING:
            continue
        # as seen from one of the bodies, the points of the other also turn with the first
        both = way.angle[a] + way.angle[b]
        sag = 0.125 * both * both * (way.lever[a] + way.lever[b] + max(gap, 0.0) + shift) + 0.25 * both * shift
        sag += way.fall
        until, since = 0.0, 1.0  # shares of the step until which the first direction parts, and since which the last
        for own in (p, q):
            until = max(until, _parted(way, swept, c, own, 0, sag))
            since = min(since, 1.0 - _parted(way, swept, c, own, 1, sag))
        if until < since:
            found[c] = True
            doubts += 1
    return doubts


@compiled(inner=True)
def _parted(way: Way, swept: SweptPoints, c: int, own: int, end: int, sag: float) -> float:
    """Share of the step from an end, 0 or 1, in which the normal there, turned with `own`, parts a pair."""
    here, there = way.placement[end, own], way.placement[1 - end, own]
    turned, size = np.zeros(3), 0.0
    for i in range(3):
        along = 0.0
        for k in range(3):
            along += here[i, k] * way.normal[end, c, k]
        size += along * along
        for k in range(3):
            turned[k] += along * there[i, k]
    if size == 0.0:
        return 0.0
    start = way.gap[end, c] - sag
    last = apart(way.pair[c, 0], way.pair[c, 1], turned, way.placement[1 - end], swept) - sag
    if last >= -PASSING:
        return 1.0 if start >= -PASSING else 0.0
    return 0.0 if start <= -PASSING else (start + PASSING) / (start - last)
