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
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.bench.suite.problem_sets.things import Occupied, add_things

THINGS = 20
SEEN = (0.5, 2.5)  # m: how far away what the eyes look at is


def _free(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """Where the fingertip is in a random posture of the upper body becomes the target."""
    figure = human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    goals = [point(figure, witness, TIPS[number % len(TIPS)])]
    return standing_problem(floor_scene(figure), start, goals), witness


def _several(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: both fingertips; both and the eyes; one palm with its orientation, the other fingertip and the eyes."""
    figure = human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    gaze = figure.placement(witness, "gaze")
    look = wb.Axis("gaze", (1, 0, 0), toward=gaze.act(np.array((rng.uniform(*SEEN), 0.0, 0.0))))
    points = [point(figure, witness, tip) for tip in TIPS]
    palm = wb.Frame("right_palm", figure.placement(witness, "right_palm"))
    goals: list[list[wb.Goal]] = [[*points], [*points, look], [palm, points[1], look]]
    return standing_problem(floor_scene(figure), start, goals[number % len(goals)]), witness


def _among(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A reach among things that touch neither how the person stands nor the witness."""
    return reach_among(human(), TIPS[number % len(TIPS)], rng)


def reach_among(figure: wb.Figure, tip: str, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A problem with `THINGS` random things, and a posture (nq,) that solves it."""
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    scene = floor_scene(figure)
    add_things(scene, THINGS, Occupied(figure, (start, witness)), ROOM, rng)
    return standing_problem(scene, start, [point(figure, witness, tip)]), witness


FREE = ProblemSet(
    "free_reach",
    "free reach",
    "A standing person brings one fingertip to a place; only its own body and the floor are in the way.",
    _free,
)
SEVERAL = ProblemSet(
    "free_reach_several",
    "free reach, several at once",
    "A standing person brings both hands to places, in two of three problems with its eyes on a third, "
    "in one of three with a hand turned as asked.",
    _several,
)
CLUTTER = ProblemSet(
    "clutter",
    "clutter",
    "A standing person brings one fingertip to a place among twenty boxes, balls, rods and stones around it.",
    _among,
)
