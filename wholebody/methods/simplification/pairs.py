"""The pairs of pieces that can come near each other in an allowed posture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.methods.simplification.reach import Balls, Reach, about_point, placed
from wholebody.tasks.base import Constraint
from wholebody.tasks.hold import Hold

PROBE = 1e-4  # m: radius of the ball that represents a point in coal


def reachable_pairs(
    figure: Figure,
    pieces: Sequence[pin.GeometryObject],
    size: Array,
    pairs: Indices,
    start: Array,
    clearances: Array,
    constraints: Iterable[Constraint],
    frozen: Iterable[int],
) -> NDArray[np.bool_]:
    """The pairs that can come as near as their clearance; the others never do, whatever the joint values.

    Args:
        figure: the figure.
        pieces: of the figure and of the things.
        size: (pieces,) radius of each about its origin, metres; infinite for a half-space.
        pairs: (pairs, 2) indices of pieces.
        start: (nq,) start of the problem.
        clearances: (pairs,) clearance of each pair, metres.
        constraints: resolved ones; frames held in the world bound the positions of all pieces.
        frozen: degrees of freedom that stay as at the start.

    Returns:
        (pairs,) true without a proof that the pair stays apart.
    """
    model = figure.model
    joint: Indices = np.array([piece.parentJoint for piece in pieces], dtype=np.intp)
    center = np.array([piece.placement.translation for piece in pieces]).reshape(-1, 3)
    reach = Reach(model, start, Balls(center, size, np.arange(len(pieces))), joint, frozen)
    views = [(seat, reach.seen_from(seat), 0.0) for seat in np.unique(joint[pairs]).tolist()]
    # m: largest displacement of a piece by errors of holds; an accepted answer has less
    views += [(0, balls, 1e-3) for balls in held_balls(figure, reach, constraints)]
    open_ = np.ones(len(pairs), dtype=bool)
    for seat, balls, slack in views:
        place, radius = _by_piece(balls, len(pieces))
        for fixed, moving in ((0, 1), (1, 0)):
            mine = np.flatnonzero(open_ & (joint[pairs[:, fixed]] == seat) & (joint[pairs[:, moving]] != seat))
            other, own = pairs[mine, moving], pairs[mine, fixed]
            room = radius[other] + clearances[mine] + slack + COAL_ACCURACY
            apart = np.linalg.norm(place[other] - center[own], axis=1) > room + size[own]
            rest = np.flatnonzero(~apart & np.isfinite(room))
            for row in rest.tolist():
                apart[row] = _beyond(pieces[int(own[row])], place[other[row]], float(room[row]))
            open_[mine[apart]] = False
    return open_


def held_balls(figure: Figure, reach: Reach, constraints: Iterable[Constraint]) -> list[Balls]:
    """Balls of all pieces in the world, from each frame that is held there."""
    found = []
    for hold in constraints:
        if not isinstance(hold, Hold) or hold.relative_to is not None:
            continue
        frame = figure.model.frames[figure.frame_id(hold.frame)]
        kept = hold.kept_at
        balls = placed(reach.seen_from(frame.parentJoint), kept * frame.placement.inverse())
        found.append(balls if hold.orientation else about_point(balls, kept.translation))
    return found


def _by_piece(balls: Balls, count: int) -> tuple[Array, Array]:
    center, radius = np.zeros((count, 3)), np.full(count, np.inf)
    center[balls.piece], radius[balls.piece] = balls.center, balls.radius
    return center, radius


def _beyond(piece: pin.GeometryObject, point: Array, room: float) -> bool:
    """Whether a point, in the frame of the joint that carries a piece, is farther from the piece than `room`."""
    probe, place = coal.Sphere(PROBE), piece.placement
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    there = coal.Transform3s(place.rotation, place.translation)
    gap = coal.distance(piece.geometry, there, probe, coal.Transform3s(np.eye(3), point), request, result)
    return bool(gap + PROBE > room)
