"""The QP method: whole solves by sequential quadratic programming, tracking by one program a step."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from wholebody.assessment import Assessment, assess
from wholebody.errors import InputError
from wholebody.methods.qp.descent import Descent, Local
from wholebody.methods.qp.quadratic_program import Array
from wholebody.methods.qp.solvers.base import make_solver
from wholebody.methods.qp.starts import bent, restarts
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.methods.qp.tracking import Step, Tracker
from wholebody.problem import Iterate, Problem, Solution, Status

STAGES = (0.25, 0.5, 0.75)  # of the way to the goals, when the straight attempt ends in a local minimum
LEAST_TOLERANCE = 1e-10


@dataclass
class QP:
    """Quadratic programs, solved by a QP solver of your choice.

    Attributes:
        solver: "osqp", "daqp" or any name that qpsolvers lists on this machine; see `wholebody doctor`.
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most programs for one descent.
        budget: seconds that continuation and restarts may add when the first descent does not reach the goals.
        restarts: most seeded starts that are tried after continuation.
        seed: of the restarts.
    """

    solver: str = "osqp"
    tolerance: float = 1e-5
    iterations: int = 150
    budget: float = 1.0
    restarts: int = 6
    seed: int = 0
    _trackers: dict[int, Tracker] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such QP solver.
        """
        if not LEAST_TOLERANCE <= self.tolerance <= 0.1:
            raise InputError(f"tolerance is {self.tolerance}; give metres from {LEAST_TOLERANCE} to 0.1")
        if self.iterations < 1 or self.restarts < 0 or not self.budget >= 0.0:
            raise InputError("iterations are at least 1, restarts and budget at least 0")
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
        began = time.perf_counter()
        search = _Search(self, problem, began)
        search.run()
        search.settle()
        best = search.best
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

    def step(self, problem: Problem, q: Array, dt: float) -> Step:
        """One step of tracking from the posture q, shape (nq,): one program, for goals that move from call to call.

        The workspace lives on between calls with the same problem. See `Tracker`.
        """
        tracker = self._trackers.get(id(problem))
        if tracker is None or tracker.problem is not problem or tracker.dt != dt:
            tracker = Tracker(problem, self._solver, dt)
            self._trackers = {id(problem): tracker}
        return tracker.step(q)


class _Search:
    """Descent, continuation and restarts for one problem, remembering the best posture."""

    def __init__(self, method: QP, problem: Problem, began: float) -> None:
        self.method, self.problem = method, problem
        self.deadline = began + method.budget
        self.subproblem = Subproblem(problem)
        self.lineariser = problem.lineariser()
        self.trace: list[Iterate] = []
        self.spent = 0
        self.how = "directly"
        self._best: Local | None = None

    @property
    def best(self) -> Local:
        """The best posture so far."""
        assert self._best is not None
        return self._best

    def run(self) -> None:
        """Try one way after the other until the goals are met."""
        start = self.problem.scene.figure.clamp(self.problem.start)
        if self._accept(self._descend(start, np.inf, None, ""), "directly"):
            return
        ways = chain(self._bent(start), self._staged(start), self._restarted(start))
        for local, how in ways:
            if self._accept(local, how) or time.perf_counter() > self.deadline:
                return

    def _bent(self, start: Array) -> Iterator[tuple[Local, str]]:
        """Straight limbs hide what bending them would do: the same descent with joints moved off their limits."""
        q = bent(self.problem, start)
        if q is not None:
            yield self._descend(q, self.deadline, None, "bent"), "from a start with bent joints"

    def _staged(self, start: Array) -> Iterator[tuple[Local, str]]:
        """Goals approached through intermediate ones: the errors at the start, shrinking to nothing."""
        if not self.problem.goals:
            return
        whole, q = self._goal_errors(start), start
        for share in STAGES:
            q = self._descend(q, self.deadline, (1.0 - share) * whole, "stage").q
        yield self._descend(q, self.deadline, None, "stage"), "in stages"

    def _restarted(self, start: Array) -> Iterator[tuple[Local, str]]:
        """Seeded postures to begin from."""
        rng = np.random.default_rng(self.method.seed)
        for q in restarts(self.problem, start, rng, self.method.restarts):
            yield self._descend(q, self.deadline, None, "restart"), "from another start"

    def settle(self) -> None:
        """Where the goals are not reached, come as near as goes, then improve the measures from there."""
        if self.best.violation.left <= self.method.tolerance:
            return
        deadline = time.perf_counter() + self.method.budget
        self._accept(self._descend(self.best.q, deadline, None, "nearest", measures=False), self.how)
        best = self.best
        if best.violation.left > self.method.tolerance and self.problem.measures:
            local = self._stay(best)
            if (
                _held(local, self.method.tolerance)
                and local.violation.left <= best.violation.left + self.method.tolerance
            ):
                self._best = local

    def _stay(self, local: Local) -> Local:
        """Descend with the goals' errors to stay as they are: what must hold is mended, then the measures improve."""
        nearest = self._goal_errors(local.q)
        deadline = time.perf_counter() + self.method.budget
        stayed = self._descent(deadline, nearest, "nearest").run(local.q)
        self.spent += stayed.iterations
        left = float(np.linalg.norm(self._goal_errors(stayed.q)))
        violation = stayed.violation._replace(goal=left, left=left)
        return stayed._replace(violation=violation, converged=local.converged)

    def _goal_errors(self, q: Array) -> Array:
        state = self.lineariser.state.update(q)
        return np.concatenate([np.zeros(0), *(np.atleast_1d(goal.error(state)) for goal in self.problem.goals)])

    def _descend(
        self, start: Array, deadline: float, offset: Array | None, note: str, *, measures: bool = True
    ) -> Local:
        """Descend from a start; where that ends with something that must hold not holding, mend it."""
        local = self._descent(deadline, offset, note, measures=measures).run(start)
        self.spent += local.iterations
        if not _held(local, self.method.tolerance) and offset is None and time.perf_counter() < deadline:
            local = min(local, self._stay(local), key=lambda one: _rank(one, self.method.tolerance))
        return local

    def _descent(self, deadline: float, offset: Array | None, note: str, *, measures: bool = True) -> Descent:
        return Descent(
            self.subproblem, self.lineariser, self.method._solver, self.method.tolerance,
            self.method.iterations, deadline, offset, self.trace, note, measures,
        )  # fmt: skip

    def _accept(self, local: Local, how: str) -> bool:
        """Keep the better one; whether what is asked holds now."""
        if self._best is None or _rank(local, self.method.tolerance) < _rank(self._best, self.method.tolerance):
            self._best, self.how = local, how
        return self.best.violation.worst <= self.method.tolerance


def _held(local: Local, tolerance: float) -> bool:
    return max(local.violation.hold, local.violation.elastic) <= tolerance


def _rank(local: Local, tolerance: float) -> tuple[float, float, float]:
    """Smaller is better: what must hold, then goals, then measures."""
    held = max(local.violation.hold, local.violation.elastic)
    return (
        held if held > tolerance else 0.0,
        local.violation.goal if local.violation.left > tolerance else 0.0,
        local.measure,
    )


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
        return f"ran out of iterations or time: {left}"
    worst = max(
        ("a clearance", judgement.clearance_lack),
        ("a constraint", judgement.constraint_violation),
        ("a joint limit", judgement.limit_violation),
        key=lambda item: item[1],
    )
    return f"what must hold cannot all hold: {worst[0]} is missed by {worst[1]:.3g} m or rad"
