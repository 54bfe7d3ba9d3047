"""Two hands and the eyes to places at once, nothing around but the floor."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.problem_sets.bodies import (
    CLEARANCE,
    TIPS,
    floor_scene,
    held_feet,
    human,
    place_of,
    sampled_posture,
)
from wholebody.bench.problem_sets.case import Case, ProblemSet, generator

NAME = "free_reach_several"
SEEN = (0.5, 2.5)  # m: how far away what the eyes look at is


def make(number: int, seed: int) -> Case:
    """In turn: both fingertips; both and the eyes; one palm with its orientation, the other fingertip and the eyes."""
    rng, figure = generator(NAME, number, seed), human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    gaze = place_of(figure, witness, "gaze")
    look = wb.Axis("gaze", (1, 0, 0), toward=gaze.act(np.array((rng.uniform(*SEEN), 0.0, 0.0))))
    points = [_point(figure, witness, tip) for tip in TIPS]
    palm = wb.Frame("right_palm", place_of(figure, witness, "right_palm"))
    goals: list[list[wb.Goal]] = [[*points], [*points, look], [palm, points[1], look]]
    problem = wb.Problem(
        floor_scene(figure),
        start,
        goals=goals[number % len(goals)],
        constraints=held_feet(),
        clearance=CLEARANCE,
    )
    return Case(NAME, number, problem, witness)


def _point(figure: wb.Figure, q: Array, frame: str) -> wb.Point:
    return wb.Point(frame, place_of(figure, q, frame).translation)


SET = ProblemSet(
    NAME,
    "free reach, several at once",
    "A standing person brings both hands to places, in two of three problems with its eyes on a third, "
    "in one of three with a hand turned as asked.",
    make,
)
