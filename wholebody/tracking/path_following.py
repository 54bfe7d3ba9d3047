"""Paths of goals: followed by any method (Choi and Cremer 1999, section 3); circles, files, evenly spaced points."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import array, is_number, number, shown, time_step, whole
from wholebody.base.checks import path as checked_path
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import read_text
from wholebody.methods.base import Method, check_problem
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.assembly_system import AssemblySolution
from wholebody.methods.solve import method_for_motions, warn_of_left_out
from wholebody.motion.clip import MOST_FRAMES
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.tasks import Point
from wholebody.tasks.inputs import FARTHEST, direction, point
from wholebody.tracking.frame import FRAME
from wholebody.tracking.moving_goals import copied, moving_goal, retarget, warm_started

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
    spacing: float = 0.05,
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
        >>> answers = wb.tracking.follow_path(problem, [(0.50, -0.25, 0.95), (0.55, -0.20, 0.95)], "qp")
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
    own, q, found = copied(problem), problem.scene.figure.clamp(problem.start), list[Solution]()
    tracker = warn_of_left_out(method_for_motions(method), 2, own).tracker(own, FRAME)
    for place in places:
        retarget(own, goal, place)
        found.append(warm_started(own, tracker, q) if found else tracker.solve(q))
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
    corners = array(path, "path", "corners of shape (k, 3), metres")
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 1:
        raise InputError(f"path has shape {corners.shape}; give corners of shape (k, 3), metres")
    for place, corner in enumerate(corners):
        point(corner, f"path[{place}]")
    spacing = number(spacing, "spacing", 1e-6, FARTHEST, "m")  # m: least spacing
    legs = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    if (legs.sum() / MOST_GOALS) > spacing:
        raise InputError(f"a spacing of {spacing:g} m makes more than {MOST_GOALS} goals of this path; make it larger")
    counts = np.ceil(legs / spacing).astype(int)
    places = [corners[0]]
    for begin, end, count in zip(corners, corners[1:], counts, strict=False):
        places += [begin + (end - begin) * k / count for k in range(1, count + 1)]
    return places


SPEED = 0.5  # m/s: of the goal, if the number of frames is not given
LARGEST = 100.0  # m: a point farther from the origin is refused as a wrong unit


def circle(center: ArrayLike, radius: float, normal: ArrayLike = (1.0, 0.0, 0.0)) -> Array:
    """Corners (k, 3) of a closed circle, which begins and ends at its lowest point.

    Args:
        center: (3,) metres.
        radius: metres.
        normal: (3,) of its plane; x faces the figure. With a vertical normal the circle begins in front.

    Raises:
        InputError: the radius is not positive, or a value is not finite.

    Examples:
        >>> wholebody.tracking.circle((0.5, 0.0, 1.0), 0.1)[0].round(3)
        array([0.5, 0. , 0.9])
    """
    middle, axis = point(center, "circle: center"), direction(normal, "circle: normal")
    radius = number(radius, "circle: radius", 1e-6, LARGEST, "m")  # m: smallest circle
    down = np.array((0.0, 0.0, -1.0)) if abs(axis[2]) < 0.99 else np.array((1.0, 0.0, 0.0))
    first = down - (down @ axis) * axis
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]  # a polygon of 72 sides
    return np.asarray(middle + radius * (np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)))


def read_path(path: str | os.PathLike[str]) -> Array:
    """Read points (k, 3) from a text file: x, y and z in metres, one point a line, separated by commas or spaces.

    Empty lines, comments after #, and a first line of names are ignored. Raises FileFormatError for a file without
    points, or a line that is none and is named.

    Examples:
        >>> _ = (folder / "corners.csv").write_text("0.4, 0, 1")
        >>> wholebody.tracking.read_path(folder / "corners.csv")
        array([[0.4, 0. , 1. ]])
    """
    return read_rows(path, (3,), "x y z in metres")


def read_rows(path: str | os.PathLike[str], sizes: Sequence[int], wanted: str) -> Array:
    """Read rows (k, n) of such a file, each of n numbers, one of some sizes; `wanted` names them in errors."""
    path = checked_path(path, "path")
    text = read_text(path, "path")
    lines = {number: said.partition("#")[0].strip() for number, said in enumerate(text.splitlines(), start=1)}
    entries = [(f"{path}, line {number}", said) for number, said in lines.items() if said]
    if entries and not any(is_number(word) for word in _words(entries[0][1])):
        entries = entries[1:]
    if not entries:
        raise FileFormatError(f"{path}: it holds no places; give {wanted}, one place a line")
    first = len(_words(entries[0][1]))
    return np.array([_place(*line, (first,) if first in sizes else sizes, wanted) for line in entries])


def spread(corners: ArrayLike, frames: int | None = None, dt: float = FRAME) -> Array:
    """Evenly spaced points (n, 3) of a path, with its end and without its beginning.

    Args:
        corners: (k, 3) of the path, metres.
        frames: number of points; by default as many as give half a metre a second.
        dt: seconds a frame.

    Raises:
        InputError: the corners are no path, or frames is not positive.

    Examples:
        >>> wholebody.tracking.spread([(0.0, 0.0, 0.0), (0.0, 0.0, 0.1)], frames=2)[:, 2]
        array([0.05, 0.1 ])
    """
    given = array(corners, "path", "at least two corners, shape (k, 3), metres")
    if given.ndim != 2 or given.shape[1] != 3 or len(given) < 2:
        raise InputError(f"a path has shape {given.shape}; give at least two corners, shape (k, 3), metres")
    places = np.array([point(corner, f"corners[{place}]") for place, corner in enumerate(given)])
    if frames is not None:
        frames = whole(frames, "frames", 1, MOST_FRAMES)
    dt = time_step(dt, "dt")
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    if frames is None and way[-1] / (SPEED * dt) > MOST_FRAMES:
        raise InputError(f"dt of {dt:g} s makes more than {MOST_FRAMES} frames of this path; make it larger")
    count = frames if frames is not None else max(1, int(np.ceil(way[-1] / (SPEED * dt))))
    at = way[-1] * np.arange(1, count + 1) / count
    return np.stack([np.interp(at, way, places[:, axis]) for axis in range(3)], axis=1)


def _words(text: str) -> list[str]:
    return text.replace(",", " ").replace(";", " ").split()


def _place(where: str, text: str, sizes: Sequence[int], wanted: str) -> list[float]:
    words = _words(text)
    if len(words) not in sizes or not all(map(is_number, words)):
        raise FileFormatError(f"{where}: {shown(text)} is not a place; give {wanted}, as many numbers in every line")
    values = [float(word) for word in words]
    if not all(abs(value) <= LARGEST for value in values):
        raise FileFormatError(f"{where}: {shown(text)} is not within {LARGEST:g} m of the origin; give metres")
    return values
