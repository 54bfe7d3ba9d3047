"""Whether pieces can have been in each other on the way of a step, where both ends of it are free."""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.dynamics import passing_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.contact_points import ContactFinder
from wholebody.geometry.proximity import Contacts

PASSING = 1e-4  # m: depth up to which pieces may dip into each other on the way
MOST_LOOKS = 64  # places of one pair on the way; what would need more is doubtful
DOUBTS = 50  # pairs that are looked at on their way, at most
EARLIEST = 0.1  # share of a step: of meetings before it, the points are taken there


class StepStart:
    """The start of a step.

    Attributes:
        near: the pairs within margins (n,) of both bodies.
        margin: (n,) metres.
        kept: positions, rotations and velocities.
    """

    def __init__(self, state: BodiesState, near: Contacts, margin: Array, finder: ContactFinder) -> None:
        """Keep it."""
        self.near, self.margin, self.kept = near, margin, state.copies()
        self._finder, self._active = finder, state.moving | state.given

    def widen(self, travel: Array) -> None:
        """Let the margins be at least the travel (n,) of the bodies, metres: a blow may have made them faster."""
        if (travel > self.margin).any():
            self.margin = np.maximum(self.margin, travel)
            self.near = self._finder.near(self.kept[0], self.kept[1], self.margin, self._active)


class PassingCheck(NamedTuple):
    """What is known of the way of a step.

    Attributes:
        free: whether no pieces can have been deeper than `PASSING` in each other.
        meetings: shares of the step at which pieces meet or may meet, at least `EARLIEST`; none where there are too
            many doubts.
    """

    free: bool
    meetings: tuple[float, ...] = ()


def check_passing(
    state: BodiesState, before: StepStart, after: Contacts, margin: Array, travel: Array, time: float, gravity: float
) -> PassingCheck:
    """Whether pieces can have been deeper than `PASSING` in each other on the way, and where.

    A direction that has kept a pair apart all the time settles most pairs (`passing_kernel`). Others are looked at on
    their way in the same manner, at as many places as that takes.

    Args:
        state: where the bodies are after the step.
        before: the start.
        after: near pairs after it, within margins (n,) of both bodies.
        margin: (n,) metres.
        travel: (n,) most that a point of each body has moved, metres.
        time: of the step, seconds.
        gravity: m/s2.
    """
    before.widen(travel)
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
        near.placements, after.placements, pieces.body, state.position - before.kept[0], angle, pieces.lever, fall,
        PASSING, *pieces.heights, doubts,
    )  # fmt: skip
    if count > DOUBTS:
        return PassingCheck(False)
    met = [
        _meeting(state, before, int(first), int(second), near.placements, angle, fall)
        for first, second in near.pair[doubts]
    ]
    shares = tuple(sorted({max(share, EARLIEST) for share in met if share is not None}))
    return PassingCheck(not shares, shares)


def _meeting(
    state: BodiesState, before: StepStart, first: int, second: int, placements: Array, angle: Array, fall: float
) -> float | None:
    """The share of a step at which two pieces meet, or up to which they surely do not; None if they do not meet.

    The way is followed in parts, along each of which the direction at its start parts the pieces.
    """
    pieces = state.pieces
    pair = (first, second)
    a, b = (int(pieces.body[k]) for k in pair)
    shift = state.position - before.kept[0]
    turns = [pin.log3(state.rotation[k] @ before.kept[1][k].T) for k in (a, b)]
    shapes = [pieces.table.geometry.geometryObjects[k].geometry for k in pair]
    sag = 0.125 * float(angle[a] ** 2 * pieces.lever[a] + angle[b] ** 2 * pieces.lever[b]) + fall
    both, way = float(angle[a] + angle[b]), float(np.linalg.norm(shift[b] - shift[a]))
    size = float(pieces.lever[a] + pieces.lever[b])
    placed = placements.copy()

    def place(at: float) -> None:
        for piece, body, turn in zip(pair, (a, b), turns, strict=True):
            rotation, start = pin.exp3(at * turn), placements[piece]
            placed[piece, :3] = start[:3] @ rotation.T
            placed[piece, 3] = rotation @ (start[3] - before.kept[0][body]) + before.kept[0][body] + at * shift[body]

    def height(piece: int, direction: Array, sign: float) -> float:
        return float(passing_kernel.highest(piece, placed, direction, sign, *pieces.heights))

    request, at, looks, part = coal.DistanceRequest(), 0.0, 0, 1.0
    while at < 1.0:
        place(at)
        result = coal.DistanceResult()
        poses = [coal.Transform3s(placed[k, :3].T, placed[k, 3]) for k in pair]
        distance = coal.distance(shapes[0], poses[0], shapes[1], poses[1], request, result)
        if distance < -PASSING:
            return at
        normal, part = np.array(result.normal), min(2.0 * part, 1.0 - at)
        # seen from a body that turns by w, a point at r with velocity v has at most the acceleration
        # |w|^2 |r| + 2 |w| |v| beside its own; a path sags by an eighth of that
        carried = sag + 0.125 * both**2 * (size + max(distance, 0.0) + way) + 0.25 * both * way
        while True:
            place(at + part)
            looks += 1
            if looks > MOST_LOOKS:
                return at
            if any(
                min(distance, -height(second, along, -1.0) - height(first, along, 1.0)) - part * part * bend > -PASSING
                for along, bend in (
                    (normal, sag),
                    *((pin.exp3(part * turn) @ normal, carried) for turn in turns),
                )
            ):
                break
            part *= 0.5
        at += part
    return None
