"""Sequential quadratic programming from one start to the nearest posture that fits.

Each iteration linearises, solves one quadratic program within a box trust region and judges the posture it leads to by
two figures, the violation and the measures, with a funnel (Gould and Toint 2010): while what is asked is far, a step
must lessen the violation; near, it must lessen the measures and stay inside a funnel of violation that narrows. No
penalty weight has to be guessed, and measures may improve along curved constraints in long steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.linearisation import Linearisation, Lineariser
from wholebody.methods.qp.quadratic_program import ActiveSet, Array
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import Rows, Subproblem, Violation
from wholebody.methods.qp.working_set import solve_by_rows
from wholebody.problem import Iterate

FIRST_RADIUS = 0.3  # rad, m: first trust region; larger = fewer iterations in the open, more rejected ones in clutter
LARGEST_RADIUS = 0.6
LEAST_RADIUS = 1e-7
FUNNEL = 0.02  # violation that is allowed while the measures improve, at first
SWITCH = 10.0  # the measures lead once they gain more than this times the squared violation
PAIRS_WITHIN = 2.0  # pairs within this many radii of the trust region get a row: limbs reach farther than one joint turns
LEAST_WITHIN = 0.05  # m


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


@dataclass
class Descent:
    """One descent; call `run`.

    Attributes:
        subproblem: builds the programs.
        lineariser: linearises the problem.
        solver: solves the programs.
        tolerance: metres and radians.
        iterations: most programs to solve.
        deadline: `time.perf_counter()` at which to stop.
        offset: (goal rows,) subtracted from the goal errors: a nearer goal on the way to the true one.
        trace: grows by one entry an iteration.
    """

    subproblem: Subproblem
    lineariser: Lineariser
    solver: QPSolver
    tolerance: float
    iterations: int
    deadline: float
    offset: Array | None = None
    trace: list[Iterate] = field(default_factory=list)
    watch: Callable[[Array], None] | None = None

    def run(self, start: Array, note: str = "") -> Local:
        """Descend from a posture within limits, shape (nq,)."""
        model = self.lineariser.state.model
        here = self._visit(start, FIRST_RADIUS)
        funnel = max(FUNNEL, here.violation.total)
        radius, damping = FIRST_RADIUS, 0.0
        guess: ActiveSet | None = None
        shift = np.zeros(len(here.rows.soft_error))
        count, still = 0, 0
        converged = False
        while count < self.iterations and time.perf_counter() < self.deadline:
            count += 1
            program = self.subproblem.program(here.at, here.rows, radius, damping, shift)
            answer = solve_by_rows(self.solver, program, guess)
            guess, dq = answer.active, answer.x
            step = float(np.abs(dq).max(initial=0.0))
            foreseen = self.subproblem.violation(here.rows, dq)
            gain = here.violation.total - foreseen.total
            saving = -float(here.at.gradient @ dq + 0.5 * (program.diagonal * dq) @ dq)
            settled = gain <= 0.5 * self.tolerance or gain <= 1e-4 * here.violation.total
            if settled and (step <= 10.0 * self.tolerance or saving <= 1e-7 * (1.0 + abs(here.at.measure))):
                converged = True
                if here.violation.total <= self.tolerance or gain <= 0.0:
                    break
                still += 1
                if still > 3:
                    break
            there = self._visit(pin.integrate(model, here.at.q, dq), radius)
            verdict = _judge(here, there, gain, saving, funnel)
            self.trace.append(
                Iterate(there.violation.goal, there.violation.total, there.at.measure, step, note or verdict.name)
            )
            if verdict.accepted:
                if verdict.narrows:
                    funnel = max(0.9 * funnel, there.violation.total + 0.5 * (here.violation.total - there.violation.total))
                    funnel = max(min(funnel, FUNNEL), there.violation.total)
                residual = program.rows @ dq - program.target
                shift = residual if np.abs(residual).max(initial=0.0) < 1e-4 else np.zeros_like(shift)
                if verdict.good:
                    damping *= 0.3
                    if step > 0.8 * radius:
                        radius = min(2.0 * radius, LARGEST_RADIUS)
                elif verdict.poor:
                    radius = max(0.5 * step, LEAST_RADIUS)
                here = there
            else:
                radius = 0.35 * min(step, radius)
                damping = max(0.5, 2.0 * damping) if not verdict.measures_led else damping
                shift = np.zeros_like(shift)
                if radius < LEAST_RADIUS:
                    converged = True
                    break
        return Local(here.at.q, here.violation, here.at.measure, converged, count)

    def _visit(self, q: Array, radius: float) -> _Visit:
        if self.watch is not None:
            self.watch(q)
        at = self.lineariser.at(q, max(LEAST_WITHIN, PAIRS_WITHIN * radius))
        rows = self.subproblem.rows(at)
        if self.offset is not None:
            rows.soft_error[: rows.goals] -= self.offset
        return _Visit(at, rows, self.subproblem.violation(rows))


class _Visit(NamedTuple):
    at: Linearisation
    rows: Rows
    violation: Violation


class _Verdict(NamedTuple):
    accepted: bool
    good: bool
    poor: bool
    narrows: bool
    measures_led: bool
    name: str


def _judge(here: _Visit, there: _Visit, gain: float, saving: float, funnel: float) -> _Verdict:
    """Whether to go there, given what was foreseen: `gain` of violation and `saving` of the measures."""
    before, after = here.violation.total, there.violation.total
    saved = here.at.measure - there.at.measure
    measures_lead = saving > SWITCH * before**2 and before <= funnel
    if measures_lead and after <= funnel and saved >= 0.05 * saving:
        return _Verdict(True, saved >= 0.5 * saving, saved < 0.25 * saving, False, True, "measure")
    gained = before - after
    if gain > 0.0 and gained >= 0.05 * gain:
        return _Verdict(True, gained >= 0.5 * gain, gained < 0.25 * gain, True, False, "goal")
    return _Verdict(False, False, False, False, measures_lead, "rejected")
