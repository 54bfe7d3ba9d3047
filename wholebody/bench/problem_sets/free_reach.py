"""One fingertip to a place, nothing around but the floor."""

from __future__ import annotations

import wholebody as wb
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

NAME = "free_reach"


def make(number: int, seed: int) -> Case:
    """Where the fingertip is in a random posture of the upper body becomes the target."""
    rng, figure = generator(NAME, number, seed), human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    tip = TIPS[number % len(TIPS)]
    problem = wb.Problem(
        floor_scene(figure),
        start,
        goals=[wb.Point(tip, place_of(figure, witness, tip).translation)],
        constraints=held_feet(),
        clearance=CLEARANCE,
    )
    return Case(NAME, number, problem, witness)


SET = ProblemSet(
    NAME,
    "free reach",
    "A standing person brings one fingertip to a place; only its own body and the floor are in the way.",
    make,
)
