"""Warm starts: solutions from the posture at hand, whose way from it is free; what motions are made of."""

from __future__ import annotations

from dataclasses import replace

from wholebody.arrays import Array
from wholebody.assessment import assess
from wholebody.geometry.continuous.moved_pairs import Placed
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.base import Tracker
from wholebody.problem import Problem
from wholebody.solution import Solution

WITHIN = 0.06  # m: pairs nearer than this are measured when a way is judged; larger = dearer, fewer left to a sweep
PASSING = 1e-3  # m: a solution whose way goes in deeper gives way to a nearer one


def warm_started(problem: Problem, tracker: Tracker, q: Array) -> Solution:
    """Solve from the posture q (nq,); it is kept where the way from it passes through something.

    Where the way to the best answer goes into something, the nearest answer is preferred; where the goal is not met
    either way, the posture is kept too.

    Args:
        problem: what is asked.
        tracker: of a method for this problem.
        q: the posture at hand.
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
    """Whether something is passed through on the way between two postures (nq,)."""
    with problem.lend() as workspace:
        first, last = (Placed(workspace.near(q, WITHIN), WITHIN) for q in (before, after))
        return passes_through(workspace, first, last, before, after)
