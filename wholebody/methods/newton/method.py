"""The Newton method on whole problems: full coordinates, sparse factorisation, least motion."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.assessment import Assessment, assess
from wholebody.errors import InputError, UnknownNameError
from wholebody.methods.newton.figure_course import FigureCourse
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.linear_algebra.base import Pattern
from wholebody.methods.newton.linear_algebra.choice import NAMES
from wholebody.methods.newton.reaching import Reached, reach
from wholebody.problem import Iterate, Problem, Solution, Status

Array = NDArray[np.float64]

SHARPER = 0.3  # of the tolerance, to which the equations are solved: an assessment adds the rows of a goal up

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
    """

    tolerance: float = 1e-5
    iterations: int = 200
    algebra: str = "auto"
    inequalities: Kind = "slack"
    _course: FigureCourse | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such linear algebra.
        """
        if not 1e-10 <= self.tolerance <= 0.1:
            raise InputError(f"tolerance is {self.tolerance}; give metres from 1e-10 to 0.1")
        if self.iterations < 1:
            raise InputError(f"iterations is {self.iterations}; give 1 or more")
        if self.algebra not in NAMES:
            raise UnknownNameError("linear algebra", self.algebra, NAMES)
        if self.inequalities not in ("slack", "barrier"):
            raise InputError(f"inequalities is {self.inequalities!r}; give 'slack' or 'barrier'")

    @property
    def name(self) -> str:
        """Name for tables."""
        return f"newton/{self.algebra}"

    def solve(self, problem: Problem) -> Solution:
        """Find a posture. Goals out of reach and starts in penetration are answers, not errors.

        Raises:
            InputError: the problem has a term that this method has no equations for.
        """
        return self.follow(problem, problem.scene.figure.clamp(problem.start))

    def follow(self, problem: Problem, q: Array) -> Solution:
        """The same from the posture q (nq,), for goals that move from call to call: what was laid out is kept.

        Raises:
            InputError: the problem has a term that this method has no equations for.
        """
        began = time.perf_counter()
        course = self._prepared(problem)
        found = reach(
            course,
            course.variables(q),
            tolerance=SHARPER * self.tolerance,
            iterations=self.iterations,
            kind=self.inequalities,
        )
        q = course.bodies.posture(found.x)
        judgement = assess(problem, q)
        status = _status(found, judgement, self.tolerance)
        return Solution(
            q=q,
            status=status,
            seconds=time.perf_counter() - began,
            iterations=found.iterations,
            assessment=judgement,
            trace=tuple(Iterate(error, 0.0, 0.0, 0.0) for error in found.residuals),
            method=f"newton/{course.algebra.name}",
            message=_message(status, judgement, found, course) + _reported(course),
        )

    def step(self, problem: Problem, q: Array, tolerance: float = FRAME_TOLERANCE) -> NewtonStep:
        """One frame of a drag: from the posture q (nq,) the least motion that meets the problem's present goals.

        What was laid out for the same problem is kept.

        Raises:
            InputError: the problem has a term that this method has no equations for.
        """
        course = self._prepared(problem)
        course.anchor(q)
        found = reach(
            course,
            course.variables(q),
            tolerance=tolerance,
            iterations=FRAME_ITERATIONS,
            kind=self.inequalities,
        )
        return NewtonStep(course.bodies.posture(found.x), found.iterations, found.systems, course.structures)

    def pattern(self) -> Pattern:
        """Where the Jacobian of the last problem can be other than zero.

        Raises:
            InputError: there was none.
        """
        if self._course is None:
            raise InputError("nothing has been solved yet; call solve(problem) first")
        return self._course.system.pattern

    def _prepared(self, problem: Problem) -> FigureCourse:
        """The equations of the problem with its present goals; laid out anew where they are others."""
        problem.check_fresh()
        course = self._course
        if course is None or course.problem is not problem:
            course = self._course = FigureCourse(problem, self.algebra)
        course.retarget()
        course.anchor(problem.start)
        return course


def _status(found: Reached, judgement: Assessment, tolerance: float) -> Status:
    # the assessment measures with other arithmetic (coal's tolerance is 1e-6 m), so it may find a little more
    slack = 1.05 * tolerance + 1e-6
    if not judgement.holds(slack):
        return "infeasible" if found.stationary else "stalled"
    if judgement.met(slack):
        return "solved"
    return "unreachable" if found.stationary else "stalled"


def _message(status: Status, judgement: Assessment, found: Reached, course: FigureCourse) -> str:
    left = f"{1e3 * judgement.goal_error:.3g} mm and {np.degrees(judgement.goal_angle):.3g} degrees are left"
    if status == "solved":
        return f"solved in {found.iterations} iterations"
    if status == "unreachable":
        return f"not reachable from here: nothing is violated, {left}"
    if status == "stalled":
        return f"ran out of iterations: {left}"
    residual = np.abs(np.where(course.system.inequality, np.minimum(course.system.residual(found.x), 0.0), 0.0))
    residual = np.where(course.system.inequality, residual, np.abs(course.system.residual(found.x)))
    worst = int(np.where(course.system.goal, 0.0, residual).argmax())
    return f"what must hold cannot all hold: {course.system.label(worst)} is missed by {residual[worst]:.3g} m or rad"


def _reported(course: FigureCourse) -> str:
    names = ", ".join(course.reported)
    return f"; {names} is reported, not minimised" if names else ""
