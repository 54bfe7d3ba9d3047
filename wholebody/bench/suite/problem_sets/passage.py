"""A hand through a window in a board, or between two boards, little wider than what has to pass."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.bodies import (
    ROOM,
    alone,
    bent,
    fitted,
    floor_scene,
    human,
    is_free,
    point,
    shaken,
    standing_problem,
    until_found,
)
from wholebody.bench.suite.problem_sets.case import numbers
from wholebody.bench.suite.problem_sets.things import Occupied

given = numbers("passage")


def posed(number: int, rng: np.random.Generator) -> tuple[wb.Problem, Array]:
    """In turn a window and two boards; left and right in turn of two."""
    figure, side = human(), ("left", "right")[number // 2 % 2]
    start = figure.posture("standing")
    begin = bent(figure, start, vars(given.begin_degrees), [side])
    standing = Occupied(figure, (start,))

    def attempt() -> tuple[Array, list[tuple[wb.Box, pin.SE3]]] | None:
        wrist = _wrist(side, rng)
        boards = _boards(number % 2, wrist, rng)
        goal = wb.Frame(f"{side}_hand", wrist).resolve(alone(figure), start)
        witness = fitted(figure, shaken(figure, begin, given.spread, rng), [goal], figure.dofs("upper_body"))
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
    place = rng.uniform(*given.place_m) * (1.0, out, 1.0)
    turn, rise = rng.uniform(-given.turn_rad, given.turn_rad), rng.uniform(-given.rise_rad, given.rise_rad)
    way = np.array((np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)))
    level = np.cross((0.0, 0.0, 1.0), way)
    level /= np.linalg.norm(level)
    upright = np.column_stack([np.cross(way, level), level, -way])
    roll = out * rng.uniform(-0.3, given.roll_rad)
    return pin.SE3(upright @ pin.exp3(np.array((0.0, 0.0, roll))), place)


def _boards(kind: int, wrist: pin.SE3, rng: np.random.Generator) -> list[tuple[wb.Box, pin.SE3]]:
    """Four boards around a window, or two on both sides of a slot, where the hand and the forearm go through."""
    narrow, broad = given.gap_m
    half = np.array(given.half_m) + rng.uniform(narrow, broad, 2)
    past, wide, thick = float(rng.uniform(*given.past_wrist_m)), given.wide_m, given.thick_m
    if kind == 1:
        deep = float(rng.uniform(*given.deep_m))
        across, along = 2.0 * (half[0] + wide), past + 0.5 * deep - 0.1
        middles = [(0.0, sign * (half[1] + 0.5 * thick), -along) for sign in (-1.0, 1.0)]
        return [(wb.Box((across, thick, deep)), wrist * _at(middle)) for middle in middles]
    boards = []
    for sign in (-1.0, 1.0):
        boards.append((wb.Box((wide, 2.0 * (half[1] + wide), thick)), (sign * (half[0] + 0.5 * wide), 0.0, -past)))
        boards.append((wb.Box((2.0 * half[0], wide, thick)), (0.0, sign * (half[1] + 0.5 * wide), -past)))
    return [(board, wrist * _at(middle)) for board, middle in boards]


def _at(middle: tuple[float, float, float]) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(middle))
