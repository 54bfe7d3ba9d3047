"""Constraint: a frame that does not move."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State, Wrench
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Surroundings, filled
from wholebody.tasks.residuals import PlacementResidual, placement_between


@dataclass(frozen=True, eq=False)
class Hold(Constraint):
    """Keep a frame at a placement, in the world or relative to another frame of the figure.

    Relative to another frame it closes a loop: two hands that carry one box, or the second hand on a two-handed tool.

    Attributes:
        frame: name of the frame, segment or joint.
        at: its placement: (x, y, z) with the axes of the world or of `relative_to`, (x, y, z, qx, qy, qz, qw), a matrix
            (4, 4) or a pin.SE3; metres. None for its placement at the start.
        orientation: False holds only the frame's origin and leaves the frame free to turn.
        relative_to: name of the frame that `at` is relative to; None for the world.
        residual: computes the value, with frames, joints and target; once resolved.

    Raises:
        InputError: `at` is none of these, or not in metres.
    """

    frame: str
    at: inputs.Target | None = None
    _: KW_ONLY
    orientation: bool = True
    relative_to: str | None = None
    resolved_at: Any = field(init=False, repr=False, default=None)
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Hold:
        """Find the frames, and their placements at the start."""
        place = inputs.find_place(scene, self.frame, "Hold")
        base = inputs.find_base(scene, self.relative_to, self.frame, "Hold")
        at = placement_between(scene, start, self.frame, self.relative_to) if self.at is None else self.resolved_at
        return filled(self, residual=PlacementResidual.build(place, at, base, orientation=self.orientation))

    @property
    def kept_at(self) -> pin.SE3:
        """The placement at which the frame is held, in the world or in the other frame, once resolved."""
        return self.residual.placement

    @property
    def lower(self) -> Array:
        """(m,) zeros."""
        return np.zeros(6 if self.orientation else 3)

    @property
    def upper(self) -> Array:
        """(m,) zeros."""
        return np.zeros(6 if self.orientation else 3)

    @property
    def angular(self) -> Mask:
        """(m,) the last three of six rows are in radians."""
        return self.residual.angular

    def value(self, state: State) -> Array:
        """(m,) difference in position [m] and orientation [rad]."""
        return self.residual.value(state)

    def jacobian(self, state: State) -> Wrench:
        """Rows between the joint of the frame and that of the other."""
        return self.residual.wrench(state)
