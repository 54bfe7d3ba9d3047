"""Sequential quadratic programming from one start to the nearest posture that fits.

Each iteration linearises, solves one quadratic program that asks for a piece of the way, and judges the posture it
leads to by two figures, the violation and the measures, with a funnel (Gould and Toint 2010): while what is asked is
far, a step must lessen the violation; near, it must lessen the measures and stay inside a funnel of violation that
narrows. No penalty weight has to be guessed, and measures may improve along curved constraints in long steps. Steps
that could have jumped over something are swept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from wholebody.geometry.moved_pairs import Placed
from wholebody.linearisation import Lineariser
from wholebody.methods.control import Control
from wholebody.methods.passage import jumps
from wholebody.methods.qp.acceleration import Anderson
from wholebody.methods.qp.funnel import Funnel, Outlook, Verdict
from wholebody.methods.qp.quadratic_program import Array, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import PULL, Subproblem
from wholebody.methods.qp.visit import Local, Visit
from wholebody.methods.qp.working_set import WorkingSet
from wholebody.solution import Iterate

FIRST_RADIUS = 0.3  # rad, m: of the trust region; larger = fewer iterations in the open, more rejected ones in clutter
LARGEST_RADIUS = 0.8
LEAST_RADIUS = 1e-7
EAGER_DAMPING = (0.5, 2.0)  # shares of the squared error; the second after a step was rejected, nothing eager after two
EAGER_GAIN = 0.05  # share of the violation that a step must take away, or nothing is eager any more
LEAST_WITHIN = 0.05  # m: pairs nearer than what a step asks for get rows, and at least those nearer than this
MOST_WITHIN = 0.12  # m: but none farther apart than this; more is slower, less means more steps that meet things unseen
SLOW = 0.1  # share of the violation that must go in PATIENCE iterations, else only the nearest posture is sought
PATIENCE = 6
IDLE = 4  # postures that fit and are hardly better (ten tolerances of the measure) than the best before: then it ends
RENEWALS = 2  # times that a descent with small steps begins anew with long ones before it is taken for settled
MENDABLE = 0.03  # m, rad: violation that the next step is trusted to mend
DULL, FLAT = 1e-3, 1e-7  # shares of the violation that a step must be foreseen to gain, with measures and without
LAST_STRETCH = 2e-3  # violation foreseen to go, below which steps may be extrapolated
NEAR_MET = 1e-4  # m, rad: goals this near to being met are met by the method of multipliers


@dataclass
class Descent:
    """One descent; call `run` once.

    Attributes:
        subproblem: builds the programs.
        lineariser: linearises the problem.
        solver: solves the programs.
        tolerance: metres and radians.
        iterations: most programs to solve.
        offset: (goal rows,) subtracted from the goal errors: a nearer goal on the way to the true one.
        trace: grows by one entry an iteration.
        note: what to call the iterations in the trace.
        measures: whether the measures count from the beginning; without them only the goals are sought, and the first
            posture that fits is the end.
        hasty: whether to give up where the violation hardly lessens for a while.
        eager: whether to ask for all of the way to the goals in every step, damped by how far they are, until steps are
            rejected or gain little; else for a piece of it.
        control: what may end it.
        hopeless: asked once, where the violation first lessens hardly for a while, whether to go on from a posture
            (nq,) leads nowhere.
    """

    subproblem: Subproblem
    lineariser: Lineariser
    solver: QPSolver
    tolerance: float
    iterations: int
    offset: Array | None = None
    trace: list[Iterate] = field(default_factory=list)
    note: str = ""
    measures: bool = True
    hasty: bool = False
    eager: bool = False
    control: Control = field(default_factory=lambda: Control(np.inf))
    hopeless: Callable[[Array], bool] | None = None

    def __post_init__(self) -> None:
        """Begin with a wide trust region and nothing remembered."""
        self._radius, self._measures, self._eager = FIRST_RADIUS, self.measures, self.eager
        self._damping = EAGER_DAMPING[0] if self.eager else 0.0
        self._stretch = (
            1.0  # goals that conflict stay far while steps get short: then all of their errors are asked for
        )
        self._anchor: Visit | None = None  # where to go back to if a step that broke a rule is not mended
        self._memory = Anderson()
        self._kept: Visit | None = None  # best posture that fits, and how many since were hardly better
        self._idle = 0

    def run(self, start: Array) -> Local:
        """Descend from a posture within limits, shape (nq,)."""
        here = self._visit(start)
        self._funnel = Funnel(here.violation.total)
        self._shift = np.zeros(len(here.rows.soft_error))
        working_set = WorkingSet(self.solver)
        history: list[float] = []
        count, converged, renewals = 0, False, RENEWALS
        while count < self.iterations and not self.control.over:
            if not self.measures and here.violation.worst <= self.tolerance:
                converged = True
                break
            count += 1
            program = self.subproblem.program(
                here.at,
                here.rows,
                self._radius,
                None if self._eager else self._pull,
                self._damping,
                self._shift,
                self._measures,
            )
            answer = working_set.solve(program, here.rows.key)
            outlook = Outlook(
                here.violation.total - self.subproblem.violation(here.rows, answer.x).total,
                -float(program.linear @ answer.x + 0.5 * (program.diagonal * answer.x) @ answer.x)
                / self.subproblem.scale,
            )
            if self._settled(here, answer, outlook):
                if self._radius < FIRST_RADIUS and renewals:  # small steps alone are no sign of an optimum
                    renewals -= 1
                    self._radius, self._damping, self._eager = FIRST_RADIUS, 0.0, False
                    continue
                converged = True
                break
            if self._idle >= IDLE:
                converged = True
                break
            there = self._advance(here, program, answer, outlook)
            if there is not None:
                here = there
                self._keep(here)
                history.append(here.violation.total)
                if self.hasty and self._lingers(history):
                    break
                if self.hopeless is not None and self._lingers(history):
                    hopeless, self.hopeless = self.hopeless(here.at.q), None
                    if hopeless:
                        break
                if self._measures and self._lingers(history):
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
        if self._kept is not None and not self._better_than_kept(here):
            here = self._kept
        return Local(here.at.q, here.violation, here.at.measure, converged, count)

    def _keep(self, here: Visit) -> None:
        """Remember the best posture that fits: curved constraints make the measures go to and fro near an optimum."""
        if here.violation.worst > self.tolerance or not self._measures:
            return
        worth = 10.0 * self.tolerance * (1.0 + abs(here.at.measure))
        clearly = self._kept is None or self._kept.at.measure - here.at.measure > worth
        self._idle = 0 if clearly else self._idle + 1
        if self._better_than_kept(here):
            self._kept = here

    def _better_than_kept(self, here: Visit) -> bool:
        fits = here.violation.worst <= self.tolerance
        return fits and (self._kept is None or here.at.measure < self._kept.at.measure)

    @property
    def _pull(self) -> float:
        return PULL * self._radius * self._stretch

    def _settled(self, here: Visit, answer: QPSolution, outlook: Outlook) -> bool:
        """Whether nothing worth having is foreseen."""
        violation = here.violation
        held = max(violation.hold, violation.elastic) <= self.tolerance
        worth = max(0.05 * self.tolerance, (DULL if self._measures else FLAT) * violation.total if held else 0.0)
        if violation.worst > self.tolerance and outlook.gain > worth:
            return False
        if not self._measures:
            return True
        still = float(np.abs(answer.x).max(initial=0.0)) <= 10.0 * self.tolerance
        return still or outlook.saving <= 1e-2 * self.tolerance * (1.0 + abs(here.at.measure))

    def _lingers(self, history: list[float]) -> bool:
        """Whether the violation has hardly lessened for a while."""
        if len(history) <= PATIENCE or history[-1] <= 100.0 * self.tolerance:
            return False
        return min(history[-PATIENCE:]) > (1.0 - SLOW) * min(history[:-PATIENCE])

    def _advance(self, here: Visit, program: QuadraticProgram, answer: QPSolution, outlook: Outlook) -> Visit | None:
        """Go where the program says, or farther along what the last steps foretell; None if neither is good."""
        dq = answer.x
        fast = self._memory.propose(dq) if self._measures and outlook.gain <= LAST_STRETCH else None
        if fast is not None:
            fast = np.clip(fast, program.lower, program.upper)
            leap = self._visit(pin.integrate(self.lineariser.state.model, here.at.q, fast))
            if self._judge(here, leap, outlook).by == "measure" and not self._jumps(here, leap):
                self._record(leap, fast, "accelerated")
                return self._take(leap, program, dq, fast)
        there = self._visit(pin.integrate(self.lineariser.state.model, here.at.q, dq))
        verdict = self._judge(here, there, outlook)
        promising = not verdict.accepted and self._promises(here, there)
        if (verdict.accepted or promising) and not self.hasty and self._jumps(here, there):
            verdict, promising = Verdict(False, False, False, "blocked"), False
        self._record(there, dq, "tentative" if promising else verdict.by)
        step = float(np.abs(dq).max(initial=0.0))
        if promising:
            self._anchor = here
            self._memory.forget()
            self._shift = np.zeros_like(self._shift)
            return there
        if not verdict.accepted and self._eager:
            self._eager = self._damping < EAGER_DAMPING[1]
            self._damping = EAGER_DAMPING[1] if self._eager else 0.0
            return None
        if not verdict.accepted:
            self._stretch = 1.0
            self._radius = 0.3 * min(step, self._radius)
            self._damping = max(0.3, 2.0 * self._damping) if verdict.by != "rejected measure" else self._damping
            self._shift = np.zeros_like(self._shift)
            self._memory.forget()
            return None
        if self._eager and there.violation.total > (1.0 - EAGER_GAIN) * here.violation.total:
            self._eager, self._damping = False, 0.0
        if verdict.by == "goal":
            self._memory.forget()
            self._funnel.narrow(here.violation.total, there.violation.total)
        if not self._eager and here.violation.left > self._pull and step < 0.25 * self._radius:
            self._stretch *= 2.0
        if verdict.good:
            if not self._eager:
                self._damping *= 0.3
            if step > 0.5 * self._radius or here.violation.left > PULL * self._radius:
                self._radius = min(2.0 * self._radius, LARGEST_RADIUS)
        elif verdict.poor:
            self._radius = 0.5 * self._radius
        return self._take(there, program, dq, dq)

    def _take(self, there: Visit, program: QuadraticProgram, dq: Array, way: Array) -> Visit:
        """Note that a step was taken.

        What the rows would still lack after the program's own step dq, because the measures pull, is asked for in the
        next one (method of multipliers).
        """
        self._memory.went(way)
        self._anchor = None
        residual = program.rows @ dq - program.target
        self._shift = residual if np.abs(residual).max(initial=0.0) < NEAR_MET else np.zeros_like(residual)
        return there

    def _promises(self, here: Visit, there: Visit) -> bool:
        """Whether a rejected step went well but for curved constraints: one more may put that right (watchdog)."""
        if self._anchor is not None or not self._measures:
            return False
        broken = max(there.violation.elastic, there.violation.hold)
        return there.violation.goal < here.violation.goal and broken < MENDABLE

    def _jumps(self, here: Visit, there: Visit) -> bool:
        return jumps(self.lineariser.workspace, here.placed, there.placed, here.at.q, there.at.q)

    def _visit(self, q: Array) -> Visit:
        within = min(max(LEAST_WITHIN, PULL * self._radius), MOST_WITHIN)
        at = self.lineariser.at(q, within)
        rows = self.subproblem.rows(at)
        if self.offset is not None:
            rows.soft_error[: rows.goals] -= self.offset
        return Visit(at, rows, self.subproblem.violation(rows), Placed(at.contacts, within))

    def _judge(self, here: Visit, there: Visit, outlook: Outlook) -> Verdict:
        """Judge a step, or two if the first one broke a rule: then both together must have been worth it."""
        if self._anchor is not None:
            outlook = outlook._replace(gain=max(0.1 * outlook.gain, 1e-3 * self._anchor.violation.total))
        before = here if self._anchor is None else self._anchor
        return self._funnel.judge(
            (before.violation.total, before.at.measure),
            (there.violation.total, there.at.measure),
            outlook,
            self._measures,
        )

    def _record(self, there: Visit, dq: Array, what: str) -> None:
        note = f"{self.note}: {what}" if self.note else what
        violation = there.violation
        self.trace.append(
            Iterate(
                violation.left,
                max(violation.hold, violation.elastic),
                there.at.measure,
                float(np.abs(dq).max(initial=0.0)),
                note,
            )
        )
        self.control.tell(self.trace[-1])
