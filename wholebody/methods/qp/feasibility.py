"""Feasibility first: from a start to a feasible posture, by whole Gauss-Newton steps in a box, without measures."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.methods.qp.iterates import Iterate, LocalSolution, Stage
from wholebody.methods.qp.quadratic_program import QuadraticProgram, StepSize
from wholebody.methods.qp.settings import FEASIBILITY, PROGRAM
from wholebody.methods.qp.solvers.base import WorkingSet

SHORTER, LONGER = 0.7, 1.2  # factors of the box after a step back and after a step on
AT_LIMIT = 1e-6  # rad


@dataclass
class Feasibility(Stage):
    """One attempt; call `run` once."""

    figure: Figure = field(kw_only=True)

    def run(self, start: Array) -> LocalSolution:
        """Go from a posture within limits, shape (nq,), to a feasible one; else to a stationary one."""
        working_set = WorkingSet(self.shared.solver)
        here, box, last = self.look(start), FEASIBILITY.step, np.zeros(self.figure.model.nv)
        count, history, wrapped = 0, list[float](), set[int]()
        while here.violation.worst > self.tolerance and count < self.iterations and not self.shared.control.over:
            history.append(here.violation.total)
            count += 1
            size = StepSize(box / PROGRAM.box, 0.0, FEASIBILITY.damping, False)
            program = self.shared.subproblem.program(here.at, here.rows, size)
            step = working_set.solve(program, here.rows.key).x
            if float(np.abs(step).max(initial=0.0)) <= self.tolerance**2 or stalls(history, self.tolerance):
                turned = self._turned_on(here, program, step, wrapped)
                there = None if turned is None else self.moved(here, turned)
                if there is None:
                    return self.ended(here, True, count)
                here, history, box, last = there, [], FEASIBILITY.step, np.zeros_like(step)
                working_set.reset()
                self.record(here, "turned on")
                continue
            back, last = float(step @ last) < 0.0, step
            box = max(SHORTER * box, FEASIBILITY.least_step) if back else min(LONGER * box, FEASIBILITY.step)
            there = self.moved(here, step)
            if there is None:
                if box < FEASIBILITY.least_step:
                    return self.ended(here, False, count)
                # after a step to where a term of one's own is not finite
                box, last = 0.3 * min(box, float(np.abs(step).max())), np.zeros_like(step)
                continue
            here = there
            self.record(here, "goal")
        return self.ended(here, here.violation.worst <= self.tolerance, count)

    def _turned_on(self, here: Iterate, program: QuadraticProgram, step: Array, wrapped: set[int]) -> Array | None:
        """Displacement (nv,) to its other limit of the joint pressed hardest at a limit, once each; None if none."""
        limits, q, model = self.figure.limits, here.at.q, self.figure.model
        turning = [joint.idx_v for joint in model.joints if joint.shortname().startswith("JointModelR")]
        pushed = program.gradient(step)[limits.idx_v]
        after = q[limits.idx_q] + step[limits.idx_v]
        high = (pushed < 0.0) & (after > limits.upper - AT_LIMIT)
        low = (pushed > 0.0) & (after < limits.lower + AT_LIMIT)
        move = np.where(high, limits.lower, limits.upper) - q[limits.idx_q]
        allowed = (move >= here.at.lower[limits.idx_v] - AT_LIMIT) & (move <= here.at.upper[limits.idx_v] + AT_LIMIT)
        range_ = limits.upper - limits.lower
        wide = (range_ > FEASIBILITY.wide) & (range_ < 2.0 * np.pi) & np.isin(limits.idx_v, turning)
        for index in np.argsort(-np.abs(pushed)).tolist():
            if ((high | low) & allowed & wide)[index] and index not in wrapped:
                wrapped.add(index)
                displacement = np.zeros(len(step))
                displacement[limits.idx_v[index]] = move[index]
                return displacement
        return None

    def look(self, q: Array, longest: float = np.inf) -> Iterate:
        """See `Stage.look`."""
        return self.iterate_at(q, FEASIBILITY.within, longest)


def stalls(history: list[float], tolerance: float) -> bool:
    """Whether the violation, one figure an iteration, has hardly decreased for a while, and far from the tolerance."""
    if len(history) <= FEASIBILITY.patience or history[-1] <= 100.0 * tolerance:
        return False
    before = min(history[: -FEASIBILITY.patience])
    return min(history[-FEASIBILITY.patience :]) > before - min(FEASIBILITY.slow * before, FEASIBILITY.progress)
