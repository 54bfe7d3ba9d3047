"""The Newton method on whole problems: full coordinates, sparse factorisation, least motion."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody import checks
from wholebody.errors import InputError
from wholebody.methods.inputs import ITERATIONS, RESTARTS, SEED, TOLERANCE, check_problem, check_settings
from wholebody.methods.newton.figure_course import FigureCourse
from wholebody.methods.newton.inequalities import KINDS, Kind
from wholebody.methods.newton.linear_algebra.base import Pattern
from wholebody.methods.newton.linear_algebra.choice import NAMES
from wholebody.methods.newton.reaching import reach
from wholebody.methods.newton.search import SHARPER, Found, Search, Settings
from wholebody.problem import Iterate, Problem, Solution, Status
from wholebody.tasks import StepLimit

Array = NDArray[np.float64]

FRAME_TOLERANCE = 1e-4  # m, rad: on the way of a drag; its end is solved to the method's own
FRAME_ITERATIONS = 12  # most of one frame; a goal that asks for more is followed over the next frames


class NewtonStep(NamedTuple):
    """Answer of one frame.

    Attributes:
        q: (nq,) the next posture.
        iterations: Newton iterations.
        systems: linear systems solved.
        structures: how often the pattern has been laid out since the problem was first seen.
    """

    q: Array
    iterations: int
    systems: int
    structures: int


@dataclass
class Newton:
    """Newton's method in full coordinates (Choi and Cremer 1999), for trees and closed loops alike.

    Every body has seven variables, every joint is an equation, and each step is the least motion that meets all of
    them. `Effort` is minimised on the way, up to what the stopping of the iteration leaves; other measures are reported
    only, and the solution's message says so. Where the goals cannot be met, their least squares are sought with
    everything else held.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most Newton iterations.
        algebra: "auto", "normal", "llt", "kkt", "schur", "dense" or "svd".
        inequalities: "slack" (squared slacks) or "barrier" (logarithmic).
        restarts: most seeded starts that are tried where the straight way does not serve.
        seed: of the restarts.
    """

    tolerance: float = 1e-5
    iterations: int = 200
    algebra: str = "auto"
    inequalities: Kind = "slack"
    restarts: int = 6
    seed: int = 0
    _course: FigureCourse | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such linear algebra.
        """
        check_settings(self, tolerance=TOLERANCE, iterations=ITERATIONS, restarts=RESTARTS, seed=SEED)
        checks.known(self.algebra, NAMES, "linear algebra")
        checks.choice(self.inequalities, KINDS, "inequalities")

    @property
    def name(self) -> str:
        """Name for tables."""
        return f"newton/{self.algebra}"

    def solve(self, problem: Problem) -> Solution:
        """Find a posture. Goals out of reach and starts in penetration are answers, not errors.

        Raises:
            InputError: the problem has a term that this method has no equations for.
        """
        began = time.perf_counter()
        search = Search(self._prepared(problem), self._settings())
        found = search.everywhere(problem.scene.figure.clamp(problem.start))
        return self._answer(search, found, began)

    def follow(self, problem: Problem, q: Array) -> Solution:
        """The straight way from the posture q (nq,), for goals that move from call to call.

        What was laid out is kept, and no other starts are tried.

        Raises:
            InputError: the problem has a term that this method has no equations for.
        """
        began = time.perf_counter()
        search = Search(self._prepared(problem), self._settings())
        q = checks.posture(q, problem.scene.model.nq)
        return self._answer(search, search.from_here(q), began)

    def step(
        self, problem: Problem, q: Array, tolerance: float = FRAME_TOLERANCE, dt: float | None = None
    ) -> NewtonStep:
        """One frame of a drag: from the posture q (nq,) the least motion that meets the problem's present goals.

        What was laid out for the same problem is kept.

        Args:
            problem: what is asked.
            q: where the frame begins.
            tolerance: of the goals, metres and radians.
            dt: seconds of the frame, for bounds on speeds; none hold where it is None.

        Raises:
            InputError: the problem has a term that this method has no equations for.
        """
        course, q = self._prepared(problem), checks.posture(q, problem.scene.model.nq)
        tolerance = checks.number(tolerance, "tolerance", TOLERANCE.low, TOLERANCE.high)
        if dt is not None:
            checks.time_step(dt, "dt")
        course.objective.anchor(q)
        if dt is not None and any(isinstance(bound, StepLimit) for bound in problem.bounds):
            state = problem.scene.state(q)
            ranges = np.array([bound.bounds(state, dt) for bound in problem.bounds])
            course.bodies.bound_step(q, ranges[:, 0].max(axis=0), ranges[:, 1].min(axis=0))
        found = reach(
            course,
            course.variables(q),
            tolerance=SHARPER * self.tolerance,
            goal_tolerance=tolerance,
            iterations=FRAME_ITERATIONS,
            kind=self.inequalities,
            hurried=True,
        )
        return NewtonStep(course.posture(found.x), found.iterations, found.systems, course.structures)

    def pattern(self) -> Pattern:
        """Where the Jacobian of the last problem can be other than zero.

        Raises:
            InputError: there was none.
        """
        if self._course is None:
            raise InputError("nothing has been solved yet; call solve(problem) first")
        return self._course.system.pattern

    def laid_out(self) -> tuple[int, float]:
        """How many patterns the last problem needed, and the processor's time to lay them out and analyse them [s]."""
        return (0, 0.0) if self._course is None else (self._course.structures, self._course.laying)

    def _settings(self) -> Settings:
        return Settings(self.tolerance, self.iterations, self.restarts, self.seed, self.inequalities)

    def _prepared(self, problem: Problem) -> FigureCourse:
        """The equations of the problem with its present goals; laid out anew where they are others."""
        check_problem(problem, "Newton: problem")
        problem.check_fresh()
        course = self._course
        if course is None or course.problem is not problem:
            course = self._course = FigureCourse(problem, self.algebra)
        course.retarget()
        course.objective.follow()
        course.bodies.free_step()
        return course

    def _answer(self, search: Search, found: Found, began: float) -> Solution:
        course, judgement = search.course, found.judgement
        status = _status(found, search.settings)
        return Solution(
            q=found.q,
            status=status,
            seconds=time.perf_counter() - began,
            iterations=search.iterations,
            assessment=judgement,
            trace=tuple(Iterate(error, 0.0, 0.0, 0.0) for error in search.residuals),
            method=f"newton/{course.algebra.name}",
            message=_message(status, found, search) + _reported(course),
        )


def _status(found: Found, settings: Settings) -> Status:
    if not found.judgement.holds(settings.counted):
        return "infeasible" if found.reached.stationary else "stalled"
    if found.judgement.met(settings.counted):
        return "solved"
    return "unreachable" if found.reached.stationary else "stalled"


def _message(status: Status, found: Found, search: Search) -> str:
    judgement = found.judgement
    left = f"{1e3 * judgement.goal_error:.3g} mm and {np.degrees(judgement.goal_angle):.3g} degrees are left"
    if status == "solved":
        return f"solved in {search.iterations} iterations{found.how}"
    if status == "unreachable":
        return f"not reachable from here: nothing is violated, {left}"
    if judgement.holds(search.settings.counted):
        return f"ran out of iterations: {left}"
    name, missed = _worst(search.course.problem, found)
    why = "what must hold cannot all hold" if status == "infeasible" else "ran out of iterations"
    return f"{why}: {name} is missed by {missed:.3g} m or rad"


def _worst(problem: Problem, found: Found) -> tuple[str, float]:
    """What is farthest from holding, and by how much."""
    state = problem.scene.state(found.q)
    worst = ("the clearance of a pair", max(found.judgement.clearance_lack, found.judgement.penetration))
    for number, term in enumerate(problem.constraints):
        value = np.atleast_1d(term.value(state))
        missed = float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0))
        if missed > worst[1]:
            worst = (f"constraints[{number}], {type(term).__name__}", missed)
    return worst


def _reported(course: FigureCourse) -> str:
    names = ", ".join(course.objective.reported)
    return f"; {names} is reported, not minimised" if names else ""
