"""What stages of a search have in common: postures with their linearisations, steps with predictions, and ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import UndefinedTermError
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.control import Control
from wholebody.methods.qp.active_set import Parts
from wholebody.methods.qp.quadratic_program import Multipliers, Rows, Violation
from wholebody.methods.qp.settings import DESCENT, Settings
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.solution import TraceEntry
from wholebody.terms.linearisation import Linearisation, Lineariser


class StepAcceptance(NamedTuple):
    """How a step did."""

    accepted: bool  # whether it is taken
    good: bool  # whether it achieved the predicted reduction
    poor: bool  # whether it achieved much less
    by: str  # "measure" or "goal", by which it was judged; "rejected", or "rejected measure" where the measures led


class PredictedReduction(NamedTuple):
    """Reductions of the violation and of the measures that a program predicts."""

    violation: float
    measure: float


class LocalSolution(NamedTuple):
    """Where a descent ended."""

    q: Array  # (nq,) posture
    violation: Violation  # the residual violation
    measure: float  # weighted sum of the measures
    converged: bool  # whether it ended because nothing better is near, rather than out of iterations
    iterations: int  # how many programs were solved


class Iterate(NamedTuple):
    """A posture that was looked at, and the longest entry of the step that led there, radians or metres."""

    at: Linearisation
    rows: Rows
    violation: Violation
    placed: QueryResult
    longest: float = np.inf


class Step(NamedTuple):
    """What a program says about the step from a posture."""

    dq: Array  # (nv,) the step: the program's answer, or its normal part where the measures have nothing to gain
    parts: Parts | None  # the answer's parts; None far from the goals, and where measures do not count
    flat: bool  # whether the tangential part saves less of the measures than counts
    answer: Array  # (nv,) the program's answer
    predicted: PredictedReduction  # the reduction that the program predicts
    multipliers: Multipliers | None  # of the program; None as for the parts
    saves: float  # by how much the measures decrease, to second order, with the program's answer


class Run(NamedTuple):
    """What the stages of a search share."""

    subproblem: Subproblem  # builds the programs
    lineariser: Lineariser  # linearises the problem
    solver: QPSolver  # solves the programs
    trace: list[TraceEntry]  # grows by one entry a program
    control: Control  # what may end it


@dataclass
class Stage:
    """What leads from a start to a posture."""

    shared: Run
    tolerance: float  # metres and radians
    iterations: int  # most programs to solve
    note: str = ""  # what to call the programs in the trace

    def iterate_at(self, q: Array, within: float, longest: float = np.inf, *, planes: bool = False) -> Iterate:
        """A posture (nq,) with the rows of pairs within a distance, metres; UndefinedTermError."""
        at = self.shared.lineariser.at(q, within, planes=planes)
        rows = self.shared.subproblem.rows(at)
        return Iterate(at, rows, self.shared.subproblem.violation(rows), QueryResult(at.contacts, within), longest)

    def moved(self, here: Iterate, displacement: Array) -> Iterate | None:
        """Where a displacement (nv,) leads; None where a term of one's own is not finite there."""
        q = np.asarray(pin.integrate(self.shared.lineariser.state.model, here.at.q, displacement))
        try:
            return self.look(q, float(np.abs(displacement).max(initial=0.0)))
        except UndefinedTermError as error:
            self.shared.control.step_back(error)
            return None

    def look(self, q: Array, longest: float = np.inf) -> Iterate:
        """A posture (nq,) that a displacement with this longest entry led to, with its rows; UndefinedTermError."""
        raise NotImplementedError

    def ended(self, here: Iterate, converged: bool, count: int) -> LocalSolution:
        """A posture as the end, after so many programs."""
        return LocalSolution(here.at.q, here.violation, here.at.measure, converged, count)

    def jumps(self, here: Iterate, there: Iterate) -> bool:
        """Whether the motion between two postures passes through something."""
        return passes_through(self.shared.lineariser.workspace, here.placed, there.placed, here.at.q, there.at.q)

    def record(self, there: Iterate, what: str) -> None:
        """Tell of a program by what became of its step."""
        violation, note = there.violation, f"{self.note}: {what}" if self.note else what
        held = max(violation.hold, violation.elastic)
        self.shared.trace.append(TraceEntry(violation.left, held, there.at.measure, there.longest, note))
        self.shared.control.tell(self.shared.trace[-1])


def moving(shared: Run, q: Array) -> int:
    """How many degrees of freedom move a goal at q (nq,)."""
    rows = shared.subproblem.rows(shared.lineariser.at(q, 0.0))
    return int(rows.soft[: rows.goals].any(axis=0).sum())


def judge(
    before: tuple[float, float], after: tuple[float, float], predicted: PredictedReduction, width: float | None
) -> StepAcceptance:
    """Judge a step: far from the goals by the violation, near by the measures (or Lagrangian), inside a funnel."""
    # Gould and Toint 2010, whose funnel narrows; `width` is None where the measures do not count.
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


def better(one: LocalSolution, other: LocalSolution, settings: Settings) -> bool:
    """Whether one descent ended better: where all is met, then in constraints, goals and, if these count, measures."""
    tolerance = settings.tolerance
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
    return settings.measures and one.measure < other.measure


def broken(local: LocalSolution) -> float:
    """Largest violation of constraints where a descent ended [m, rad]."""
    return max(local.violation.hold, local.violation.elastic)
