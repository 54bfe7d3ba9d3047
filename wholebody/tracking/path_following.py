"""Path following with any method: a goal moves along a path in steps (Choi and Cremer 1999, section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.methods.base import Method
from wholebody.methods.inputs import check_problem
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.assembly_solution import AssemblySolution
from wholebody.methods.solve import method_for_motions
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.tasks import Point
from wholebody.tasks.inputs import FARTHEST, point
from wholebody.tracking.frame import FRAME
from wholebody.tracking.moving_goals import copied, moving_goal, retarget, warm_started

SPACING = 0.05  # m between intermediate goals; smaller = more solves, each from a nearer start
MOST_GOALS = 10_000


@overload
def follow_path(
    problem: Problem, path: ArrayLike, method: str | Method = ..., *, goal: int = ..., spacing: float = ...
) -> tuple[Solution, ...]: ...
@overload
def follow_path(
    problem: Assembly, path: ArrayLike, *, goal: int = ..., spacing: float = ...
) -> tuple[AssemblySolution, ...]: ...
def follow_path(
    problem: Problem | Assembly,
    path: ArrayLike,
    method: str | Method = "newton",
    *,
    goal: int = 0,
    spacing: float = SPACING,
) -> tuple[Solution, ...] | tuple[AssemblySolution, ...]:
    """Move a goal along a path, through evenly spaced intermediate goals.

    `solve` finds the posture for the first corner. Each later goal is solved from the posture before. If the motion to
    its posture is blocked, the goal counts as not reached.

    Args:
        problem: with the goal that moves, a `Point`; or an assembly with a goal of `point_goal`. An assembly's bodies
            move along, and stay where the last solution left them.
        path: (k, 3) corners of the path, metres; the first one is the first target.
        method: for a problem: by name, with a tolerance of 1e-5 and no restarts, or a configured method.
        goal: index of the goal that moves.
        spacing: metres between intermediate goals, at most.

    Returns:
        A solution for each intermediate goal, up to the first that was not reached or the end of the path.

    Raises:
        InputError: the path is not one, the spacing is not positive, or the goal is not a `Point`.
        UnknownNameError: there is no such method.

    Examples:
        >>> answers = wb.follow_path(problem, [(0.50, -0.25, 0.95), (0.55, -0.20, 0.95)], "qp")
        >>> all(answer.solved for answer in answers)
        True
    """
    places = _spaced(path, spacing)
    if isinstance(problem, Assembly):
        return _pulled(problem, places, goal)
    check_problem(problem, "follow_path: problem")
    term = moving_goal(problem, goal)
    if not isinstance(term, Point):
        raise InputError(f"follow_path moves a Point, and goals[{goal}] is a {type(term).__name__}; use Drag")
    own, q, found = copied(problem), problem.scene.figure.clamp(problem.start), []
    tracker = method_for_motions(method).tracker(own, FRAME)
    for number, place in enumerate(places):
        retarget(own, goal, place)
        found.append(warm_started(own, tracker, q) if number else tracker.solve(q))
        if not found[-1].solved:
            break
        q = found[-1].q
    return tuple(found)


def _pulled(assembly: Assembly, places: Sequence[Array], goal: int) -> tuple[AssemblySolution, ...]:
    """The same for an assembly: pull to goal, as Choi and Cremer call it."""
    kind = assembly.goals[assembly.goal_index(goal)].kind
    if kind != "point":
        raise InputError(f"follow_path moves the goal of a point, and goal {goal} is of the kind {kind!r}; use Drag")
    found: list[AssemblySolution] = []
    for place in places:
        found.append(assembly.retarget(goal, place).solve())
        if found[-1].status != "solved":
            break
    return tuple(found)


def _spaced(path: ArrayLike, spacing: float) -> Sequence[Array]:
    """Positions (3,) along a path, including its corners."""
    corners = checks.array(path, "path", "corners of shape (k, 3), metres")
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 1:
        raise InputError(f"path has shape {corners.shape}; give corners of shape (k, 3), metres")
    for place, corner in enumerate(corners):
        point(corner, f"path[{place}]")
    spacing = checks.number(spacing, "spacing", 1e-6, FARTHEST, "m")  # m: least spacing
    legs = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    if (legs.sum() / MOST_GOALS) > spacing:
        raise InputError(f"a spacing of {spacing:g} m makes more than {MOST_GOALS} goals of this path; make it larger")
    counts = np.ceil(legs / spacing).astype(int)
    places = [corners[0]]
    for begin, end, count in zip(corners, corners[1:], counts, strict=False):
        places += [begin + (end - begin) * k / count for k in range(1, count + 1)]
    return places
