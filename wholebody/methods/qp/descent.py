"""Sequential quadratic programming from one start to the nearest posture that fits.

Each iteration linearises, solves one quadratic program that asks for a piece of the way, and judges the posture it
leads to by two figures, the violation and the measures, with a funnel (Gould and Toint 2010): while what is asked is
far, a step must lessen the violation; near, it must lessen the measures and stay inside a funnel of violation that
narrows. No penalty weight has to be guessed, and measures may improve along curved constraints in long steps. Steps
that could have jumped over something are swept.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.linearisation import Linearisation, Lineariser
from wholebody.methods.qp.acceleration import Anderson
from wholebody.methods.qp.passage import Placed, doubtful_pairs, snapshot
from wholebody.methods.qp.quadratic_program import ActiveSet, Array, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import PULL, Rows, Subproblem, Violation
from wholebody.methods.qp.working_set import solve_by_rows
from wholebody.problem import Iterate

FIRST_RADIUS = 0.3  # rad, m: of the trust region; larger = fewer iterations in the open, more rejected ones in clutter
LARGEST_RADIUS = 0.8
LEAST_RADIUS = 1e-7
FUNNEL = 0.02  # violation that is allowed while the measures improve, at first
SWITCH = 10.0  # the measures lead once they gain more than this times the squared violation
LEAST_WITHIN = 0.05  # m: pairs nearer than this, or than a step is long, get rows
SLOW = 0.1  # share of the violation that must go in PATIENCE iterations, else only the nearest posture is sought
PATIENCE = 6
RENEWALS = 2  # times that a descent with small steps begins anew with long ones before it is taken for settled
MENDABLE = 0.03  # m, rad: violation that the next step is trusted to mend
NEAR_MET = 1e-4  # m, rad: goals this near to being met are met by the method of multipliers


class Local(NamedTuple):
    """Where a descent ended.

    Attributes:
        q: (nq,) posture.
        violation: what is left there.
        measure: weighted sum of the measures.
        converged: whether it ended because nothing better is near, rather than out of iterations or time.
        iterations: how many programs were solved.
    """

    q: Array
    violation: Violation
    measure: float
    converged: bool
    iterations: int


class _Visit(NamedTuple):
    """A posture that was looked at."""

    at: Linearisation
    rows: Rows
    violation: Violation
    placed: Placed


class _Verdict(NamedTuple):
    """How a step did: whether it is taken, how well it was foreseen, and by which figure."""

    accepted: bool
    good: bool
    poor: bool
    by: str


@dataclass
class Descent:
    """One descent; call `run` once.

    Attributes:
        subproblem: builds the programs.
        lineariser: linearises the problem.
        solver: solves the programs.
        tolerance: metres and radians.
        iterations: most programs to solve.
        deadline: `time.perf_counter()` at which to stop.
        offset: (goal rows,) subtracted from the goal errors: a nearer goal on the way to the true one.
        trace: grows by one entry an iteration.
        note: what to call the iterations in the trace.
        measures: whether the measures count from the beginning; without them only the goals are sought.
    """

    subproblem: Subproblem
    lineariser: Lineariser
    solver: QPSolver
    tolerance: float
    iterations: int
    deadline: float
    offset: Array | None = None
    trace: list[Iterate] = field(default_factory=list)
    note: str = ""
    measures: bool = True

    def __post_init__(self) -> None:
        """Begin with a wide trust region and nothing remembered."""
        self._radius, self._damping, self._measures = FIRST_RADIUS, 0.0, self.measures
        self._anchor: _Visit | None = None  # where to go back to if a step that broke a rule is not mended
        self._memory = Anderson()

    def run(self, start: Array) -> Local:
        """Descend from a posture within limits, shape (nq,)."""
        here = self._visit(start)
        self._funnel = max(FUNNEL, here.violation.total)
        self._shift = np.zeros(len(here.rows.soft_error))
        guess: ActiveSet | None = None
        history: list[float] = []
        count, converged, renewals = 0, False, RENEWALS
        while count < self.iterations and time.perf_counter() < self.deadline:
            count += 1
            program = self.subproblem.program(
                here.at, here.rows, self._radius, self._damping, self._shift, self._measures
            )
            answer = solve_by_rows(self.solver, program, guess)
            guess = answer.active
            gain = here.violation.total - self.subproblem.violation(here.rows, answer.x).total
            saving = -float(program.linear @ answer.x + 0.5 * (program.diagonal * answer.x) @ answer.x)
            if self._settled(here, answer, gain, saving):
                if self._radius < FIRST_RADIUS and renewals:  # small steps alone are no sign of an optimum
                    renewals -= 1
                    self._radius, self._damping = FIRST_RADIUS, 0.0
                    continue
                converged = True
                break
            there = self._advance(here, program, answer, gain, saving)
            if there is not None:
                here = there
                history.append(here.violation.total)
                if self._stagnates(history):
                    self._measures = False
                    self._memory.forget()
                elif self.measures and not self._measures and here.violation.worst <= 10.0 * self.tolerance:
                    self._measures = True
            elif self._anchor is not None:
                here, self._anchor = self._anchor, None
            elif self._radius < LEAST_RADIUS:
                converged = True
                break
        if self._anchor is not None:
            here = self._anchor
        return Local(here.at.q, here.violation, here.at.measure, converged, count)

    def _settled(self, here: _Visit, answer: QPSolution, gain: float, saving: float) -> bool:
        """Whether nothing worth having is foreseen."""
        violation = here.violation
        held = max(violation.hold, violation.elastic) <= self.tolerance
        worth = max(0.05 * self.tolerance, 1e-3 * violation.total if held else 0.0)
        if violation.worst > self.tolerance and gain > worth:
            return False
        if not self._measures:
            return True
        still = float(np.abs(answer.x).max(initial=0.0)) <= 10.0 * self.tolerance
        return still or saving <= 1e-2 * self.tolerance * (1.0 + abs(here.at.measure))

    def _stagnates(self, history: list[float]) -> bool:
        """Whether the violation has hardly lessened for a while, so that the measures should not hold it up."""
        if not self._measures or len(history) <= PATIENCE or history[-1] <= 100.0 * self.tolerance:
            return False
        return min(history[-PATIENCE:]) > (1.0 - SLOW) * min(history[:-PATIENCE])

    def _advance(
        self, here: _Visit, program: QuadraticProgram, answer: QPSolution, gain: float, saving: float
    ) -> _Visit | None:
        """Go where the program says, or farther along what the last steps foretell; None if neither is good."""
        dq = answer.x
        fast = self._memory.propose(dq) if self._measures and gain <= FUNNEL * 0.1 else None
        if fast is not None:
            leap = self._try(here, np.clip(fast, program.lower, program.upper))
            if leap is not None and self._judge(here, leap, gain, saving).by == "measure":
                self._memory.went(leap[1])
                self._record(leap[0], leap[1], "accelerated")
                self._shift = self._multipliers(program, dq)
                self._anchor = None
                return leap[0]
        tried = self._try(here, dq)
        verdict = _Verdict(False, False, False, "blocked") if tried is None else self._judge(here, tried, gain, saving)
        if tried is not None:
            self._record(tried[0], dq, verdict.by)
        step = float(np.abs(dq).max(initial=0.0))
        if tried is not None and not verdict.accepted and self._promises(here, tried[0]):
            self._anchor = here
            self._memory.forget()
            self._shift = np.zeros_like(self._shift)
            return tried[0]
        if tried is None or not verdict.accepted:
            self._radius = 0.3 * min(step, self._radius)
            self._damping = max(0.3, 2.0 * self._damping) if verdict.by != "rejected measure" else self._damping
            self._shift = np.zeros_like(self._shift)
            self._memory.forget()
            return None
        there, self._anchor = tried[0], None
        if verdict.by == "measure":
            self._memory.went(dq)
        else:
            self._memory.forget()
            before, after = here.violation.total, there.violation.total
            narrower = max(0.9 * self._funnel, after + 0.5 * (before - after))
            self._funnel = max(min(narrower, FUNNEL), after)
        if verdict.good:
            self._damping *= 0.3
            if step > 0.5 * self._radius or here.violation.left > PULL * self._radius:
                self._radius = min(2.0 * self._radius, LARGEST_RADIUS)
        elif verdict.poor:
            self._radius = 0.5 * self._radius
        self._shift = self._multipliers(program, dq)
        return there

    def _promises(self, here: _Visit, there: _Visit) -> bool:
        """Whether a rejected step went well but for curved constraints: one more may put that right (watchdog)."""
        if self._anchor is not None or not self._measures:
            return False
        return (
            there.violation.goal < here.violation.goal and max(there.violation.elastic, there.violation.hold) < MENDABLE
        )

    def _multipliers(self, program: QuadraticProgram, dq: Array) -> Array:
        """What the rows would still lack after the step because the measures pull: to be asked for in the next one."""
        residual = program.rows @ dq - program.target
        return residual if np.abs(residual).max(initial=0.0) < NEAR_MET else np.zeros_like(residual)

    def _try(self, here: _Visit, dq: Array) -> tuple[_Visit, Array] | None:
        """Visit the posture a displacement leads to; None where something would be jumped over on the way."""
        q = pin.integrate(self.lineariser.state.model, here.at.q, dq)
        there = self._visit(q)
        proximity = self.lineariser.scene.proximity
        doubtful = doubtful_pairs(proximity, here.placed, there.placed)
        if len(doubtful):
            sweep = self.lineariser.scene.sweeper
            hit = sweep.first_contact(here.at.q, q, proximity.pairs[doubtful], JUMP_TOLERANCE)
            if hit is not None and self._passed(here, there, hit.index):
                return None
        return there, dq

    def _passed(self, here: _Visit, there: _Visit, pair: int) -> bool:
        """Whether a pair that touches on the way is apart again after it: jumped over, not bumped into."""
        near = np.flatnonzero(there.at.contacts.number == pair)
        return not len(near) or bool(there.at.contacts.distance[near[0]] > -JUMP_TOLERANCE)

    def _visit(self, q: Array) -> _Visit:
        within = max(LEAST_WITHIN, PULL * self._radius)
        at = self.lineariser.at(q, within)
        rows = self.subproblem.rows(at)
        if self.offset is not None:
            rows.soft_error[: rows.goals] -= self.offset
        proximity = self.lineariser.scene.proximity
        return _Visit(at, rows, self.subproblem.violation(rows), snapshot(proximity, at.contacts, within))

    def _judge(self, here: _Visit, tried: tuple[_Visit, Array], gain: float, saving: float) -> _Verdict:
        """Whether to go there, given what was foreseen: `gain` of violation and `saving` of the measures."""
        there = tried[0]
        compared = here if self._anchor is None else self._anchor
        before, after = compared.violation.total, there.violation.total
        if self._anchor is not None:
            gain = max(0.1 * gain, 1e-3 * before)
        measures_lead = self._measures and saving > SWITCH * before**2 and before <= self._funnel
        if measures_lead and after <= self._funnel:
            saved = compared.at.measure - there.at.measure
            if saved >= 0.05 * saving:
                return _Verdict(True, saved >= 0.5 * saving, saved < 0.25 * saving, "measure")
        gained = before - after
        if gain > 0.0 and gained >= 0.05 * gain:
            return _Verdict(True, gained >= 0.5 * gain, gained < 0.25 * gain, "goal")
        return _Verdict(False, False, False, "rejected measure" if measures_lead else "rejected")

    def _record(self, there: _Visit, dq: Array, what: str) -> None:
        step = float(np.abs(dq).max(initial=0.0))
        note = f"{self.note}: {what}" if self.note else what
        self.trace.append(
            Iterate(
                there.violation.left, max(there.violation.hold, there.violation.elastic), there.at.measure, step, note
            )
        )


JUMP_TOLERANCE = 2e-4  # m: overlap on the way that does not count; finer than any piece is thick
