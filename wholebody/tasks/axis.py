"""Goal: an axis of a frame along a direction or towards a point, such as a gaze, a palm, or the barrel of a tool.

Let t1 and t2 be two directions perpendicular to the axis a, all fixed to the frame, and d the target direction. With x
= (t1 . d, t2 . d), s its length, c = a . d and theta = atan2(s, c), the error is theta x / s: the angle, resolved along
t1 and t2. This is the azimuthal equidistant projection of the sphere (Snyder 1987, "Map Projections: A Working Manual",
chapter 25). Its derivative along the error is 1 at every angle, so no angle is stationary; across the error it is theta
/ s.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from math import atan2, hypot, pi, sin, sqrt
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import settle
from wholebody.base.errors import InputError
from wholebody.base.fields import called
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import GoalOrConstraint, filled

STEEPEST = pi / sin(pi / 180.0)
"""Largest derivative across the error, reached one degree before the opposite direction.

The exact derivative is infinite at the opposite direction. The cap keeps the rows in a range that QP solvers handle.
The gradient of the squared error stays exact, because it has no component across the error.
"""

NO_ANGLE = 1e-12  # Sine below which the error has no direction of its own, so the first of the two is taken

TOUCHING = 1e-6  # Distance [m] below which a point has no direction from the frame; the goal then counts as met


@dataclass(frozen=True, eq=False)
class Axis(GoalOrConstraint):
    """Turn an axis of a frame into a direction, or point it towards a point; rotation about the axis is free.

    Use it as a goal, or as a constraint that always holds, such as for a tray that stays level.

    The error has two rows; its norm is the angle between the axis and the target direction, from 0 to pi [rad]. If the
    axis has exactly the opposite direction, the figure turns about a fixed direction of the frame.

    Attributes:
        frame: name of the frame, segment or joint.
        axis: (3,) the axis in the frame, such as (1, 0, 0); any length.
        direction: (3,) its target direction in the world; any length. One of direction and toward is given.
        toward: (3,) the point in the world to which it should point from the frame's origin [m]; from nearer than
            1e-6 m there is no direction, and the error is zero.
        weight: factor on the squared error [1/rad^2].
        basis: (3, 3) rows in the frame: two directions perpendicular to the axis, and the axis, each of length 1.

    Raises:
        InputError: neither or both of `direction` and `toward`.

    Examples:
        >>> look = wb.Axis("gaze", (1, 0, 0), toward=(0.55, -0.25, 0.95))
    """

    angular = np.ones((), dtype=bool)  # of both rows
    frame: str
    axis: inputs.Direction
    _: KW_ONLY
    direction: inputs.Direction | None = None
    toward: inputs.Position | None = None
    weight: inputs.Weight = 1.0
    basis: Array = field(init=False, repr=False)
    resolved_target: Array = field(init=False, repr=False)  # (3,) `direction` as a unit vector, or `toward` [m]
    place: inputs.Place = field(init=False, repr=False)  # the frame and the joint that carries it

    def __post_init__(self) -> None:
        """Check the values."""
        if (self.direction is None) == (self.toward is None):
            raise InputError(f"{called(self)} takes either a direction or a place to point toward; give one of the two")
        super().__post_init__()
        settle(self, "basis", across(np.asarray(self.axis)))
        settle(self, "resolved_target", self.toward if self.direction is None else self.direction)

    def resolve(self, scene: Scene, start: Array) -> Axis:
        """Find the frame."""
        return filled(self, place=inputs.find_place(scene, self.frame, "Axis"))

    def error(self, state: State) -> Array:
        """(2,) the angle along the two directions perpendicular to the axis [rad]."""
        frame = state.frame(self.place.frame)
        direction, distance = self._way(frame)
        if distance < TOUCHING:
            return np.zeros(2)
        return equidistant_error(*(self.basis @ (direction @ frame.rotation)).tolist())

    def jacobian(self, state: State) -> Wrench:
        """Two rows: moments, and also forces if the direction depends on the frame's position."""
        frame = state.frame(self.place.frame)
        direction, distance = self._way(frame)
        if distance < TOUCHING:
            return Wrench(np.zeros((2, 6)), self.place.joint)
        axes = self.basis @ frame.rotation.T
        on_direction = equidistant_jacobian(*(axes @ direction).tolist()) @ axes
        rows = np.zeros((2, 6))
        rows[:, 3:] = on_direction @ pin.skew(direction)
        if self.toward is not None:
            # The direction turns as the frame's origin moves: d' = -(1 - d d') v / distance, and v = v_o - p x w.
            move = (np.outer(on_direction @ direction, direction) - on_direction) / distance
            rows[:, :3] = move
            rows[:, 3:] -= move @ pin.skew(frame.translation)
        return Wrench(rows, self.place.joint)

    def _way(self, frame: Any) -> tuple[Array, float]:
        """Target direction as a unit vector, and the distance of the target point; inf for a direction."""
        if self.toward is None:
            return self.resolved_target, np.inf
        way = self.resolved_target - frame.translation
        distance = float(np.sqrt(way @ way))
        return way / max(distance, TOUCHING), distance


def equidistant_error(x: float, y: float, along: float) -> Array:
    """(2,) angle [rad] between a unit direction, by its components along t1, t2 and the axis, and the axis."""
    sine = hypot(x, y)
    angle = atan2(sine, along)
    return np.array((angle, 0.0)) if sine < NO_ANGLE else np.array((x, y)) * (angle / sine)


def equidistant_jacobian(x: float, y: float, along: float) -> Array:
    """(2, 3) derivative of `equidistant_error`, for changes that keep the length 1."""
    # theta' = c s' - s c', and (x / s)' is the part of x' across x, over s: at most `STEEPEST` across the error.
    sine = hypot(x, y)
    at_an_end = 1.0 if along > 0.0 else STEEPEST
    gain = at_an_end if sine < NO_ANGLE else min(atan2(sine, along) / sine, STEEPEST)
    ux, uy = (x / sine, y / sine) if sine > NO_ANGLE else (1.0, 0.0)
    fall = along - gain
    return np.array(((gain + fall * ux * ux, fall * ux * uy, -x), (fall * ux * uy, gain + fall * uy * uy, -y)))


def across(axis: Array) -> Array:
    """(3, 3) rows: two directions perpendicular to a unit vector, and the vector itself."""
    x, y, z = axis.tolist()
    sizes = abs(x), abs(y), abs(z)
    # the axis times the coordinate axis that is farthest from it
    a, b, c = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))[sizes.index(min(sizes))]
    length = sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    return np.array(((a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a), (x, y, z)))
