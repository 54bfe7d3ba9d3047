"""Which of two ends of descents is the better one: what all of the ways that are tried are compared by."""

from __future__ import annotations

from wholebody.methods.qp.iterates import LocalSolution

ALIKE = 1e-5  # share of a goal's error by which two descents may differ and count as equally near
JUST = 0.05  # tolerances by which what must hold may be missed more and count as held as well


def held(local: LocalSolution, tolerance: float) -> bool:
    """Whether what must hold does where a descent ended."""
    return broken(local) <= tolerance


def better(one: LocalSolution, other: LocalSolution, tolerance: float) -> bool:
    """Whether one descent ended better: where all is met, then in what must hold, the goals, the measures."""
    met = one.violation.worst <= tolerance
    if met != (other.violation.worst <= tolerance):
        return met
    for left, right, alike in (
        (broken(one), broken(other), JUST * tolerance),
        (one.violation.goal, other.violation.goal, tolerance),
    ):
        left, right = max(left, tolerance), max(right, tolerance)
        if abs(left - right) > max(alike, ALIKE * min(left, right)):
            return left < right
    return one.measure < other.measure


def broken(local: LocalSolution) -> float:
    """By how much what must hold is missed where a descent ended [m, rad]."""
    return max(local.violation.hold, local.violation.elastic)
