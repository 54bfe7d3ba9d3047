"""Solutions near the posture at hand, whose way from it is free: what motions are made of, with any method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wholebody.assessment import assess
from wholebody.geometry.continuous.moved_pairs import Placed
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.ccd.method import CCD
from wholebody.methods.moving_goals import begun_at
from wholebody.methods.newton.method import Newton
from wholebody.methods.newton.tracking import NewtonTracker
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import Method, as_method
from wholebody.problem import Problem
from wholebody.solution import Solution

Array = NDArray[np.float64]

AT_THE_END = 1e-5  # m, rad
WITHIN = 0.06  # m: pairs nearer than this are measured when a way is judged; larger = dearer, fewer left to a sweep
PASSING = 1e-3  # m: a solution whose way goes in deeper gives way to a nearer one


def for_motions(method: str | Method) -> Method:
    """A method for motions: given by name, it is set for 1e-5 and not to restart; a configured one is taken as it is.

    Raises:
        UnknownNameError: there is no such method.
        InputError: it is neither a name nor a method.
    """
    chosen = as_method(method)
    if not isinstance(method, str):
        return chosen
    if isinstance(chosen, QP):
        return replace(chosen, restarts=0)
    if isinstance(chosen, CCD):
        return replace(chosen, tolerance=AT_THE_END, restarts=0)
    return chosen


class Nearby:
    """Solutions of one problem by one method, each from the posture at hand; the problem's goals may move."""

    def __init__(self, problem: Problem, method: Method, tracker: NewtonTracker | None = None) -> None:
        """Set up.

        Args:
            problem: what is asked.
            method: a configured method.
            tracker: the method's own for this problem, where there is one already.
        """
        self._problem, self._method = problem, method
        self._tracker = method.tracker(problem) if tracker is None and isinstance(method, Newton) else tracker

    def solve_freely(self, q: Array) -> Solution:
        """Solve from the posture q (nq,), wherever the answer lies."""
        return self._tracker.solve(q) if self._tracker is not None else self._method.solve(begun_at(self._problem, q))

    def solve(self, q: Array) -> Solution:
        """Solve from the posture q (nq,); it is kept where the way from it jumps over something.

        Where the way to the best answer goes into something, the nearest answer is preferred; where the goal is not met
        either way, the posture is kept too.
        """
        problem, method = self._problem, self._method
        solution = self.solve_freely(q)
        if problem.scene.sweep(q, solution.q, PASSING) is None:
            return solution
        nearest = replace(method, measures=True) if isinstance(method, QP) else method  # the measures say what is near
        near = nearest.solve(begun_at(problem, q, nearest=True))
        if (near.solved or not solution.solved) and problem.scene.sweep(q, near.q, PASSING) is None:
            return replace(near, assessment=assess(problem, near.q))
        if solution.solved and not _jumps(problem, q, solution.q):
            return solution
        judgement = assess(begun_at(problem, q), q)
        message = "the posture that was found lies beyond something in the way; the figure stays"
        return replace(solution, q=q, status="unreachable", assessment=judgement, message=message)


def _jumps(problem: Problem, before: Array, after: Array) -> bool:
    """Whether something is jumped over on the way between two postures (nq,)."""
    with problem.lend() as workspace:
        first, last = (Placed(workspace.near(q, WITHIN), WITHIN) for q in (before, after))
        return passes_through(workspace, first, last, before, after)
