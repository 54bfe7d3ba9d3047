"""Reaches that take the whole body: low down or far out, on both feet and in balance."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    FEET,
    TIPS,
    alone,
    floor_scene,
    human,
    is_free,
    movable,
    point,
    shaken,
    standing_problem,
    until_found,
)
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.bench.suite.problem_sets.fitting import MassAbove, fitted

MARGIN = 0.02  # m: asked of the centre of mass from the edges of the support polygon
SPARE = 0.005  # m: what the witness has beyond that
LOW = ((0.10, -0.45, 0.03), (0.65, 0.45, 0.35))  # m: where a fingertip is asked to be, near the floor
FAR = ((0.60, -0.50, 0.50), (0.95, 0.50, 1.40))  # m: and out in front
TWO = ((0.15, 0.00, 0.05), (0.60, 0.35, 0.60))  # m: and the left of two; the right one is on the other side
OVER = ((-0.04, -0.08), (0.16, 0.08))  # m: where the witness has its centre of mass, seen from above
STANCE = {"hip_flexion": (0.0, 110.0), "knee_flexion": (5.0, 130.0), "ankle_dorsiflexion": (0.0, 33.0)}
"""Degrees that the legs begin with before the feet are put on their places."""
ARMS = 0.35  # share of the range of every joint of the upper body, around how it stands, to begin with


def _posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn: a fingertip low down, one far out, both low down; sides change too."""
    figure, tip = human(), TIPS[number // 3 % 2]

    def attempt() -> tuple[list[wb.Point], Array] | None:
        goals = _goals(number % 3, tip, rng)
        equalities = [*_resolved(figure, goals), MassAbove(rng.uniform(*OVER))]
        found = fitted(figure, _beginning(figure, rng), equalities, movable(figure))
        good = found is not None and is_free(alone(figure), found) and _least_room(found) > MARGIN + SPARE
        return (goals, found) if found is not None and good else None

    goals, witness = until_found(attempt)
    reached = [point(figure, witness, goal.frame) for goal in goals]
    start = figure.posture("standing")
    return standing_problem(floor_scene(figure), start, reached, wb.Balance(margin=MARGIN)), witness


def _goals(kind: int, tip: str, rng: np.random.Generator) -> list[wb.Point]:
    if kind < 2:
        return [wb.Point(tip, rng.uniform(*(LOW if kind == 0 else FAR)))]
    left, right = rng.uniform(*TWO), rng.uniform(*TWO) * (1.0, -1.0, 1.0)
    return [wb.Point("left_index_tip", left), wb.Point("right_index_tip", right)]


def _resolved(figure: wb.Figure, goals: list[wb.Point]) -> list[wb.Goal]:
    start, scene = figure.posture("standing"), alone(figure)
    feet = [wb.Frame(foot, figure.placement(start, foot)) for foot in FEET]
    return [goal.resolve(scene, start) for goal in (*goals, *feet)]


def _beginning(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """A posture (nq,) with bent legs and the upper body anyhow; the feet are not yet where they belong."""
    q = figure.posture("standing")
    bend = float(rng.uniform())
    values: dict[str, float] = {}
    for name, (least, most) in STANCE.items():
        angle = np.radians(least + bend * (most - least))
        values |= {f"{side}_{name}": angle for side in ("left", "right")}
    q = shaken(figure, figure.clamp(figure.with_joints(q, values)), ARMS, rng)
    q[2] -= 0.45 * bend
    q[:2] += rng.uniform(-0.1, 0.1, 2)
    pitch = rng.uniform(0.0, 0.6) + 0.3 * bend
    q[3:7] = 0.0, np.sin(pitch / 2.0), 0.0, np.cos(pitch / 2.0)
    return q


@lru_cache(maxsize=1)
def _support() -> wb.Balance:
    return wb.Balance().resolve(alone(human()), human().posture("standing"))


def _least_room(q: Array) -> float:
    """Distance of the centre of mass from the nearest edge of the support polygon, metres."""
    return float(_support().value(alone(human()).state(q)).min())


SET = ProblemSet(
    "balance",
    "balance",
    "A standing person reaches low down or far out with one hand or both, feet held, the centre of mass kept above "
    "the feet: the legs have to bend and the pelvis to give way.",
    _posed,
)
