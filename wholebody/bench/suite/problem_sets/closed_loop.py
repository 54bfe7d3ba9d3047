"""Both hands hold one thing: a loop through the arms that must stay closed on the way and at the end."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    alone,
    bent,
    fitted,
    floor_scene,
    human,
    is_free,
    shaken,
    standing_problem,
    until_found,
)
from wholebody.bench.suite.problem_sets.case import numbers

given = numbers("closed_loop")


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn a bar and a box, brought to a place and an orientation."""
    figure = human()
    apart = float(rng.uniform(*given.apart_m))
    shape, ahead = _shape(number % 2, apart - 2.0 * given.grip_m, rng)
    middle = np.array((ahead, 0.0, 0.5 * apart))
    scene = floor_scene(figure).attach(shape, to="right_palm", name="load", at=middle)
    other = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array((0.0, 0.0, apart)))
    q = bent(figure, figure.posture("standing"), vars(given.bent_degrees))

    def level() -> Array | None:
        """The thing held level before the belly, elbows anyhow, (nq,)."""
        near = shaken(figure, q, 0.5 * given.spread, rng)
        return _holding(scene, near, other, np.array(given.level), np.array(given.start_m), middle)

    def turned() -> Array | None:
        turn = pin.exp3(rng.uniform(-given.turned_rad, given.turned_rad, 3)) @ np.array(given.level)
        near = shaken(figure, start, given.spread, rng)
        return _holding(scene, near, other, turn, rng.uniform(*given.middle_m), middle)

    start = until_found(level)
    witness = until_found(turned)
    goals = [wb.Frame("right_palm", figure.placement(witness, "right_palm"))]
    grip = wb.Hold("left_palm", other, relative_to="right_palm")
    return standing_problem(scene, start, goals, grip), witness


def _shape(kind: int, length: float, rng: np.random.Generator) -> tuple[wb.Shape, float]:
    """What is held, and how far ahead of the palms its middle is."""
    if kind == 0:
        return wb.Capsule(given.thick_m, length - 2.0 * given.thick_m), 0.0
    height, depth = (float(edge) for edge in rng.uniform(*given.box_m))
    return wb.Box((depth, height, length)), 0.5 * depth - given.behind_m


def _holding(scene: wb.Scene, q: Array, other: pin.SE3, turn: Array, place: Array, middle: Array) -> Array | None:
    """The posture near q, (nq,), with the thing's middle at a place, held by both hands; None where it is not free."""
    figure = scene.figure
    goals = [
        wb.Frame("right_palm", pin.SE3(turn, place - turn @ middle)),
        wb.Relative("left_palm", "right_palm", other),
    ]
    found = fitted(figure, q, [goal.resolve(alone(figure), q) for goal in goals], figure.dofs("upper_body"))
    return found if found is not None and is_free(scene, found) else None
