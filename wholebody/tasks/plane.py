"""Constraint: a frame in a plane, or on one side of it."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State, Wrench
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Surroundings, filled


@dataclass(frozen=True, eq=False)
class Plane(Constraint):
    """Keep the origin of a frame or joint in a plane.

    The value is the distance (x - p) . n from the plane [m]. An elbow or a wrist that may leave its path only sideways
    moves in the plane through its position, normal to the direction of its path (eqs. 3.2 and 3.3 of the thesis on
    collision avoidance in motion capture clips, there squared and compared with a tolerance).

    Attributes:
        frame: name of the frame, segment or joint.
        normal: (3,) direction normal to the plane, in the world; any length.
        point: (3,) a point in the plane [m]; None for the frame's position at the start.
        side: "on" keeps it in the plane, "above" lets it move to the side to which the normal points.
        resolved_normal: (3,) `normal` as a unit vector.
        place: the frame and the joint that carries it, once resolved.
        height: n . p of the plane, its distance from the world's origin along the normal [m]; once resolved.

    Raises:
        InputError: the normal has no direction, the point is not in metres, or the side is another word.
    """

    frame: str
    normal: inputs.Direction
    _: KW_ONLY
    point: inputs.Position | None = None
    side: Literal["on", "above"] = "on"
    resolved_normal: Array = field(init=False, repr=False)
    resolved_point: Array | None = field(init=False, repr=False, default=None)
    place: inputs.Place = field(init=False, repr=False)
    height: float = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Plane:
        """Find the frame, and the plane through its position at the start."""
        place = inputs.find_place(scene, self.frame, "Plane")
        point = self.resolved_point
        if point is None:
            point = State(scene.model).update(start).frame(place.frame).translation
        return filled(self, place=place, height=float(self.resolved_normal @ point))

    @property
    def lower(self) -> Array:
        """(1,) zero."""
        return np.zeros(1)

    @property
    def upper(self) -> Array:
        """(1,) zero, or inf for one side."""
        return np.zeros(1) if self.side == "on" else np.full(1, np.inf)

    @property
    def angular(self) -> Mask:
        """(1,) the row is not in radians."""
        return np.zeros(1, dtype=bool)

    def value(self, state: State) -> Array:
        """(1,) distance from the plane [m]."""
        return np.array((self.resolved_normal @ state.frame(self.place.frame).translation - self.height,))

    def jacobian(self, state: State) -> Wrench:
        """One force along the normal."""
        x, y, z = state.frame(self.place.frame).translation.tolist()
        a, b, c = self.resolved_normal.tolist()
        return Wrench(np.array(((a, b, c, y * c - z * b, z * a - x * c, x * b - y * a),)), self.place.joint)
