"""The person of the sets, and random postures in which nothing touches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError

ROOM = 0.005  # m: what limbs and things leave free in a witness, and things at the start
CLEARANCE = 0.002  # m: what is asked of an answer
TIPS = ("right_index_tip", "left_index_tip")
FEET = ("left_foot", "right_foot")


_Found = TypeVar("_Found")


@lru_cache(maxsize=1)
def human() -> wb.Figure:
    """The person, loaded once."""
    return wb.load("human")


@lru_cache(maxsize=8)
def alone(figure: wb.Figure) -> wb.Scene:
    """A figure on the floor and nothing else, to ask whether postures are free; never part of a case."""
    return floor_scene(figure)


def floor_scene(figure: wb.Figure) -> wb.Scene:
    """A fresh scene of a figure on the floor."""
    return wb.Scene(figure).add(wb.HalfSpace(), name="floor")


def is_free(scene: wb.Scene, q: Array, room: float = ROOM) -> bool:
    """Whether nothing but the soles on the floor is nearer than `room`, metres, in the posture q, shape (nq,)."""
    owners = scene.piece_owner
    soles = {frozenset(("floor", name)) for name in (*FEET, "left_toes", "right_toes")}
    return all(frozenset((owners[a], owners[b])) in soles for a, b in scene.contacts(q, within=room).pair)


def sampled_posture(figure: wb.Figure, start: Array, rng: np.random.Generator) -> Array:
    """Posture (nq,) with the upper body uniformly at random within its limits, nothing touching itself or the floor.

    Raises:
        InputError: none was found.
    """
    joints = figure.groups["upper_body"]
    places = np.array([figure.model.joints[figure.joint_id(name)].idx_q for name in joints])
    lower, upper = figure.model.lowerPositionLimit[places], figure.model.upperPositionLimit[places]

    def sampled() -> Array | None:
        q = np.array(start)
        q[places] = rng.uniform(lower, upper)
        return q if is_free(alone(figure), q) else None

    return until_found(sampled)


def until_found(attempt: Callable[[], _Found | None]) -> _Found:
    """What an attempt gives, made again until it gives something.

    Raises:
        InputError: it never did.
    """
    for _ in range(5000):  # about one in five of the postures of a person's upper body is free
        found = attempt()
        if found is not None:
            return found
    raise InputError("none of 5000 postures is free; give another seed")


def shaken(figure: wb.Figure, q: Array, share: float, rng: np.random.Generator) -> Array:
    """The posture q, (nq,), with each joint of the upper body off by at most a share of its range."""
    model = figure.model
    values = {}
    for name in figure.groups["upper_body"]:
        place = model.joints[figure.joint_id(name)].idx_q
        low, high = model.lowerPositionLimit[place], model.upperPositionLimit[place]
        reach = share * (high - low)
        values[name] = float(np.clip(q[place] + float(rng.uniform(-reach, reach)), low, high))
    return figure.clamp(figure.with_joints(q, values))


def bent(figure: wb.Figure, q: Array, degrees: Mapping[str, float], sides: Sequence[str] = ("left", "right")) -> Array:
    """The posture q, (nq,), with joints of one side or both at angles by the joints' names without the side."""
    angles = {f"{side}_{name}": np.radians(angle) for side in sides for name, angle in degrees.items()}
    return figure.with_joints(q, angles)


def movable(figure: wb.Figure) -> NDArray[np.intp]:
    """Places in the tangent of all but the toes, which stay on the floor with their feet."""
    toes = figure.dofs([name for name in figure.joints if "toe" in name])
    return np.setdiff1d(np.arange(figure.model.nv), toes)


def standing_problem(
    scene: wb.Scene, start: Array, goals: Sequence[wb.Goal], *constraints: wb.Constraint
) -> wb.Problem:
    """What is asked of a person: both feet stay where they are at the start (nq,), and all pairs `CLEARANCE` apart.

    What a person keeps by default is left out: most tools cannot be told of it, and known answers do not keep it.
    """
    feet = [wb.Hold(foot) for foot in FEET]
    return wb.Problem(
        scene, start, goals=goals, constraints=[*constraints, *feet], clearance=CLEARANCE,
        range_of_motion=False, balance=False,
    )  # fmt: skip


def point(figure: wb.Figure, q: Array, frame: str) -> wb.Point:
    """The goal that a frame is where the posture q, (nq,), has it."""
    return wb.Point(frame, figure.placement(q, frame).translation)
