"""The Newton method on whole problems: full coordinates, sparse factorisation, least motion."""

from __future__ import annotations

from dataclasses import dataclass

from wholebody.methods.base import UnsupportedTermError, check_problem
from wholebody.methods.conclusion import Ending
from wholebody.methods.control import Control
from wholebody.methods.descents import Descends
from wholebody.methods.newton.multistart import Search, Settings
from wholebody.methods.newton.settings import STARTS
from wholebody.methods.newton.terms import FigureSystem, state_equations
from wholebody.methods.newton.tracking import NewtonTracker
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace


@dataclass(frozen=True)
class Newton(Settings, Descends):
    """Newton's method in full coordinates (Choi and Cremer 1999), for trees and closed loops alike.

    Every body has seven variables, every joint is an equation, and each step is the least motion that satisfies all of
    them. The iteration minimises measures of the revolute joints, your own included, to the accuracy of its
    termination. A measure that depends on the root's position or on other joints is only reported, and the message
    names it. Goals and constraints of your own are taken. If the goals cannot be met, the method minimises their
    squares subject to the constraints.

    The object has only settings and serves any number of problems and threads at the same time.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most Newton iterations.
        algebra: "auto", "normal", "kkt" or "schur".
        inequalities: "slack" (squared slacks) or "barrier" (logarithmic).
        restarts: most seeded starts that are tried if the descent from the start does not solve the problem.
        seed: of the restarts.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None,
            the numbers of iterations end it, and at last twenty seconds of processor time.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> wb.solve(problem, wb.methods.Newton(iterations=100)).status
        'solved'
    """

    longest = STARTS.longest

    @property
    def name(self) -> str:
        """Name for tables."""
        return f"newton/{self.algebra}"

    def accepts(self, problem: Problem) -> str | None:
        """None if all terms and joints have equations here; otherwise the sentence that names the others."""
        check_problem(problem, "Newton.accepts: problem")
        with problem.borrow() as workspace:
            try:
                state_equations(problem, workspace.state)
            except UnsupportedTermError as error:
                return str(error)
        return None

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`."""
        active_system = FigureSystem(problem, workspace, self.algebra)
        active_system.control = control
        search = Search(active_system, self)
        return search.ending(search.everywhere(problem.scene.figure.clamp(problem.start)))

    def tracker(self, problem: Problem, dt: float | None = None) -> NewtonTracker:
        """A tracker of goals that move from call to call; it analyses its equations once.

        Args:
            problem: to be solved.
            dt: seconds a frame, for velocity bounds; None for no velocity bounds.

        Raises:
            InputError: the problem has a term that this method has no equations for, dt is not a positive finite
                number, or the scene changed after the problem was made.
        """
        return NewtonTracker(self, problem, dt)
