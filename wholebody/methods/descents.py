"""Methods whose solve is one search in a workspace: its end becomes a solution, or the next posture of a drag."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any

from wholebody.base.arrays import Array
from wholebody.methods.base import TOLERANCE, FrameStep, SolvingTracker, check_problem
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import LONGEST, Control, Progress
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import Solution


class Descends(ABC):
    """A dataclass of settings with `tolerance` and `time_limit`, and a search that `solve` and `tracker` run.

    In frames of a motion before its end goals are met to `on_the_way` [m, rad], if that is more than the tolerance.
    Without a time limit a solve ends after `longest` seconds of processor time.
    """

    on_the_way = 0.0
    longest = LONGEST
    tolerance: Any
    time_limit: Any

    @property
    @abstractmethod
    def name(self) -> str:
        """Name for tables."""

    @abstractmethod
    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """Search from the problem's start in a workspace on its scene."""

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture. Goals out of reach and starts in penetration are answers, not errors.

        Args:
            problem: to be solved.
            progress: see `wholebody.methods.control.Progress`.

        Raises:
            UnsupportedTermError: the problem has terms that this method cannot take.
            InputError: the scene changed after the problem was made.
        """
        check_problem(problem, f"{type(self).__name__}.solve: problem")
        with Control(self.time_limit, progress, self.longest) as control, problem.borrow() as workspace:
            ending = self._descend(problem, workspace, control)
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)

    def tracker(self, problem: Problem, dt: float) -> SolvingTracker:
        """A tracker that searches anew at every step, from the present posture."""
        return DescentTracker(self, problem, dt)


class DescentTracker(SolvingTracker):
    """Follows by the searches of a method: a frame takes the end of a search, without an assessment or a message."""

    def __init__(self, method: Any, problem: Problem, dt: float) -> None:
        super().__init__(method, problem, dt)
        self._exact, self._rough = method, replace(method, tolerance=max(method.tolerance, method.on_the_way))

    def frame(self, q: Array, tolerance: float | None = None) -> FrameStep:
        """The end of a search from the posture q (nq,); without a tolerance to that of frames on the way."""
        if tolerance is not None:
            TOLERANCE(tolerance, "tolerance")
        method = self._rough if tolerance is None else self._exact
        problem = self._begun(q)
        problem.check_fresh()
        self.workspace.refresh()
        with Control(method.time_limit) as control:
            ending = self.search(method, problem, control)
        return FrameStep(self.bounded(q, ending.q), ending.iterations)

    def search(self, method: Any, problem: Problem, control: Control) -> Ending:
        """The end of the method's search; a tracker may keep what searches share."""
        found: Ending = method._descend(problem, self.workspace, control)
        return found
