"""Solutions near the posture at hand, whose way from it is free: what motions are made of, with any method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wholebody.assessment import assess
from wholebody.geometry.moved_pairs import Placed
from wholebody.methods.base import Tracker
from wholebody.methods.passage import jumps
from wholebody.problem import Problem
from wholebody.solution import Solution

Array = NDArray[np.float64]

WITHIN = 0.06  # m: pairs nearer than this are measured when a way is judged; larger = dearer, fewer left to a sweep
PASSING = 1e-3  # m: a solution whose way goes in deeper gives way to a nearer one


def solve_nearby(problem: Problem, tracker: Tracker, q: Array) -> Solution:
    """Solve from the posture q (nq,); it is kept where the way from it jumps over something.

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
    if solution.solved and not _jumps(problem, q, solution.q):
        return solution
    judgement = assess(problem.with_start(q), q)
    message = "the posture that was found lies beyond something in the way; the figure stays"
    return replace(solution, q=q, status="unreachable", assessment=judgement, message=message)


def _jumps(problem: Problem, before: Array, after: Array) -> bool:
    """Whether something is jumped over on the way between two postures (nq,)."""
    with problem.lend() as workspace:
        first, last = (Placed(workspace.near(q, WITHIN), WITHIN) for q in (before, after))
        return jumps(workspace, first, last, before, after)
