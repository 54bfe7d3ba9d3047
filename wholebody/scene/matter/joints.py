"""Joints that hold a thing that moves by itself: a door on its hinge, a bag on its rope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.geometry.placement import FARTHEST

Place = tuple[float, float, float]


@dataclass(frozen=True)
class BallJoint:
    """One point of a thing stays at one point of another, or of the world; the thing turns about it.

    A point outside of the shape makes a pendulum on a stiff rod without mass.

    Attributes:
        at: (3,) the point in the thing's axes, metres; where it is at the start is where it stays.
        to: name of the thing that holds it; None for the world. The two do not collide with each other.

    Raises:
        InputError: `at` is not three finite numbers below 1,000 km, or `to` is no name.
    """

    at: Place = (0.0, 0.0, 0.0)
    to: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _place(self.at, f"{type(self).__name__} at"))
        if self.to is not None:
            checks.text(self.to, f"{type(self).__name__} to")


@dataclass(frozen=True)
class Hinge(BallJoint):
    """A thing turns about one axis, as a door does.

    Attributes:
        at: (3,) a point of the axis, in the thing's axes, metres.
        to: name of the thing that holds it; None for the world. The two do not collide with each other.
        axis: (3,) direction of the axis in the thing's axes.

    Raises:
        InputError: also if the axis has no direction.
    """

    axis: Place = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        axis = checks.numbers(self.axis, (3,), "Hinge axis")
        largest = float(np.abs(axis).max())
        length = float(np.linalg.norm(axis)) if largest < 1e9 else np.inf
        if not 1e-9 < length < 1e9:
            raise InputError(f"Hinge axis is {checks.shown(self.axis)}; give a direction such as (0, 0, 1)")
        object.__setattr__(self, "axis", tuple(float(x) for x in axis / length))


def _place(value: object, what: str) -> Place:
    numbers = checks.numbers(value, (3,), what)
    if np.abs(numbers).max() > FARTHEST:
        raise InputError(f"{what} is {checks.shown(value)}; give at most {FARTHEST:g} m")
    x, y, z = (float(x) for x in numbers)
    return x, y, z


def joints(value: object) -> tuple[BallJoint, ...]:
    """The joints of a body, checked.

    Raises:
        InputError: not a list of joints.
    """
    given = (
        [value]
        if isinstance(value, BallJoint)
        else checks.listed(value, "Body joints", "[wb.dynamics.Hinge((0, 0.4, 0))]")
    )
    for joint in given:
        checks.instance(joint, BallJoint, "Body joints", "give wb.dynamics.Hinge(...) or wb.dynamics.BallJoint(...)")
    return tuple(given)
