"""Scenes to plan motions in: arms (in the manner of MotionBenchMaker, Chamzas and others 2022), bodies, a hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.problem_sets.case import generator
from wholebody.bench.suite.problem_sets.registry import problem_set

ROBOT = "unitree_robots/g1/g1_29dof.xml"  # of the repository unitree_mujoco


class Question(NamedTuple):
    """A motion that is asked for: from a posture (nq,) to a posture, or to goals, and what holds on the way."""

    scene: wb.Scene
    start: Array
    goal: Any
    constraints: tuple[Any, ...] = ()


def _asked(problem: wb.Problem) -> Question:
    return Question(problem.scene, problem.start, list(problem.goals), problem.stated)


def _arms(kind: str) -> Callable[[int], Question]:
    return lambda number: _asked(robots.into(kind, number, generator(kind, number, 0))[0])


def _of_set(name: str, first: int = 0) -> Callable[[int], Question]:
    return lambda number: _asked(problem_set(name).make(first + number, 0).problem)


def _through_gap(figure: wb.Figure, start: Array, width: float) -> Question:
    """A body before two walls with a gap between them, and the same posture behind it."""
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -0.01))
    for name, side in (("left wall", 1.0), ("right wall", -1.0)):
        scene.add(wb.Box((0.1, 1.5, 2.2)), name=name, at=(0.9, side * (0.75 + 0.5 * width), 1.1))
    end = start.copy()
    end[0] += 1.8
    return Question(scene, start, end)


def person_at_gap(number: int) -> Question:
    """A person, 0.66 m wide as it stands; the gap is narrower from number to number."""
    figure = wb.load("human")
    return _through_gap(figure, figure.posture("standing"), (0.42, 0.46, 0.50, 0.60)[number % 4])


def robot_at_gap(number: int) -> Question:
    """A G1 of Unitree, 0.45 m wide; LookupError where the files are missing."""
    named = os.environ.get("WHOLEBODY_ROBOTS", "")
    found = next(iter(Path(named).glob(f"**/{ROBOT}")), None) if named else None
    if found is None:
        raise LookupError(f"G1 at a gap: WHOLEBODY_ROBOTS names no folder with {ROBOT}")
    figure = wb.load(found)
    return _through_gap(figure, figure.neutral, (0.36, 0.38, 0.40, 0.42)[number % 4])


def hand_into_box(number: int) -> Question:
    """An open hand above a closed box, and in it, through a hole of 0.17 by 0.11 m in its front, as if it gripped."""
    figure = wb.load("hand", side=("right", "left")[number % 2])
    scene, (wide, high) = wb.Scene(figure), (0.17, 0.11)
    boards = {
        "floor": ((0.3, 0.32, 0.01), (0.0, 0.0, -0.12)),
        "roof": ((0.3, 0.32, 0.01), (0.0, 0.0, 0.12)),
        "back": ((0.01, 0.32, 0.24), (0.145, 0.0, 0.0)),
        "left": ((0.3, 0.01, 0.24), (0.0, 0.16, 0.0)),
        "right": ((0.3, 0.01, 0.24), (0.0, -0.16, 0.0)),
    }
    for name, side in product(("front", "beam"), (1.0, -1.0)):
        breadth = 0.5 * (0.32 - wide) if name == "front" else wide
        height = 0.24 if name == "front" else 0.5 * (0.24 - high)
        middle = (
            (0.0, side * (0.5 * wide + 0.5 * breadth), 0.0)
            if name == "front"
            else (0.0, 0.0, side * 0.5 * (high + height))
        )
        boards[f"{name} {side:+.0f}"] = ((0.01, breadth, height), (-0.145, *middle[1:]))
    for name, (size, at) in boards.items():
        scene.add(wb.Box(size), name=name, at=at)
    turn = pin.utils.rotate("z", np.pi * (number // 2 % 2)) @ pin.utils.rotate("x", 0.5 * np.pi)
    return Question(
        scene,
        _placed(figure, "open", pin.SE3(turn, np.array((0.1, 0.0, 0.30)))),
        _placed(figure, "grip", pin.SE3(np.eye(3), np.array((-0.09, (-0.03, 0.03)[number % 2], 0.02)))),
    )


def _placed(figure: wb.Figure, posture: str, at: pin.SE3) -> Array:
    q: Array = figure.posture(posture).copy()
    q[:7] = pin.SE3ToXYZQUAT(at)
    return q


SCENES: dict[str, Callable[[int], Question]] = {
    "shelf": _arms("shelf"),
    "bin": _arms("bin"),
    "table": _arms("table"),
    "cage": _arms("cage"),
    "kitchen": _arms("kitchen"),
    "clutter": _of_set("arms_among_things", 24),
    "person at a gap": person_at_gap,
    "G1 at a gap": robot_at_gap,
    "hand into a box": hand_into_box,
    "person among things": _of_set("clutter"),
    "person through a hole": _of_set("passage"),
}
"""By name; what makes a question from its number."""


def questions(name: str, count: int) -> Iterable[Question]:
    """The first questions of a scene."""
    return map(SCENES[name], range(count))
