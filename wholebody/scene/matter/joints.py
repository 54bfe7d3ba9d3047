"""Joints that hold a thing that moves by itself: a door on its hinge, a bag on its rope."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from wholebody.base import checks
from wholebody.base.fields import Checked, Range, Vector
from wholebody.geometry.placement import FARTHEST, unit_vector

Place = tuple[float, float, float]


@dataclass(frozen=True)
class BallJoint(Checked):
    """One point of a thing stays at one point of another, or of the world; the thing turns about it.

    A point outside of the shape makes a pendulum on a stiff rod without mass.

    Attributes:
        at: (3,) the point in the thing's axes, metres; where it is at the start is where it stays.
        to: name of the thing that holds it; None for the world. The two do not collide with each other.

    Raises:
        InputError: `at` is not three finite numbers below 1,000 km, or `to` is no name.
    """

    at: Annotated[Place, Vector(3, Range(-FARTHEST, FARTHEST, "m"))] = (0.0, 0.0, 0.0)
    to: Annotated[str, checks.text] | None = None


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

    axis: Annotated[Place, unit_vector] = (0.0, 0.0, 1.0)


def joints(value: object, what: str) -> tuple[BallJoint, ...]:
    """The joints of a body, checked.

    Raises:
        InputError: not a list of joints.
    """
    given = [value] if isinstance(value, BallJoint) else checks.listed(value, what, "[wb.dynamics.Hinge((0, 0.4, 0))]")
    for joint in given:
        checks.instance(joint, BallJoint, what, "give wb.dynamics.Hinge(...) or wb.dynamics.BallJoint(...)")
    return tuple(given)
