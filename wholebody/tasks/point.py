"""Goal: a point of the figure at a position."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State, Wrench
from wholebody.tasks import inputs
from wholebody.tasks.base import Goal, Surroundings, filled
from wholebody.tasks.residuals import point_rows


@dataclass(frozen=True, eq=False)
class Point(Goal):
    """Move a point of a frame to a position; the orientation is free.

    The error is the position of the point minus the target, in world axes [m].

    Attributes:
        frame: name of the frame, segment or joint.
        target: (3,) position in the world [m].
        offset: (3,) the point in the frame's own axes [m].
        weight: factor on the squared error [1/m^2].
        place: the frame and the joint that carries it, once resolved.
        resolved_target: (3,) `target` as an array [m].
        resolved_offset: (3,) `offset` as an array [m].

    Raises:
        InputError: a value is not finite, of the wrong shape or not in metres.
    """

    frame: str
    target: inputs.Position
    _: KW_ONLY
    offset: inputs.Position = (0.0, 0.0, 0.0)
    weight: inputs.Weight = 1.0
    place: inputs.Place = field(init=False, repr=False)
    resolved_target: Array = field(init=False, repr=False)
    resolved_offset: Array = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Point:
        """Find the frame."""
        return filled(self, place=inputs.find_place(scene, self.frame, "Point"))

    @property
    def angular(self) -> Mask:
        """(3,) no row is in radians."""
        return np.zeros(3, dtype=bool)

    def error(self, state: State) -> Array:
        """(3,) from the target to the point [m]."""
        return np.asarray(state.frame(self.place.frame).act(self.resolved_offset) - self.resolved_target)

    def jacobian(self, state: State) -> Wrench:
        """Three forces along the world's axes, through the point."""
        return Wrench(point_rows(state.frame(self.place.frame).act(self.resolved_offset)), self.place.joint)
