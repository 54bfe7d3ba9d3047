"""Reaches that take the whole body: low down or far out, on both feet and in balance."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets import bodies
from wholebody.bench.suite.problem_sets.case import numbers

given = numbers("balance")


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: a fingertip low down, one far out, both low down; sides change too."""
    figure, tip = bodies.human(), bodies.TIPS[number // 3 % 2]

    def attempt() -> tuple[list[wb.Point], Array] | None:
        goals = _goals(number % 3, tip, rng)
        equalities = [*_resolved(figure, goals), bodies.MassAbove(rng.uniform(*given.over_m))]
        found = bodies.fitted(figure, _beginning(figure, rng), equalities, bodies.movable(figure))
        if found is None or not bodies.is_free(bodies.alone(figure), found):
            return None
        return (goals, found) if _least_room(found) > given.margin_m + given.spare_m else None

    goals, witness = bodies.until_found(attempt)
    reached = [bodies.point(figure, witness, goal.frame) for goal in goals]
    start = figure.posture("standing")
    return bodies.standing_problem(
        bodies.floor_scene(figure), start, reached, wb.Balance(margin=given.margin_m)
    ), witness


def _goals(kind: int, tip: str, rng: np.random.Generator) -> list[wb.Point]:
    if kind < 2:
        return [wb.Point(tip, rng.uniform(*(given.low_m if kind == 0 else given.far_m)))]
    left, right = rng.uniform(*given.two_m), rng.uniform(*given.two_m) * (1.0, -1.0, 1.0)
    return [wb.Point("left_index_tip", left), wb.Point("right_index_tip", right)]


def _resolved(figure: wb.Figure, goals: list[wb.Point]) -> list[wb.Goal]:
    start, scene = figure.posture("standing"), bodies.alone(figure)
    feet = [wb.Frame(foot, figure.placement(start, foot)) for foot in bodies.FEET]
    return [goal.resolve(scene, start) for goal in (*goals, *feet)]


def _beginning(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """A posture (nq,) with bent legs and the upper body anyhow; the feet are not yet where they belong."""
    q = figure.posture("standing")
    bend = float(rng.uniform())
    ends = vars(given.stance_degrees).items()
    q = bodies.bent(figure, q, {name: least + bend * (most - least) for name, (least, most) in ends})
    q = bodies.shaken(figure, figure.clamp(q), given.arms, rng)
    q[2] -= 0.45 * bend
    q[:2] += rng.uniform(-0.1, 0.1, 2)
    pitch = rng.uniform(0.0, 0.6) + 0.3 * bend
    q[3:7] = 0.0, np.sin(pitch / 2.0), 0.0, np.cos(pitch / 2.0)
    return q


@lru_cache(maxsize=1)
def _support() -> wb.Balance:
    return wb.Balance().resolve(bodies.alone(bodies.human()), bodies.human().posture("standing"))


def _least_room(q: Array) -> float:
    """Distance of the centre of mass from the nearest edge of the support polygon, metres."""
    return float(_support().value(bodies.alone(bodies.human()).state(q)).min())
