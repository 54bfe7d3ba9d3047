"""Problems whose goals move: copies that leave the caller's problem unchanged, and solutions from where one is."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any, TypeAlias

import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base.arrays import Array
from wholebody.base.checks import whole
from wholebody.base.errors import InputError
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.base import Tracker, check_problem
from wholebody.problem import Problem
from wholebody.solution import Solution, Status
from wholebody.tasks import Frame, Orientation, Point, Relative
from wholebody.tasks.base import Goal

MovingGoal: TypeAlias = Point | Frame | Orientation | Relative

PASSING = 1e-3  # m: if the motion to a solution gets deeper, a nearer solution is tried


def copied(problem: Problem) -> Problem:
    """A copy whose goals can be moved without changing the caller's problem; refused if the scene changed."""
    check_problem(problem, "problem")
    problem.check_fresh()
    return copy.copy(problem)


def moving_goal(problem: Problem, number: int) -> MovingGoal:
    """The goal of this index; raises InputError where there is none, or it is of another kind than these."""
    if not problem.goals:
        raise InputError("the problem has no goals; give it a Point or a Frame")
    number = whole(number, "the number of the goal", 0, len(problem.goals) - 1)
    goal = problem.goals[number]
    if not isinstance(goal, (Point, Frame, Orientation, Relative)):
        raise InputError(
            f"goals[{number}] is a {type(goal).__name__}; a Point, a Frame, an Orientation or a Relative can be moved"
        )
    return goal


def target_of(goal: MovingGoal) -> Any:
    """Where a resolved goal is: a position (3,) of a point, a placement of others, a relative one's in its `to`."""
    return goal.resolved_target if isinstance(goal, Point) else goal.residual.placement


def retarget(problem: Problem, number: int, target: Any) -> None:
    """Move a goal of `moving_goal` to another target; raises InputError where one of them is none."""
    goals: list[Goal] = list(problem.goals)
    goal = moving_goal(problem, number)
    goals[number] = replace(goal, placement=target) if isinstance(goal, Relative) else replace(goal, target=target)
    problem.retarget(goals)


def interpolated_target(goal: MovingGoal, error: Array, share: float) -> Any:
    """A target between the frame, which has this error, and the goal: at a share of the distance."""
    target = target_of(goal)
    if isinstance(goal, Point):
        return target + (1.0 - share) * error
    if isinstance(goal, Orientation):
        return pin.exp3((1.0 - share) * error) @ target.rotation
    there = target.translation + (1.0 - share) * error[:3]
    if len(error) == 3:
        return pin.SE3(target.rotation, there)
    here = pin.exp3(error[3:]) @ target.rotation
    return pin.SE3(here @ pin.exp3(share * pin.log3(here.T @ target.rotation)), there)


def warm_started(problem: Problem, tracker: Tracker, q: Array) -> Solution:
    """Solve from q (nq,), to the best or nearest answer to which the motion passes nothing; else keep the posture."""
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
    status: Status = "unreachable" if judgement.nearest else "stalled"
    return replace(solution, q=q, status=status, assessment=judgement, message=message)


def _passes_through(problem: Problem, before: Array, after: Array) -> bool:
    """Whether the motion between two postures (nq,) passes through something."""
    with problem.borrow() as workspace:
        within = 0.06  # m: larger = more distances and fewer sweeps
        first, last = (QueryResult(workspace.near(q, within), within) for q in (before, after))
        return passes_through(workspace, first, last, before, after)
