"""Sequential quadratic programming from one start to a local solution: docs/theory/qp.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.methods.qp.active_set import parts_of
from wholebody.methods.qp.iterates import Iterate, LocalSolution, PredictedReduction, Stage, Step, StepAcceptance, judge
from wholebody.methods.qp.quadratic_program import Multipliers, QPSolution, QuadraticProgram, StepSize
from wholebody.methods.qp.settings import DESCENT, PROGRAM
from wholebody.methods.qp.solvers.base import WorkingSet
from wholebody.methods.qp.subproblem import lagrangian, multipliers_of
from wholebody.terms.linearisation import Linearisation

LEAST_RADIUS = 1e-7
IN_VAIN = 2.0  # times what a program saves that a descent still may. More: ends later where another minimum is lower.
LAST = 8  # programs that lead back to the constraints where the measures still decrease: from 1e-2 m or rad beside them


@dataclass
class SQP(Stage):
    """One descent; call `run` once."""

    # (goal rows,) subtracted from the goal errors: an intermediate goal before the true one
    offset: Array | None = None
    # whether the measures count from the beginning; without them only the goals are sought, and the first feasible
    # posture is the end
    measures: bool = True
    # whether to ask for the whole goal error in every step, damped by how far they are, until steps are rejected
    # or gain little; else for a piece of it
    full_step: bool = False
    width: float = DESCENT.width  # of the funnel at first
    below: float = np.inf  # measures that are to be undercut: a descent that is not going to ends
    through: bool = False  # whether steps may pass through things

    def __post_init__(self) -> None:
        """Begin with a wide trust region and nothing remembered."""
        self._radius, self._full_step = DESCENT.first_radius, self.full_step
        self._damping = DESCENT.full_step_damping[0] if self.full_step else 0.0
        self._stretch = 1.0  # share of errors asked for: goals that conflict stay far while steps get short
        self._watched: Iterate | None = None  # where to return if a tentative step is not repaired
        self._unimproved = 0  # feasible postures in a row that are hardly better than the best
        self._kept: Iterate | None = None  # best feasible posture
        self._gain = 1.0  # share of its tangential part that a step has
        self._multipliers: Multipliers | None = None  # of the last program near the goals
        self._tension: Array | None = None  # (soft rows,) net multipliers of the last program

    def run(self, start: Array) -> LocalSolution:
        """Descend from a posture within limits, shape (nq,)."""
        here = self._with_planes(self.look(start))
        self._width = max(self.width, here.violation.total)
        self._shift = np.zeros(len(here.rows.soft_error))
        self._working_set = WorkingSet(self.shared.solver)
        self._keep(here)  # a feasible start is an answer, should the descent end early
        count, converged = 0, False
        while count < self.iterations and not self.shared.control.over:
            if not self.measures and here.violation.worst <= self.tolerance:
                converged = self._kept is None
                break
            last = count >= max(self.iterations - LAST, self.iterations / 2)
            if last and self._kept is not None and here.violation.worst > self.tolerance:
                self.measures = False
            count += 1
            size = StepSize(self._radius, 0.0 if self._full_step else self._pull, self._damping, self.measures)
            program = self.shared.subproblem.program(self._bent(here), here.rows, size, self._shift)
            program = self._shortened(program, len(here.rows.soft_error))
            answer = self._working_set.solve(program, here.rows.key)
            step = self._predicted_step(here, program, answer)
            if self._in_vain(here, step):
                break
            swings = self._unimproved >= 4  # the measures, along curved constraints
            if swings or self._radius < LEAST_RADIUS or self._settled(here, step):
                if feasible := self._feasible_before(here):
                    here = self._return_to(feasible)
                    continue
                converged = True
                break
            there = self._advance(here, program, step)
            if there is not None:
                here = there
                self._keep(here)
            elif self._watched is not None:
                here, self._watched = self._watched, None
        here = here if self._watched is None else self._watched
        if self._kept is not None and not self._better_than_kept(here):
            here = self._kept
        return self.ended(here, converged, count)

    def _in_vain(self, here: Iterate, step: Step) -> bool:
        """Whether the measures are not going to be below what is known."""
        free = self._gain == 1.0 and float(np.abs(step.answer).max(initial=0.0)) < self._radius
        return free and step.parts is not None and here.at.measure - IN_VAIN * max(step.saves, 0.0) > self.below

    def _feasible_before(self, here: Iterate) -> Iterate | None:
        """The best feasible posture, if the descent later ended at an infeasible one and may return."""
        # Not with an offset: goals out of reach end at a singular posture, where every descent ends infeasible.
        lost = self.offset is None and here.violation.worst > self.tolerance
        return self._kept if lost and self._width > self.tolerance else None

    def _return_to(self, kept: Iterate) -> Iterate:
        """Continue from a feasible posture with a narrower funnel."""
        self._width *= 0.3  # 0.5 ends at infeasible postures again; 0.1 makes steps along contacts tiny
        self._radius, self._gain, self._damping = DESCENT.first_radius, 1.0, 0.0
        self._shift, self._watched = np.zeros_like(self._shift), None
        return kept

    def _keep(self, here: Iterate) -> None:
        """Remember the best feasible posture: along curved constraints the measures swing near an optimum."""
        if here.violation.worst > self.tolerance or not self.measures:
            return
        worth = (10.0 if here.at.planes is None else 1.0) * self.tolerance * (1.0 + abs(here.at.measure))
        clearly = self._kept is None or self._kept.at.measure - here.at.measure > worth
        self._unimproved = 0 if clearly else self._unimproved + 1
        if self._better_than_kept(here):
            self._kept = here

    def _better_than_kept(self, here: Iterate) -> bool:
        fits = here.violation.worst <= self.tolerance
        return fits and (self._kept is None or self._merit(here) < self._merit(self._kept))

    def _merit(self, here: Iterate) -> float:
        """The measures; near the goals the Lagrangian with the last multipliers, where rows that hold count as zero."""
        if self._multipliers is None:
            return here.at.measure
        beyond = np.maximum(here.rows.elastic_violation, 0.0)
        return lagrangian(self._multipliers, here.at.measure, with_values(here.rows, elastic_violation=beyond))

    def _bent(self, here: Iterate) -> Linearisation:
        """With the positive part of the Lagrangian's Hessian (Nocedal and Wright 2006, 18.1) in the measures."""
        planes = here.at.planes
        if planes is None or self._tension is None or not len(planes.bend) or not self.measures:
            return here.at
        pull = np.maximum(self._tension[self.shared.subproblem.soft_row(planes.bend_row)], 0.0)
        return with_values(here.at, squares=np.vstack([here.at.squares, np.sqrt(pull)[:, None] * planes.bend]))

    def _shortened(self, program: QuadraticProgram, soft: int) -> QuadraticProgram:
        """Scale the curvature of the measures so that the tangential part of the answer is `_gain` times as long."""
        # The joints keep their shares of it; a smaller radius would change them.
        if self._gain == 1.0:
            return program
        weight = program.weight.copy()
        weight[soft:] /= self._gain
        return with_values(program, diagonal=program.diagonal / self._gain, weight=weight)

    @property
    def _pull(self) -> float:
        return PROGRAM.error_clamp * self._radius * self._stretch

    def _predicted_step(self, here: Iterate, program: QuadraticProgram, answer: QPSolution) -> Step:
        """The step of a program with its predicted reduction; near the goals, with its two parts."""
        x, parts, flat, multipliers = answer.x, None, False, None
        if self.measures and here.violation.total <= self.width:
            parts = parts_of(program, answer, self._shift, self._working_set.room(program))
        if parts is None:
            saved = self.shared.subproblem.saving(program, here.rows, x)
        else:
            multipliers = self._multipliers = multipliers_of(program, answer, here.rows, self.shared.subproblem.scale)
            if here.at.planes is not None:
                self._tension = multipliers.net(here.rows)
            saved = self.shared.subproblem.quadratic_part(program, here.rows, parts.tangential)
            if (answer.active.lower | answer.active.upper).any():  # they hold back more than the curvature says
                saved = self.shared.subproblem.saving(program, here.rows, parts.tangential)
                saved -= multipliers.change(program, parts.tangential)
            bent = here.at.planes is not None and len(here.at.planes.bend)
            # share of the tolerance below which a gain counts as none, where its curvature is known
            flat = saved / self._gain <= (1e-2 if bent else 1.0) * self.tolerance * (1.0 + abs(here.at.measure))
            flat = flat and self.shared.subproblem.violation(here.rows, parts.normal).total <= here.violation.total
            x = parts.normal if flat else x  # the residual is met at once, to second order
        violation = self.shared.subproblem.violation(here.rows, x).total
        predicted = PredictedReduction(here.violation.total - violation, saved)
        saves = self.shared.subproblem.saving(program, here.rows, answer.x)
        return Step(x, parts, flat, answer.x, predicted, multipliers, saves)

    def _settled(self, here: Iterate, step: Step) -> bool:
        """Whether the predicted reductions are within the tolerance."""
        violation, predicted = here.violation, step.predicted
        held = max(violation.hold, violation.elastic) <= self.tolerance
        worth = max(
            0.05 * self.tolerance,
            (DESCENT.least_gain if self.measures else DESCENT.least_gain_alone) * violation.total if held else 0.0,
        )
        if violation.worst > self.tolerance and predicted.violation > worth:
            return False
        still = float(np.abs(step.dq).max(initial=0.0)) <= 10.0 * self.tolerance
        if still or not self.measures:
            return True
        if step.flat or predicted.measure / self._gain > 1e-2 * self.tolerance * (1.0 + abs(here.at.measure)):
            return False
        # Where everything holds, all of the step counts: rows that hold it back may not be reached yet.
        return violation.worst > self.tolerance or step.saves <= self.tolerance * (1.0 + abs(here.at.measure))

    def _advance(self, here: Iterate, program: QuadraticProgram, step: Step) -> Iterate | None:
        """Go where the program says; None if that is not accepted."""
        there = self.moved(here, step.dq)
        if there is None:
            self._reject(float(np.abs(step.dq).max(initial=0.0)), "undefined")
            return None
        acceptance = self._judge(here, there, step)
        watched = not acceptance.accepted and self._is_tentative(here, there)
        if (acceptance.accepted or watched) and not self.through and self.jumps(here, there):
            acceptance, watched = StepAcceptance(False, False, False, "blocked"), False
        self.record(there, "tentative" if watched else acceptance.by)
        if watched:
            self._watched = here
            self._shift = np.zeros_like(self._shift)
            return there
        if not acceptance.accepted:
            self._reject(there.longest, acceptance.by)
            return None
        return self._take(here, there, program, step, acceptance)

    def _reject(self, longest: float, by: str) -> None:
        """Shorten the next step after one with this longest entry was rejected."""
        if self._full_step:
            self._full_step = self._damping < DESCENT.full_step_damping[1]
            self._damping = DESCENT.full_step_damping[1] if self._full_step else 0.0
            return
        self._stretch = 1.0
        if by == "rejected measure":
            self._gain *= 0.3
        else:
            self._radius = 0.3 * min(longest, self._radius)
            self._damping = max(0.3, 2.0 * self._damping)
        self._shift = np.zeros_like(self._shift)

    def _take(
        self, here: Iterate, there: Iterate, program: QuadraticProgram, step: Step, acceptance: StepAcceptance
    ) -> Iterate:
        """Accept a step, and adapt the radius and the share of the next."""
        # The residual that the measures cause is asked for in the next one (method of multipliers).
        if self._full_step and there.violation.total > (1.0 - DESCENT.full_step_gain) * here.violation.total:
            self._full_step, self._damping = False, 0.0
        if not self._full_step and here.violation.left > self._pull and there.longest < 0.25 * self._radius:
            self._stretch *= 2.0
        if acceptance.good:
            self._gain = min(1.0, 2.0 * self._gain)
            if not self._full_step:
                self._damping *= 0.3
            if there.longest > 0.5 * self._radius or here.violation.left > PROGRAM.error_clamp * self._radius:
                self._radius = min(2.0 * self._radius, DESCENT.largest_radius)
        elif acceptance.poor and acceptance.by == "measure":
            self._gain *= 0.5
        elif acceptance.poor:
            self._radius = 0.5 * self._radius
        self._watched = None
        asked = len(self._shift)
        residual = program.rows[:asked] @ step.answer - program.target[:asked]
        self._shift = residual if np.abs(residual).max(initial=0.0) < DESCENT.near_met else np.zeros_like(residual)
        return self._with_planes(there)

    def _with_planes(self, there: Iterate) -> Iterate:
        """A posture that is taken, with the planes of its terms."""
        if there.at.planes is not None or self.offset is not None:
            return there
        at = self.shared.lineariser.with_planes(there.at)
        return there if at.planes is None else with_values(there, at=at, rows=self.shared.subproblem.rows(at))

    def look(self, q: Array, longest: float = np.inf) -> Iterate:
        """See `Stage.look`."""
        seen = min(PROGRAM.error_clamp * self._radius, DESCENT.within_step * longest, DESCENT.most_within)
        # Only measures need planes to judge a step: violations do not count them, and one that is rejected has none.
        planes = self.measures and self.offset is None
        there = self.iterate_at(q, max(DESCENT.least_within, seen), longest, planes=planes)
        if self.offset is None:
            return there
        there.rows.soft_error[: there.rows.goals] -= self.offset
        return with_values(there, violation=self.shared.subproblem.violation(there.rows))

    def _is_tentative(self, here: Iterate, there: Iterate) -> bool:
        """Whether a rejected step reduced the goal errors and violates constraints little (watchdog)."""
        if self._watched is not None or not self.measures:
            return False
        broken = max(there.violation.elastic, there.violation.hold)
        return there.violation.goal < here.violation.goal and broken < DESCENT.restorable

    def _judge(self, here: Iterate, there: Iterate, step: Step) -> StepAcceptance:
        """Judge a step, or two if the first one was tentative: then both together must be acceptable."""
        predicted, before = step.predicted, here
        if self._watched is not None:
            before = self._watched
            least = max(0.1 * predicted.violation, 1e-3 * before.violation.total)
            predicted = with_values(predicted, violation=least)
        measures = [
            one.at.measure if step.multipliers is None else lagrangian(step.multipliers, one.at.measure, one.rows)
            for one in (before, there)
        ]
        values = (before.violation.total, measures[0]), (there.violation.total, measures[1])
        return judge(*values, predicted, self._width if self.measures else None)
