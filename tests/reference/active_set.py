"""Correcting an active set in array code: what `wholebody.methods.qp.active_set` must do."""

from __future__ import annotations

import numpy as np

from wholebody.methods.qp.active_set import (
    BOUND_TOLERANCE,
    FULL_CORRECTIONS,
    ROW_TOLERANCE,
    FacePoint,
    minimise_on_face,
)
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram


def solve_from(program: QuadraticProgram, guess: ActiveSet, corrections: int) -> QPSolution | None:
    """Return what `solve_from` returns."""
    active = guess
    for attempt in range(corrections):
        point = minimise_on_face(program, active)
        if point is None:
            return None
        following = _corrected(program, active, point)
        if following.same(active):
            return QPSolution(np.clip(point.x, program.lower, program.upper), active, True, 0)
        active = following if attempt < FULL_CORRECTIONS else _worst_corrected(program, active, following, point)
    return None


def _corrected(program: QuadraticProgram, active: ActiveSet, point: FacePoint) -> ActiveSet:
    """The set with wrong signs put right."""
    x, gradient = point.x, point.gradient
    elastic = program.elastic @ x < program.least - ROW_TOLERANCE
    elastic[active.elastic] = point.push >= 0.0
    lower = np.where(active.lower, gradient >= 0.0, x < program.lower - BOUND_TOLERANCE)
    upper = np.where(active.upper, gradient <= 0.0, x > program.upper + BOUND_TOLERANCE)
    return ActiveSet(lower, upper, elastic)


def _worst_corrected(program: QuadraticProgram, active: ActiveSet, following: ActiveSet, point: FacePoint) -> ActiveSet:
    """The active set with the one entry changed that is most wrong, in units of x."""
    pull = np.abs(point.gradient) / program.diagonal
    wrong_low = np.where(active.lower, pull, program.lower - point.x) * (following.lower != active.lower)
    wrong_high = np.where(active.upper, pull, point.x - program.upper) * (following.upper != active.upper)
    lack = program.least - program.elastic @ point.x
    lack[active.elastic] = -point.push * (program.elastic[active.elastic] ** 2 @ (1.0 / program.diagonal))
    wrong = np.concatenate([wrong_low, wrong_high, lack * (following.elastic != active.elastic)])
    worst = int(np.argmax(wrong))
    flat = np.concatenate([active.lower, active.upper, active.elastic])
    flat[worst] = not flat[worst]
    size = program.size
    return ActiveSet(flat[:size], flat[size : 2 * size], flat[2 * size :])
