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
MOST_LOOKS = 64  # places of one pair on the way; what would need more is doubtful
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
    their way in the same manner, at as many places as that takes.

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
    """Whether two pieces can have met: the way in parts, along each of which the direction at its start parts them."""
    pieces = state.pieces
    pair = (first, second)
    a, b = (int(pieces.body[k]) for k in pair)
    shift = state.position - before.kept[0]
    turns = [pin.log3(state.rotation[k] @ before.kept[1][k].T) for k in (a, b)]
    shapes = [pieces.table.geometry.geometryObjects[k].geometry for k in pair]
    sag = 0.125 * float(angle[a] ** 2 * pieces.levers[a] + angle[b] ** 2 * pieces.levers[b]) + fall
    placed = placements.copy()

    def place(at: float) -> None:
        for piece, body, turn in zip(pair, (a, b), turns, strict=True):
            rotation, start = pin.exp3(at * turn), placements[piece]
            placed[piece, :3] = start[:3] @ rotation.T
            placed[piece, 3] = rotation @ (start[3] - before.kept[0][body]) + before.kept[0][body] + at * shift[body]

    def height(piece: int, direction: Array, sign: float) -> float:
        return float(passing_kernel.highest(piece, placed, direction, sign, *pieces.heights))

    request, at, looks = coal.DistanceRequest(), 0.0, 0
    while at < 1.0:
        place(at)
        result = coal.DistanceResult()
        poses = [coal.Transform3s(placed[k, :3].T, placed[k, 3]) for k in pair]
        distance = coal.distance(shapes[0], poses[0], shapes[1], poses[1], request, result)
        if distance < -PASSING:
            return True
        normal, part = np.array(result.normal), 1.0 - at
        while True:
            place(at + part)
            end = -height(second, normal, -1.0) - height(first, normal, 1.0)
            looks += 1
            if looks > MOST_LOOKS:
                return True
            if min(distance, end) - part * part * sag > -PASSING:
                break
            part *= 0.5
        at += part
    return False
