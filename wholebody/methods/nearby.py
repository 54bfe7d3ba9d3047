"""Solutions near the posture at hand, whose way from it is free: what motions are made of, with any method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wholebody.assessment import assess
from wholebody.geometry.moved_pairs import snapshot
from wholebody.methods.ccd.method import CCD
from wholebody.methods.moving_goals import begun_at
from wholebody.methods.newton.method import Newton
from wholebody.methods.passage import jumps
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import Method, as_method
from wholebody.problem import Problem, Solution

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


def solve_freely(problem: Problem, q: Array, method: Method) -> Solution:
    """Solve from the posture q (nq,), wherever the answer lies."""
    return method.follow(problem, q) if isinstance(method, Newton) else method.solve(begun_at(problem, q))


def solve_nearby(problem: Problem, q: Array, method: Method) -> Solution:
    """Solve from the posture q (nq,); it is kept where the way from it jumps over something.

    Where the way to the best answer goes into something, the nearest answer is preferred; where the goal is not met
    either way, the posture is kept too.
    """
    solution = solve_freely(problem, q, method)
    sweeper = problem.scene.sweeper
    if sweeper.first_contact(q, solution.q, tolerance=PASSING) is None:
        return solution
    nearest = replace(method, measures=True) if isinstance(method, QP) else method  # the measures say what is near
    near = nearest.solve(begun_at(problem, q, nearest=True))
    if (near.solved or not solution.solved) and sweeper.first_contact(q, near.q, tolerance=PASSING) is None:
        return replace(near, assessment=assess(problem, near.q))
    if solution.solved and not _jumps(problem, q, solution.q):
        return solution
    judgement = assess(begun_at(problem, q), q)
    message = "the posture that was found lies beyond something in the way; the figure stays"
    return replace(solution, q=q, status="unreachable", assessment=judgement, message=message)


def _jumps(problem: Problem, before: Array, after: Array) -> bool:
    """Whether something is jumped over on the way between two postures (nq,)."""
    scene = problem.scene
    first, last = (
        snapshot(scene.proximity, scene.proximity.near(scene.state(q).data, WITHIN), WITHIN) for q in (before, after)
    )
    return jumps(scene, first, last, before, after)
