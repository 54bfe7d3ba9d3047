"""The QP method: whole solves by sequential quadratic programming, tracking by one program a step."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from wholebody.assessment import Assessment, assess
from wholebody.checks import flag
from wholebody.methods.inputs import BUDGET, ITERATIONS, RESTARTS, SEED, TOLERANCE, check_problem, check_settings
from wholebody.methods.qp.quadratic_program import Array
from wholebody.methods.qp.search import Search, Settings
from wholebody.methods.qp.solvers.base import make_solver
from wholebody.methods.qp.tracking import Step, Tracker
from wholebody.methods.qp.visit import Local
from wholebody.problem import Problem, Solution, Status


@dataclass
class QP:
    """Quadratic programs, solved by a QP solver of your choice.

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
    """

    solver: str = "osqp"
    tolerance: float = 1e-5
    iterations: int = 150
    budget: int = 1000
    restarts: int = 40
    seed: int = 0
    measures: bool = True
    _tracker: Tracker | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such QP solver.
        """
        check_settings(self, tolerance=TOLERANCE, iterations=ITERATIONS, budget=BUDGET, restarts=RESTARTS, seed=SEED)
        flag(self.measures, "measures")
        self._solver = make_solver(self.solver)

    @property
    def name(self) -> str:
        """Name for tables."""
        return f"qp/{self.solver}"

    def solve(self, problem: Problem) -> Solution:
        """Find a posture; the best of a descent, of goals approached in stages, and of seeded starts.

        The later ones are tried only when the earlier ones did not reach the goals, and within the budget. Never
        raises for a goal out of reach or a start in penetration: the status says so.
        """
        check_problem(problem, "QP.solve: problem")
        began = time.perf_counter()
        settings = Settings(self.tolerance, self.iterations, self.budget, self.restarts, self.seed, self.measures)
        search = Search(problem, self._solver, settings)
        best = search.run()
        judgement = assess(problem, best.q)
        status = _status(best, judgement, self.tolerance)
        return Solution(
            q=best.q,
            status=status,
            seconds=time.perf_counter() - began,
            iterations=search.spent,
            assessment=judgement,
            trace=tuple(search.trace),
            method=self.name,
            message=_message(status, judgement, search.how),
        )

    def step(self, problem: Problem, q: Array, dt: float, *, measures: bool = True) -> Step:
        """One step of tracking from the posture q, shape (nq,): one program, for goals that move from call to call.

        The workspace lives on between calls with the same problem. Without `measures` the step only puts right what
        the one before has left of the goals. See `Tracker`.
        """
        flag(measures, "QP.step: measures")
        tracker = self._tracker
        if tracker is None or tracker.problem is not problem or not isinstance(dt, (int, float)) or tracker.dt != dt:
            tracker = self._tracker = Tracker(problem, self._solver, dt)
        return tracker.step(q, measures)


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
