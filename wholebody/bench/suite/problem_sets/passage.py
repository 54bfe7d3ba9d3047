"""A hand through a window in a board, or between two boards, little wider than what has to pass."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    ROOM,
    alone,
    floor_scene,
    human,
    is_free,
    point,
    shaken,
    standing_problem,
    until_found,
)
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.bench.suite.problem_sets.fitting import fitted
from wholebody.bench.suite.problem_sets.things import Occupied

GAP = (0.008, 0.020)  # m: what a window leaves free on every side of the hand and forearm
HALF = (0.045, 0.035)  # m: half the breadth of a hand, half the thickness of a forearm
WIDE = 0.22  # m: of the board on every side of its window
DEEP = (0.15, 0.30)  # m: of two boards, along the way between them
THICK = 0.02  # m: of all boards
PAST_WRIST = (-0.12, 0.04)  # m: from the wrist to the window, along the forearm; negative is behind the wrist
PLACE = ((0.30, -0.05, 0.90), (0.60, 0.40, 1.45))  # m: of the wrist, for the left hand
TURN, RISE, ROLL = 0.6, 0.4, 1.6  # rad: most that the way is turned from straight ahead, and rolled about itself
SPREAD = 0.3  # share of the range of every joint of the upper body that a witness may begin with
BEGIN = {"shoulder_flexion": 40.0, "shoulder_abduction": 20.0, "elbow_flexion": 60.0}  # degrees


def _posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn a window and two boards; left and right in turn of two."""
    figure, side = human(), ("left", "right")[number // 2 % 2]
    start = figure.posture("standing")
    begin = figure.with_joints(start, {f"{side}_{name}": np.radians(angle) for name, angle in BEGIN.items()})
    standing = Occupied(figure, (start,))

    def attempt() -> tuple[Array, list[tuple[wb.Box, pin.SE3]]] | None:
        wrist = _wrist(side, rng)
        boards = _boards(number % 2, wrist, rng)
        goal = wb.Frame(f"{side}_hand", wrist).resolve(alone(figure), start)
        witness = fitted(figure, shaken(figure, begin, SPREAD, rng), [goal], figure.dofs("upper_body"))
        if witness is None or not is_free(alone(figure), witness):
            return None
        taken = standing, Occupied(figure, (witness,))
        clear = all(body.clear_of(board, at, ROOM) for body in taken for board, at in boards)
        return (witness, boards) if clear else None

    witness, boards = until_found(attempt)
    scene = floor_scene(figure)
    for count, (board, at) in enumerate(boards):
        scene.add(board, name=f"board {count}", at=at)
    return standing_problem(scene, start, [point(figure, witness, f"{side}_index_tip")]), witness


def _wrist(side: str, rng: np.random.Generator) -> pin.SE3:
    """Where the hand segment is when it is through: its -z is the way, its x the breadth, its y the thickness."""
    out = 1.0 if side == "left" else -1.0
    place = rng.uniform(*PLACE) * (1.0, out, 1.0)
    turn, rise = rng.uniform(-TURN, TURN), rng.uniform(-RISE, RISE)
    way = np.array((np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)))
    level = np.cross((0.0, 0.0, 1.0), way)
    level /= np.linalg.norm(level)
    upright = np.column_stack([np.cross(way, level), level, -way])
    roll = out * rng.uniform(-0.3, ROLL)
    return pin.SE3(upright @ pin.exp3(np.array((0.0, 0.0, roll))), place)


def _boards(kind: int, wrist: pin.SE3, rng: np.random.Generator) -> list[tuple[wb.Box, pin.SE3]]:
    """Four boards around a window, or two on both sides of a slot, where the hand and the forearm go through."""
    half = np.array(HALF) + rng.uniform(*GAP, 2)
    past = float(rng.uniform(*PAST_WRIST))
    if kind == 1:
        deep = float(rng.uniform(*DEEP))
        across, along = 2.0 * (half[0] + WIDE), past + 0.5 * deep - 0.1
        middles = [(0.0, sign * (half[1] + 0.5 * THICK), -along) for sign in (-1.0, 1.0)]
        return [(wb.Box((across, THICK, deep)), wrist * _at(middle)) for middle in middles]
    boards = []
    for sign in (-1.0, 1.0):
        boards.append((wb.Box((WIDE, 2.0 * (half[1] + WIDE), THICK)), (sign * (half[0] + 0.5 * WIDE), 0.0, -past)))
        boards.append((wb.Box((2.0 * half[0], WIDE, THICK)), (0.0, sign * (half[1] + 0.5 * WIDE), -past)))
    return [(board, wrist * _at(middle)) for board, middle in boards]


def _at(middle: tuple[float, float, float]) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(middle))


SET = ProblemSet(
    "passage",
    "narrow passage",
    "A standing person puts a fingertip through a window in a board, or between two boards, 8 to 20 mm wider on every "
    "side than the hand and forearm that have to follow.",
    _posed,
)
