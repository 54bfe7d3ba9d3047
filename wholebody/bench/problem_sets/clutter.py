"""One fingertip to a place among random things."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.problem_sets.bodies import (
    CLEARANCE,
    ROOM,
    TIPS,
    floor_scene,
    held_feet,
    human,
    place_of,
    sampled_posture,
)
from wholebody.bench.problem_sets.case import Case, ProblemSet, generator
from wholebody.bench.problem_sets.things import Occupied, add_things

NAME = "clutter"
THINGS = 20


def make(number: int, seed: int) -> Case:
    """A reach among things that touch neither how the person stands nor the witness."""
    problem, witness = reach_among(human(), TIPS[number % len(TIPS)], generator(NAME, number, seed))
    return Case(NAME, number, problem, witness)


def reach_among(figure: wb.Figure, tip: str, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A problem with `THINGS` random things, and a posture (nq,) that solves it."""
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    scene = floor_scene(figure)
    add_things(scene, THINGS, Occupied(figure, (start, witness)), ROOM, rng)
    problem = wb.Problem(
        scene,
        start,
        goals=[wb.Point(tip, place_of(figure, witness, tip).translation)],
        constraints=held_feet(),
        clearance=CLEARANCE,
    )
    return problem, witness


SET = ProblemSet(
    NAME,
    "clutter",
    "A standing person brings one fingertip to a place among twenty boxes, balls, rods and stones around it.",
    make,
)
