"""A fingertip, or both hands and the eyes, to places: nothing around but the floor, or many things."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    ROOM,
    TIPS,
    floor_scene,
    human,
    point,
    sampled_posture,
    standing_problem,
)
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things


def free(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """Where the fingertip is in a random posture of the upper body becomes the target."""
    figure = human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    goals = [point(figure, witness, TIPS[number % len(TIPS)])]
    return standing_problem(floor_scene(figure), start, goals), witness


def several(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: both fingertips; both and the eyes; one palm with its orientation, the other fingertip and the eyes."""
    figure = human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    away = np.array((rng.uniform(*numbers("free_reach_several").seen_m), 0.0, 0.0))
    look = wb.Axis("gaze", (1, 0, 0), toward=figure.placement(witness, "gaze").act(away))
    points = [point(figure, witness, tip) for tip in TIPS]
    palm = wb.Frame("right_palm", figure.placement(witness, "right_palm"))
    goals: list[list[wb.Goal]] = [[*points], [*points, look], [palm, points[1], look]]
    return standing_problem(floor_scene(figure), start, goals[number % len(goals)]), witness


def among(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A reach among things that touch neither how the person stands nor the witness."""
    return reach_among(human(), TIPS[number % len(TIPS)], rng)


def reach_among(figure: wb.Figure, tip: str, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A problem with twenty random things, and a posture (nq,) that solves it."""
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    scene = floor_scene(figure)
    add_things(scene, numbers("clutter").things, Occupied(figure, (start, witness)), ROOM, rng)
    return standing_problem(scene, start, [point(figure, witness, tip)]), witness
