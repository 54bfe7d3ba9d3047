"""Reaches of a fingertip, or of both hands and the eyes: nothing around but the floor, or many things.

The last three sets have other witnesses, other people and other things: no constant was tuned on them. What is solved
of the one and not of the other is a matter of the distribution, not of the question.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    FEET,
    ROOM,
    TIPS,
    alone,
    fitted,
    floor_scene,
    human,
    is_free,
    movable,
    point,
    sampled_posture,
    standing_problem,
    until_found,
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


def uniform(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """All joints anywhere within their limits, the feet then put on their places; one fingertip, or both."""
    figure, given = human(), numbers("uniform_witnesses")
    start = figure.posture("standing")
    feet = [wb.Frame(foot, figure.placement(start, foot)).resolve(alone(figure), start) for foot in FEET]
    limits, dofs = figure.limits, movable(figure)
    toes = [name for name in figure.joints if "toe" in name]
    standing = figure.joint_values(start)

    def attempt() -> Array | None:
        q = np.array(start)
        q[limits.idx_q] = rng.uniform(limits.lower, limits.upper)
        q = figure.with_joints(q, {name: standing[name] for name in toes})
        q[:3] += rng.uniform(*given.pelvis_m)
        turn = np.append(0.5 * given.lean_rad * rng.normal(size=3), 1.0)
        q[3:7] = turn / np.linalg.norm(turn)
        found = fitted(figure, figure.clamp(q), feet, dofs)
        return found if found is not None and is_free(alone(figure), found) else None

    witness = until_found(attempt)
    tips = TIPS if number % 2 else (TIPS[number // 2 % 2],)
    return standing_problem(floor_scene(figure), start, [point(figure, witness, tip) for tip in tips]), witness


@lru_cache(maxsize=2)
def person(number: int) -> wb.Figure:
    """One of the people of the set, women and men in turn, from short to tall."""
    given = numbers("other_people")
    low, high = given.statures_m
    stature = low + (high - low) * number / (given.people - 1)
    return wb.load("human", sex=("female", "male")[number % 2], stature=stature)


def people(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """The reach among twenty things, by other people."""
    count = numbers("other_people").people
    return reach_among(person(number % count), TIPS[number // count % 2], rng)


def clutter(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """A reach among more and other things."""
    figure = human()
    start = figure.posture("standing")
    witness = sampled_posture(figure, start, rng)
    scene = floor_scene(figure)
    add_things(scene, numbers("other_clutter").things, Occupied(figure, (start, witness)), ROOM, rng, make=_other_thing)
    return standing_problem(scene, start, [point(figure, witness, TIPS[number % 2])]), witness


def _other_thing(number: int, rng: np.random.Generator) -> tuple[str, wb.Shape]:
    """A plank, a rod, an ellipsoid or a flat hull in turn: longer and thinner than what the set of clutter has."""
    kind = ("plank", "rod", "ellipsoid", "slab")[number % 4]
    if kind == "plank":
        return kind, wb.Box(
            (float(rng.uniform(0.4, 1.0)), float(rng.uniform(0.05, 0.2)), float(rng.uniform(0.01, 0.04)))
        )
    if kind == "rod":
        return kind, wb.Capsule(float(rng.uniform(0.008, 0.02)), float(rng.uniform(0.4, 1.2)))
    if kind == "ellipsoid":
        a, b, c = rng.uniform(0.03, 0.25, 3)
        return kind, wb.Ellipsoid((float(a), float(b), float(c)))
    return kind, wb.Hull(rng.uniform(-1.0, 1.0, (20, 3)) * (*rng.uniform(0.1, 0.3, 2), rng.uniform(0.01, 0.03)))
