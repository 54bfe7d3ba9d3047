"""Robot arms with their tool to a place, or a place and an orientation, among obstacles."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.problem_sets.arms import KINDS, arm
from wholebody.bench.problem_sets.bodies import ATTEMPTS, CLEARANCE, ROOM, alone, floor_scene, is_free, place_of
from wholebody.bench.problem_sets.case import Case, ProblemSet, generator
from wholebody.bench.problem_sets.things import Occupied, add_things
from wholebody.errors import InputError

NAME = "robot_arm"
THINGS = 8
SPACE = ((-0.8, -0.8, 0.05), (0.8, 0.8, 1.3))  # m: where they are put


def make(number: int, seed: int) -> Case:
    """The kinds of arm in turn; a place and an orientation in every other round, only a place in the others."""
    rng = generator(NAME, number, seed)
    figure, ready = arm(KINDS[number % len(KINDS)], rng)
    start = figure.with_joints(figure.neutral, ready)
    witness = _sampled(figure, rng)
    scene = floor_scene(figure)
    add_things(scene, THINGS, Occupied(figure, (start, witness)), ROOM, rng, SPACE)
    place = place_of(figure, witness, "tool")
    turned = number // len(KINDS) % 2 == 1
    problem = wb.Problem(
        scene,
        start,
        goals=[wb.Frame("tool", place) if turned else wb.Point("tool", place.translation)],
        clearance=CLEARANCE,
    )
    return Case(NAME, number, problem, witness)


def _sampled(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """Posture (nq,) uniformly at random within the limits, nothing touching."""
    for _ in range(ATTEMPTS):
        q: Array = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit)
        if is_free(alone(figure), q):
            return q
    raise InputError(f"none of {ATTEMPTS} postures is free; give another seed")


SET = ProblemSet(
    NAME,
    "robot arms",
    "Arms of six or seven axes, every one with links of other lengths, bring their tool to a place among eight things, "
    "in half of the problems with an orientation.",
    make,
)
