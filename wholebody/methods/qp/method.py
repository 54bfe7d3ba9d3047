"""The QP method: whole solves by sequential quadratic programming, tracking by one program a step."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from wholebody.assessment import Assessment, assess
from wholebody.checks import flag
from wholebody.methods.contradictions import in_words, proven
from wholebody.methods.control import Control, Progress, check_time_limit
from wholebody.methods.inputs import BUDGET, ITERATIONS, RESTARTS, SEED, TOLERANCE, check_problem, check_settings
from wholebody.methods.qp.search import Search, Settings
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.registry import make_solver
from wholebody.methods.qp.tracking import Tracker
from wholebody.methods.qp.visit import Local
from wholebody.problem import Problem
from wholebody.solution import Solution, Status


@dataclass(frozen=True)
class QP:
    """Quadratic programs, solved by a QP solver of your choice.

    These are settings alone: one object serves any number of problems and threads at the same time.

    Attributes:
        solver: "osqp", "daqp" or any name that qpsolvers lists on this machine; see `wholebody doctor`.
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most programs for one descent.
        budget: most programs that continuation and restarts may add when the first descent does not reach the goals;
            a program takes about a millisecond.
        restarts: most seeded starts that are tried.
        seed: of the restarts.
        measures: whether the measures are to be least. Without, the first posture is the answer that meets the goals
            with everything held, which is there in a fifth to nine tenths of the time. This is for `solve`.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None, it
            ends after four seconds of processor time.
    """

    solver: str = "osqp"
    tolerance: float = 1e-5
    iterations: int = 150
    budget: int = 1000
    restarts: int = 40
    seed: int = 0
    measures: bool = True
    time_limit: float | None = None

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such QP solver.
        """
        check_settings(self, tolerance=TOLERANCE, iterations=ITERATIONS, budget=BUDGET, restarts=RESTARTS, seed=SEED)
        flag(self.measures, "measures")
        check_time_limit(self.time_limit)
        make_solver(self.solver)

    @property
    def name(self) -> str:
        """Name for tables."""
        return f"qp/{self.solver}"

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture; the best of a descent, of goals approached in stages, and of seeded starts.

        The later ones are tried only when the earlier ones did not reach the goals, and within the budget. Never
        raises for a goal out of reach or a start in penetration: the status says so.

        Args:
            problem: what is asked.
            progress: see `wholebody.methods.control.Progress`.

        Raises:
            InputError: the scene changed after the problem was stated.
        """
        check_problem(problem, "QP.solve: problem")
        began = time.perf_counter()
        settings = Settings(self.tolerance, self.iterations, self.budget, self.restarts, self.seed, self.measures)
        with problem.lend() as workspace, Control(self.time_limit, progress) as control:
            search = Search(problem, workspace, self._qp_solver(), settings, control)
            best = search.run()
        judgement = assess(problem, best.q)
        status = _status(best, judgement, self.tolerance)
        status = proven(status, search.contradictions)
        said = in_words(search.contradictions) or control.message(judgement) or _message(status, judgement, search.how)
        return Solution(
            q=best.q,
            status=status,
            seconds=time.perf_counter() - began,
            iterations=search.spent,
            assessment=judgement,
            trace=tuple(search.trace),
            method=self.name,
            message=said + judgement.in_the_way,
        )

    def _qp_solver(self) -> QPSolver:
        """A QP solver of the name in the settings, for one run."""
        return make_solver(self.solver)

    def tracker(self, problem: Problem, dt: float) -> Tracker:
        """What follows the goals of a problem that move from call to call: one program a step of `dt` seconds.

        Raises:
            InputError: dt is not a positive finite number, or the scene changed after the problem was stated.
        """
        return Tracker(problem, self._qp_solver(), dt)


def _status(local: Local, judgement: Assessment, tolerance: float) -> Status:
    # the assessment measures with other arithmetic (coal's tolerance is 1e-6 m), so it may find a little more
    slack = 1.05 * tolerance + 1e-6
    if not judgement.holds(slack):
        return "infeasible" if local.converged else "stalled"
    if judgement.met(slack):
        return "solved"
    return "unreachable" if local.converged else "stalled"


def _message(status: Status, judgement: Assessment, how: str) -> str:
    left = f"{1e3 * judgement.goal_error:.3g} mm and {np.degrees(judgement.goal_angle):.3g} degrees are left"
    if status == "solved":
        return f"solved {how}"
    if status == "unreachable":
        return f"not reachable from here: nothing is violated, {left}"
    if status == "stalled":
        return f"ran out of iterations: {left}"
    worst = max(
        ("a clearance", judgement.clearance_lack),
        ("a constraint", judgement.constraint_violation),
        ("a joint limit", judgement.limit_violation),
        key=lambda item: item[1],
    )
    return f"what must hold cannot all hold: {worst[0]} is missed by {worst[1]:.3g} m or rad"
