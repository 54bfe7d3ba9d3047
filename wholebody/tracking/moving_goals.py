"""Copies of problems with moving goals or other starts, which leave the caller's problem unchanged."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import whole
from wholebody.base.errors import InputError
from wholebody.methods.inputs import check_problem
from wholebody.problem import Problem
from wholebody.tasks import Frame, Point
from wholebody.tasks.base import Goal


def copied(problem: Problem) -> Problem:
    """A copy whose goals can be moved without changing the caller's problem.

    Raises InputError where it is no problem, or objects were added to or removed from its scene.
    """
    check_problem(problem, "problem")
    problem.check_fresh()
    return copy.copy(problem)


def moving_goal(problem: Problem, number: int) -> Point | Frame:
    """The goal of this index; raises InputError where there is none, or it is no `Point` and no `Frame`."""
    if not problem.goals:
        raise InputError("the problem has no goals; give it a Point or a Frame")
    number = whole(number, "the number of the goal", 0, len(problem.goals) - 1)
    goal = problem.goals[number]
    if not isinstance(goal, (Point, Frame)):
        raise InputError(f"goals[{number}] is a {type(goal).__name__}; only a Point or a Frame can be moved")
    return goal


def retarget(problem: Problem, number: int, target: Any) -> None:
    """Move a problem's goal, a `Point` or `Frame`, to another target; raises InputError where one of them is none."""
    goals: list[Goal] = list(problem.goals)
    goals[number] = replace(moving_goal(problem, number), target=target)
    problem.retarget(goals)


def interpolated_target(goal: Point | Frame, error: Array, share: float) -> Any:
    """A target between the frame, which has this error, and the goal: at a share of the distance."""
    if isinstance(goal, Point):
        return goal.resolved_target + (1.0 - share) * error
    target = goal.resolved_target
    here = pin.SE3(pin.exp3(error[3:]) @ target.rotation, target.translation + error[:3])
    turned = here.rotation @ pin.exp3(share * pin.log3(here.rotation.T @ target.rotation))
    return pin.SE3(turned, here.translation + share * (target.translation - here.translation))
