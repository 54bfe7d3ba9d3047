"""Warm starts for motions: solutions from the present posture to which the motion is free."""

from __future__ import annotations

from dataclasses import replace

from wholebody.assessment.posture import assess
from wholebody.base.arrays import Array
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.base import Tracker
from wholebody.problem import Problem
from wholebody.solution import Solution

PASSING = 1e-3  # m: if the motion to a solution gets deeper, a nearer solution is tried


def warm_started(problem: Problem, tracker: Tracker, q: Array) -> Solution:
    """Solve from the posture q (nq,); the posture is kept if the motion to the solution passes through something.

    If the motion to the best answer penetrates something, the nearest answer is preferred; if neither meets the goal,
    the posture is kept too. The tracker is that of a method for this problem.
    """
    solution = tracker.solve(q)
    if problem.scene.sweep(q, solution.q, PASSING) is None:
        return solution
    near = tracker.nearest(q)
    if (near.solved or not solution.solved) and problem.scene.sweep(q, near.q, PASSING) is None:
        return replace(near, assessment=assess(problem, near.q))
    if solution.solved and not _passes_through(problem, q, solution.q):
        return solution
    judgement = assess(problem.with_start(q), q)
    message = "the posture that was found lies beyond something in the way; the figure stays"
    return replace(solution, q=q, status="unreachable", assessment=judgement, message=message)


def _passes_through(problem: Problem, before: Array, after: Array) -> bool:
    """Whether the motion between two postures (nq,) passes through something."""
    with problem.borrow() as workspace:
        within = 0.06  # m: larger = more distances and fewer sweeps
        first, last = (QueryResult(workspace.near(q, within), within) for q in (before, after))
        return passes_through(workspace, first, last, before, after)
