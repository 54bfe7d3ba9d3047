"""Both hands hold one thing: a loop through the arms that must stay closed on the way and at the end."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.problem_sets.bodies import (
    ATTEMPTS,
    CLEARANCE,
    alone,
    floor_scene,
    held_feet,
    human,
    is_free,
    place_of,
    shaken,
)
from wholebody.bench.problem_sets.case import Case, ProblemSet, generator
from wholebody.bench.problem_sets.fitting import fitted
from wholebody.errors import InputError

NAME = "closed_loop"
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


def make(number: int, seed: int) -> Case:
    """In turn a bar and a box, brought to a place and an orientation."""
    rng, figure = generator(NAME, number, seed), human()
    apart = float(rng.uniform(*APART))
    shape, ahead = _shape(number % 2, apart - 2.0 * GRIP, rng)
    middle = np.array((ahead, 0.0, 0.5 * apart))
    scene = floor_scene(figure).attach(shape, to="right_palm", name="load", at=middle)
    other = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array((0.0, 0.0, apart)))
    start = _start(figure, scene, other, middle, rng)
    for _ in range(ATTEMPTS):
        turn = pin.exp3(rng.uniform(-TURNED, TURNED, 3)) @ LEVEL
        witness = _holding(figure, shaken(figure, start, SPREAD, rng), other, turn, rng.uniform(*MIDDLE), middle)
        if witness is not None and is_free(scene, witness):
            break
    else:
        raise InputError(f"no posture of {ATTEMPTS} is free; give another seed")
    problem = wb.Problem(
        scene,
        start,
        goals=[wb.Frame("right_palm", place_of(figure, witness, "right_palm"))],
        constraints=[wb.Hold("left_palm", other, relative_to="right_palm"), *held_feet()],
        clearance=CLEARANCE,
    )
    return Case(NAME, number, problem, witness)


def _shape(kind: int, length: float, rng: np.random.Generator) -> tuple[wb.Shape, float]:
    """What is held, and how far ahead of the palms its middle is."""
    if kind == 0:
        return wb.Capsule(THICK, length - 2.0 * THICK), 0.0
    height, depth = (float(edge) for edge in rng.uniform(*BOX))
    return wb.Box((depth, height, length)), 0.5 * depth - BEHIND


def _start(figure: wb.Figure, scene: wb.Scene, other: pin.SE3, middle: Array, rng: np.random.Generator) -> Array:
    """The thing held level before the belly, elbows anyhow, (nq,)."""
    bent = {f"{side}_{name}": np.radians(angle) for side in ("left", "right") for name, angle in BENT.items()}
    q = figure.with_joints(figure.posture("standing"), bent)
    for _ in range(ATTEMPTS):
        start = _holding(figure, shaken(figure, q, 0.5 * SPREAD, rng), other, LEVEL, np.array(AT_START), middle)
        if start is not None and is_free(scene, start):
            return start
    raise InputError(f"none of {ATTEMPTS} ways to hold it is free; give another seed")


def _holding(figure: wb.Figure, q: Array, other: pin.SE3, turn: Array, place: Array, middle: Array) -> Array | None:
    """The posture near q, (nq,), with the thing's middle at a place, held by both hands."""
    goals = [
        wb.Frame("right_palm", pin.SE3(turn, place - turn @ middle)),
        wb.Relative("left_palm", "right_palm", other),
    ]
    scene = alone(figure)
    return fitted(figure, q, [goal.resolve(scene, q) for goal in goals], figure.dofs("upper_body"))


SET = ProblemSet(
    NAME,
    "closed loop",
    "A standing person who holds a bar or a box in both hands brings it to a place and an orientation; the hands keep "
    "their grip all the way, so both arms and the thing are one closed loop.",
    make,
)
