"""What a descent looks at and answers: a posture with its linearisation, a step with its prediction, and the end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.methods.qp.rows import Multipliers, Rows, Violation
from wholebody.methods.qp.settings import DESCENT
from wholebody.methods.qp.tangential import Parts
from wholebody.terms.linearisation import Linearisation


class StepAcceptance(NamedTuple):
    """How a step did.

    Attributes:
        accepted: whether it is taken.
        good: whether it achieved the predicted reduction.
        poor: whether it achieved much less.
        by: "measure" or "goal", by which it was judged; "rejected", or "rejected measure" where the measures led.
    """

    accepted: bool
    good: bool
    poor: bool
    by: str


class PredictedReduction(NamedTuple):
    """Reductions of the violation and of the measures that a program predicts."""

    violation: float
    measure: float


class LocalSolution(NamedTuple):
    """Where a descent ended.

    Attributes:
        q: (nq,) posture.
        violation: the residual violation.
        measure: weighted sum of the measures.
        converged: whether it ended because nothing better is near, rather than out of iterations.
        iterations: how many programs were solved.
    """

    q: Array
    violation: Violation
    measure: float
    converged: bool
    iterations: int


class Iterate(NamedTuple):
    """A posture that was looked at, and the longest entry of the step that led there, radians or metres."""

    at: Linearisation
    rows: Rows
    violation: Violation
    placed: QueryResult
    longest: float = np.inf


class Step(NamedTuple):
    """What a program says about the way from a posture.

    Attributes:
        dq: (nv,) the step: the program's answer, or its normal part where the measures have nothing to gain.
        parts: the answer's parts; None far from the goals, and where measures do not count.
        flat: whether the tangential part saves less of the measures than counts.
        answer: (nv,) the program's answer.
        predicted: the reduction that the program predicts.
        multipliers: of the program; None as for the parts.
        saves: by how much the measures decrease, to second order, with the program's answer.
    """

    dq: Array
    parts: Parts | None
    flat: bool
    answer: Array
    predicted: PredictedReduction
    multipliers: Multipliers | None
    saves: float


def judge(
    before: tuple[float, float], after: tuple[float, float], predicted: PredictedReduction, width: float | None
) -> StepAcceptance:
    """Judge a step.

    Far from the goals it must reduce the violation. Near, it must reduce the measures and stay inside a funnel, the
    violation that is allowed meanwhile (Gould and Toint 2010, whose funnel narrows).

    Args:
        before: violation and measures before it; near the goals the Lagrangian stands for the measures.
        after: and after it.
        predicted: the predicted reduction.
        width: of the funnel; None where the measures do not count.
    """
    inside = width is not None and before[0] <= width
    lead = inside and predicted.measure > DESCENT.switch * before[0] ** 2
    criteria = [("goal", before[0] - after[0], predicted.violation, predicted.violation > 0.0)]
    if lead and width is not None:
        criteria.insert(0, ("measure", before[1] - after[1], predicted.measure, after[0] <= width))
    for by, gain, expected, allowed in criteria:
        if allowed and gain >= DESCENT.worth * expected:
            return StepAcceptance(True, gain >= DESCENT.good * expected, gain < DESCENT.poor * expected, by)
    return StepAcceptance(False, False, False, "rejected measure" if lead else "rejected")


def held(local: LocalSolution, tolerance: float) -> bool:
    """Whether the constraints hold where a descent ended."""
    return broken(local) <= tolerance


def better(one: LocalSolution, other: LocalSolution, tolerance: float) -> bool:
    """Whether one descent ended better: where all is met, then in the constraints, the goals, the measures."""
    met = one.violation.worst <= tolerance
    if met != (other.violation.worst <= tolerance):
        return met
    for left, right, alike in (
        (broken(one), broken(other), 0.05 * tolerance),
        (one.violation.goal, other.violation.goal, tolerance),
    ):
        left, right = max(left, tolerance), max(right, tolerance)
        if abs(left - right) > max(alike, 1e-5 * min(left, right)):
            return left < right
    return one.measure < other.measure


def broken(local: LocalSolution) -> float:
    """Largest violation of constraints where a descent ended [m, rad]."""
    return max(local.violation.hold, local.violation.elastic)
