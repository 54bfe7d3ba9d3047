"""Whether pieces can have been in each other on the way of a step, where both ends of it are free."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.dynamics import passing_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.geometry.proximity import Contacts

PASSING = 1e-4  # m: depth up to which pieces may dip into each other on the way
MOST_LOOKS = 64  # distances of one pair on the way; what would need more is doubtful
DOUBTS = 50  # pairs that are looked at on their way, at most


class Before:
    """The start of a step.

    Attributes:
        near: the pairs within margins (n,) of both bodies.
        margin: (n,) metres.
        kept: positions, rotations and velocities.
    """

    def __init__(self, state: BodiesState, near: Contacts, margin: Array) -> None:
        """Keep it."""
        self.near, self.margin, self.kept = near, margin, state.kept()


def passed(
    state: BodiesState, before: Before, after: Contacts, margin: Array, ways: Array, time: float, gravity: float
) -> bool:
    """Whether pieces can have been deeper than `PASSING` in each other on the way.

    A direction that has kept a pair apart all the time settles most pairs (`passing_kernel`). Others are looked at on
    their way, so often that they cannot come into each other in between.

    Args:
        state: where the bodies are after the step.
        before: the start.
        after: near pairs after it, within margins (n,) of both bodies.
        margin: (n,) metres.
        ways: (n,) most that a point of each body has moved, metres.
        time: of the step, seconds.
        gravity: m/s2.
    """
    if not (ways <= before.margin).all():
        return True
    pieces, near = state.pieces, before.near
    bodies = pieces.body[near.pair]
    found = np.full(len(pieces.table.pairs), -1, dtype=np.intp)
    found[after.number] = np.arange(len(after.number))
    found = found[near.number]
    listed = found >= 0
    gap, normal = margin[bodies].sum(axis=1), np.zeros((len(listed), 3))
    gap[listed], normal[listed] = after.distance[found[listed]], after.normal[found[listed]]
    angle, fall = np.linalg.norm(state.spin, axis=1) * time, gravity * time**2 / 8.0
    doubts = np.zeros(len(near.pair), dtype=bool)
    count = passing_kernel.doubtful(
        near.pair, np.ascontiguousarray(near.distance), np.ascontiguousarray(near.normal), gap, normal,
        near.placements, after.placements, pieces.body, state.position - before.kept[0], angle, pieces.levers, fall,
        PASSING, *pieces.heights, doubts,
    )  # fmt: skip
    if count > DOUBTS:
        return True
    return any(
        _met(state, before, int(first), int(second), near.placements, angle, fall)
        for first, second in near.pair[doubts]
    )


def _met(
    state: BodiesState, before: Before, first: int, second: int, placements: Array, angle: Array, fall: float
) -> bool:
    """Whether two pieces can have met: distances at points of the way, between which they move by less."""
    pieces = state.pieces
    a, b = int(pieces.body[first]), int(pieces.body[second])
    shift = state.position - before.kept[0]
    way = float(np.linalg.norm(shift[b] - shift[a]))
    way += float(angle[a] * pieces.levers[a] + angle[b] * pieces.levers[b]) + fall
    turns = [pin.log3(state.rotation[k] @ before.kept[1][k].T) for k in (a, b)]
    shapes = [pieces.table.geometry.geometryObjects[k].geometry for k in (first, second)]
    request, at, looks = coal.DistanceRequest(), 0.0, 0
    while at < 1.0:
        placed = []
        for piece, body, turn in zip((first, second), (a, b), turns, strict=True):
            rotation, start = pin.exp3(at * turn), placements[piece]
            place = rotation @ (start[3] - before.kept[0][body]) + before.kept[0][body] + at * shift[body]
            placed.append(coal.Transform3s(rotation @ start[:3].T, place))
        distance = float(
            coal.distance(shapes[0], placed[0], shapes[1], placed[1], request, coal.DistanceResult())
        )  # fmt: skip
        looks += 1
        if distance < -0.5 * PASSING or looks > MOST_LOOKS:
            return True
        at += (max(distance, 0.0) + 0.5 * PASSING) / max(way, 1e-12)
    return False
