"""Both hands hold one thing: a loop through the arms that must stay closed on the way and at the end."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    alone,
    floor_scene,
    human,
    is_free,
    shaken,
    standing_problem,
    until_found,
)
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.bench.suite.problem_sets.fitting import fitted

GRIP = 0.006  # m: between a palm and what it holds; more than the clearance, so that the witness has room
APART = (0.22, 0.55)  # m: from palm to palm
THICK = 0.016  # m: radius of a bar
BOX = ((0.12, 0.10), (0.30, 0.24))  # m: height and depth of a box
BEHIND = 0.02  # m: how far a box reaches behind the middle of the palms
MIDDLE = ((0.22, -0.25, 0.75), (0.55, 0.25, 1.50))  # m: where the middle of the thing is asked to be
AT_START = (0.36, 0.0, 1.05)  # m: and where it is at the start
TURNED = 0.7  # rad: most that the bar turns from level and square
SPREAD = 0.25  # share of the range of every joint of the upper body, around how it starts, that a witness begins with
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""The right palm's axes where it faces left with the fingers forward."""
BENT = {"elbow_flexion": 85.0, "shoulder_rotation": 18.0, "wrist_flexion": -18.0}  # degrees


def _posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn a bar and a box, brought to a place and an orientation."""
    figure = human()
    apart = float(rng.uniform(*APART))
    shape, ahead = _shape(number % 2, apart - 2.0 * GRIP, rng)
    middle = np.array((ahead, 0.0, 0.5 * apart))
    scene = floor_scene(figure).attach(shape, to="right_palm", name="load", at=middle)
    other = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array((0.0, 0.0, apart)))
    bent = {f"{side}_{name}": np.radians(angle) for side in ("left", "right") for name, angle in BENT.items()}
    q = figure.with_joints(figure.posture("standing"), bent)

    def level() -> Array | None:
        """The thing held level before the belly, elbows anyhow, (nq,)."""
        near = shaken(figure, q, 0.5 * SPREAD, rng)
        return _holding(scene, near, other, LEVEL, np.array(AT_START), middle)

    def turned() -> Array | None:
        turn = pin.exp3(rng.uniform(-TURNED, TURNED, 3)) @ LEVEL
        return _holding(scene, shaken(figure, start, SPREAD, rng), other, turn, rng.uniform(*MIDDLE), middle)

    start = until_found(level)
    witness = until_found(turned)
    goals = [wb.Frame("right_palm", figure.placement(witness, "right_palm"))]
    grip = wb.Hold("left_palm", other, relative_to="right_palm")
    return standing_problem(scene, start, goals, grip), witness


def _shape(kind: int, length: float, rng: np.random.Generator) -> tuple[wb.Shape, float]:
    """What is held, and how far ahead of the palms its middle is."""
    if kind == 0:
        return wb.Capsule(THICK, length - 2.0 * THICK), 0.0
    height, depth = (float(edge) for edge in rng.uniform(*BOX))
    return wb.Box((depth, height, length)), 0.5 * depth - BEHIND


def _holding(scene: wb.Scene, q: Array, other: pin.SE3, turn: Array, place: Array, middle: Array) -> Array | None:
    """The posture near q, (nq,), with the thing's middle at a place, held by both hands; None where it is not free."""
    figure = scene.figure
    goals = [
        wb.Frame("right_palm", pin.SE3(turn, place - turn @ middle)),
        wb.Relative("left_palm", "right_palm", other),
    ]
    found = fitted(figure, q, [goal.resolve(alone(figure), q) for goal in goals], figure.dofs("upper_body"))
    return found if found is not None and is_free(scene, found) else None


SET = ProblemSet(
    "closed_loop",
    "closed loop",
    "A standing person who holds a bar or a box in both hands brings it to a place and an orientation; the hands keep "
    "their grip all the way, so both arms and the thing are one closed loop.",
    _posed,
)
