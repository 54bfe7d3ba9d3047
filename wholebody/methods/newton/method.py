"""The Newton method on whole problems: full coordinates, sparse factorisation, least motion.

Its tracker keeps the equations and their analysis from frame to frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import posture
from wholebody.base.pool import OneAtATime
from wholebody.geometry.continuous.passing_through import SHORT
from wholebody.methods.base import TOLERANCE, FrameStep, SolvingTracker
from wholebody.methods.conclusion import Descends, Ending, concluded
from wholebody.methods.control import BUDGET, Control
from wholebody.methods.newton.feasibility import FeasibilityResult, satisfy
from wholebody.methods.newton.multistart import NewtonMultistart, Settings
from wholebody.methods.newton.settings import FRAMES, STARTS
from wholebody.methods.newton.terms import FigureSystem, state_equations
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import Solution
from wholebody.tasks import StepLimit


@dataclass(frozen=True)
class Newton(Settings, Descends):
    """Newton's method in full coordinates (Choi and Cremer 1999), for trees and closed loops alike.

    Every body has seven variables, every joint is an equation, and each step is the least motion that satisfies all of
    them. The iteration minimises measures, your own included, to the accuracy of its termination. Goals and
    constraints of your own are taken. If the goals cannot be met, the method minimises their squares subject to the
    constraints.

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

    def _check_terms(self, problem: Problem) -> None:
        with problem.borrow() as workspace:
            state_equations(problem, workspace.state)

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`."""
        active_system = FigureSystem(problem, workspace, self.algebra)
        active_system.control = control
        return NewtonMultistart(active_system, self).everywhere(problem.scene.figure.clamp(problem.start))

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


class NewtonTracker(SolvingTracker):
    """Follows the goals of one problem, frame by frame.

    Goals, other terms and clearances of the problem may be replaced between calls, and things may be moved. A tracker
    remembers the previous frame, so it serves one motion and one thread at a time.
    """

    unswept = SHORT  # every iteration of a frame was tested
    leaves_overlap = True

    def __init__(self, method: Any, problem: Problem, dt: float | None) -> None:
        """Build the equations for a method that is its `Settings`. Where dt is None, speeds are not bounded."""
        super().__init__(method, problem, 1.0 if dt is None else dt)
        self._settings: Settings = method
        self._bounded = dt is not None
        self._alone = OneAtATime("tracker")
        self._lay_out()

    def frame(self, q: Array, tolerance: float | None = None) -> FrameStep:
        """One frame of a drag: from the posture q (nq,) the least motion that meets the problem's present goals.

        Weights count where goals conflict. So all goals are first followed alike; the frame is made again with their
        weights if that reduced light goals at the expense of heavy ones.

        Raises:
            InputError: objects were added to or removed from the scene, a new term has no equations, or another thread
                is within a call of this tracker.
        """
        q = posture(q, self.workspace.model.nq)
        enough = FRAMES.tolerance if tolerance is None else TOLERANCE(tolerance, "tolerance")
        with self._alone:
            active_system = self._renewed()
            active_system.objective.anchor(q)
            if self._bounded and any(isinstance(bound, StepLimit) for bound in self.problem.bounds):
                state = self.workspace.state.update(q)
                ranges = np.array([bound.bounds(state, self.dt) for bound in self.problem.bounds])
                active_system.bodies.step = q, ranges[:, 0].max(axis=0), ranges[:, 1].min(axis=0)
            found, spent = None, 0
            if len({goal.weight for goal in self.problem.goals}) > 1:
                found = self._satisfied(active_system, q, enough, even=True)
                spent = found.iterations
            if found is None or (not found.met and self._trades(q, active_system.posture(found.x))):
                found = self._satisfied(active_system, q, enough, even=False)
                spent += found.iterations
            # where the time of a frame was not enough to restore the constraints, the next goes on from here
            cut = BUDGET.over and not found.hard <= FRAMES.tolerance
            end = q if cut else active_system.posture(found.x)
            return FrameStep(end, spent)

    @property
    def structures(self) -> int:
        """Number of patterns that were analysed."""
        return self._active_system.structures

    def _satisfied(self, active_system: FigureSystem, q: Array, enough: float, even: bool) -> FeasibilityResult:
        """The end of the iteration from the posture q (nq,); goals count alike if `even`."""
        active_system.even = even
        try:
            return satisfy(
                active_system,
                active_system.variables(q),
                tolerance=STARTS.sharper * self._settings.tolerance,
                goal_tolerance=enough,
                iterations=FRAMES.iterations,
                kind=self._settings.inequalities,
                early_exit=True,
            )
        finally:
            active_system.even = False

    def _trades(self, before: Array, after: Array) -> bool:
        """Whether goals of small weight improved at the expense of goals of large weight between two postures (nq,)."""
        # True if the weighted error fell relatively by less than half as much as the unweighted error, or neither fell:
        # goals that pull alike against each other do not move.
        goals = self.problem.goals
        weights = np.sqrt([goal.weight for goal in goals])
        errors = []
        for q in (before, after):
            state = self.workspace.state.update(q)
            errors.append(np.array([np.linalg.norm(goal.error(state)) for goal in goals]))
        even, weighted = (np.linalg.norm(by * errors[1]) / np.linalg.norm(by * errors[0]) for by in (1.0, weights))
        return bool(1.0 - weighted <= 0.5 * (1.0 - even) + 1e-6)

    def solve(self, q: Array) -> Solution:
        """Solve for the problem's present goals from the posture q (nq,), without other starts."""
        q = posture(q, self.workspace.model.nq)
        with self._alone:
            active_system = self._renewed()
            active_system.control = control = Control(np.inf)
            ending = NewtonMultistart(active_system, self._settings).from_here(q)
        tolerance = self._settings.tolerance
        return concluded(self.problem, ending, method=self._method.name, tolerance=tolerance, control=control)

    def _lay_out(self) -> None:
        problem = self.problem
        self._active_system = FigureSystem(problem, self.workspace, self._settings.algebra)
        self._terms = (problem.constraints, problem.bounds, problem.measures)

    def _renewed(self) -> FigureSystem:
        """The equations of the problem with its present goals; built anew if other terms were replaced."""
        problem = self.problem
        problem.check_fresh()
        self.workspace.refresh()
        now = (problem.constraints, problem.bounds, problem.measures)
        if any(new is not old for new, old in zip(now, self._terms, strict=True)):
            self._lay_out()
        self._active_system.retarget()
        self._active_system.objective.follow()
        self._active_system.bodies.step = None
        return self._active_system
