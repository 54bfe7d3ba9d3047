"""Dragging and pulling with any method: goals that move, followed frame by frame or goal by goal.

The schemes of Choi and Cremer 1999, section 3: a drag is a stream of nearby goals, each met with moderate accuracy and
the last one with high; a pull follows a path through evenly spaced intermediate goals and stops at the last that can be
reached; a jump to the goal is `wholebody.solve`.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wholebody.errors import InputError
from wholebody.methods.newton.method import Newton
from wholebody.methods.qp.method import QP
from wholebody.methods.solve import Method, method_named
from wholebody.problem import Problem, Solution
from wholebody.tasks import Frame, Point
from wholebody.tasks.base import Goal
from wholebody.tasks.inputs import numbers

Array = NDArray[np.float64]

FRAME = 1.0 / 60.0  # s: a frame of a screen
SPACING = 0.05  # m between intermediate goals; smaller = more solves, each from nearer
MOST_GOALS = 10_000


class DragFrame(NamedTuple):
    """Answer of one frame of a drag.

    Attributes:
        q: (nq,) the posture.
        error: what is left to the goals, metres or radians, the larger.
        iterations: iterations of the method.
        seconds: wall time.
    """

    q: Array
    error: float
    iterations: int
    seconds: float


class Drag:
    """Follows a goal that is moved from frame to frame.

    Attributes:
        problem: what is asked; its goals are replaced as they move.
        q: (nq,) the present posture.
    """

    def __init__(self, problem: Problem, method: str | Method = "qp", *, goal: int = 0, dt: float = FRAME) -> None:
        """Take hold.

        Args:
            problem: with the goal that will move, a `Point` or a `Frame`.
            method: "qp", "ccd", "newton", or a configured method.
            goal: which of the problem's goals moves.
            dt: seconds a frame.

        Raises:
            InputError: there is no such goal, or it is of another kind.
            UnknownNameError: there is no such method.
        """
        if not isinstance(problem, Problem):
            raise InputError(f"Drag takes a Problem, not a {type(problem).__name__}")
        if not (np.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt is {dt}; give seconds a frame, such as 0.02")
        self.problem, self.dt = _own(problem), dt
        self.method = method_named(method) if isinstance(method, str) else method
        self._goal = _moving_goal(problem, goal)
        self._number = goal
        self.q: Array = problem.scene.figure.clamp(problem.start)

    def to(self, target: Any) -> DragFrame:
        """Move the goal to a place (or a placement, for a `Frame`), and make one frame towards it.

        Raises:
            InputError: the target is not one.
        """
        began = time.perf_counter()
        _retarget(self.problem, self._goal, self._number, target)
        if isinstance(self.method, Newton):
            step = self.method.step(self.problem, self.q)
            self.q, iterations = step.q, step.iterations
        elif isinstance(self.method, QP):
            answer = self.method.step(self.problem, self.q, self.dt)
            self.q, iterations = answer.q, 1
        else:
            solution = self.method.solve(_from(self.problem, self.q))
            self.q, iterations = solution.q, solution.iterations
        return DragFrame(self.q, _error(self.problem, self.q), iterations, time.perf_counter() - began)

    def finish(self) -> Solution:
        """Meet the goal where it is now with the method's full accuracy, and judge the posture."""
        solution = _solve(self.problem, self.q, self.method)
        self.q = solution.q
        return solution


def pull(
    problem: Problem, path: ArrayLike, method: str | Method = "newton", *, goal: int = 0, spacing: float = SPACING
) -> tuple[Solution, ...]:
    """Pull a goal along a path, through evenly spaced intermediate goals.

    Args:
        problem: with the goal that moves, a `Point`.
        path: (k, 3) corners of the path, metres; the first one is where the goal is met first.
        method: "qp", "ccd", "newton", or a configured method.
        goal: which of the problem's goals moves.
        spacing: metres between intermediate goals, at most.

    Returns:
        A solution for each intermediate goal; the last one is the first that was not reached, or the end of the path.

    Raises:
        InputError: the path is not one, the spacing is not positive, or the goal is not a `Point`.
        UnknownNameError: there is no such method.
    """
    places = _spaced(path, spacing)
    term = _moving_goal(problem, goal)
    if not isinstance(term, Point):
        raise InputError(f"pull moves a Point along a path, and goals[{goal}] is a {type(term).__name__}; use Drag")
    chosen = method_named(method) if isinstance(method, str) else method
    own, q, found = _own(problem), problem.scene.figure.clamp(problem.start), []
    for place in places:
        _retarget(own, term, goal, place)
        found.append(_solve(own, q, chosen))
        if not found[-1].solved:
            break
        q = found[-1].q
    return tuple(found)


def _solve(problem: Problem, q: Array, method: Method) -> Solution:
    return method.follow(problem, q) if isinstance(method, Newton) else method.solve(_from(problem, q))


def _own(problem: Problem) -> Problem:
    """A copy whose goals can be moved without moving the caller's."""
    problem.check_fresh()
    return copy.copy(problem)


def _from(problem: Problem, q: Array) -> Problem:
    """The same problem, begun at another posture; what was resolved at its start stays."""
    result = copy.copy(problem)
    result.start = q
    return result


def _moving_goal(problem: Problem, number: int) -> Point | Frame:
    if not 0 <= number < len(problem.goals):
        raise InputError(f"the problem has {len(problem.goals)} goals, and none has the number {number}")
    goal = problem.goals[number]
    if not isinstance(goal, (Point, Frame)):
        raise InputError(f"goals[{number}] is a {type(goal).__name__}; only a Point or a Frame can be moved")
    return goal


def _retarget(problem: Problem, goal: Point | Frame, number: int, target: Any) -> None:
    goals: list[Goal] = list(problem.goals)
    goals[number] = replace(goal, target=target)
    problem.retarget(goals)


def _error(problem: Problem, q: Array) -> float:
    state = problem.scene.state(q)
    return max((float(np.linalg.norm(goal.error(state))) for goal in problem.goals), default=0.0)


def _spaced(path: ArrayLike, spacing: float) -> Sequence[Array]:
    """Places (3,) along the corners of a path, its own among them."""
    shape = np.shape(path)
    if len(shape) != 2 or shape[1] != 3 or shape[0] < 1:
        raise InputError(f"path has shape {shape}; give corners of shape (k, 3), metres")
    corners = numbers(path, (shape[0], 3), "path")
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise InputError(f"spacing is {spacing}; give metres greater than zero")
    legs = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    counts = np.ceil(legs / spacing).astype(int)
    if counts.sum() > MOST_GOALS:
        raise InputError(f"a spacing of {spacing} m makes {counts.sum()} goals of this path; make it larger")
    places = [corners[0]]
    for begin, end, count in zip(corners, corners[1:], counts, strict=False):
        places += [begin + (end - begin) * k / count for k in range(1, count + 1)]
    return places
