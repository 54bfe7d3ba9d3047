"""Feasibility first: from a start to a feasible posture, by whole Gauss-Newton steps in a box, without measures."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.iterates import Iterate, LocalSolution, Stage
from wholebody.methods.qp.quadratic_program import StepSize
from wholebody.methods.qp.settings import FEASIBILITY, PROGRAM
from wholebody.methods.qp.solvers.base import WorkingSet

SHORTER, LONGER = 0.7, 1.2  # factors of the box after a step back and after a step on


class Feasibility(Stage):
    """One attempt; call `run` once."""

    def run(self, start: Array) -> LocalSolution:
        """Go from a posture within limits, shape (nq,), to a feasible one; else to a stationary one."""
        working_set = WorkingSet(self.shared.solver)
        here, box = self.look(start), FEASIBILITY.step
        last, count, history = np.zeros_like(here.at.lower), 0, list[float]()
        while here.violation.worst > self.tolerance and count < self.iterations and not self.shared.control.over:
            history.append(here.violation.total)
            count += 1
            size = StepSize(box / PROGRAM.box, 0.0, FEASIBILITY.damping, False)
            program = self.shared.subproblem.program(here.at, here.rows, size)
            step = working_set.solve(program, here.rows.key).x
            if float(np.abs(step).max(initial=0.0)) <= self.tolerance**2 or stalls(history, self.tolerance):
                return self.ended(here, True, count)
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

    def look(self, q: Array, longest: float = np.inf) -> Iterate:
        """See `Stage.look`."""
        return self.iterate_at(q, FEASIBILITY.within, longest)


def stalls(history: list[float], tolerance: float) -> bool:
    """Whether the violation, one figure an iteration, has hardly decreased for a while, and far from the tolerance."""
    if len(history) <= FEASIBILITY.patience or history[-1] <= 100.0 * tolerance:
        return False
    before = min(history[: -FEASIBILITY.patience])
    return min(history[-FEASIBILITY.patience :]) > before - min(FEASIBILITY.slow * before, FEASIBILITY.progress)
