"""Goal: a frame at a placement relative to another frame."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from wholebody.base.arrays import Array
from wholebody.tasks import inputs
from wholebody.tasks.base import Surroundings, filled
from wholebody.tasks.frame import PlacementGoal
from wholebody.tasks.residuals import PlacementResidual, placement_between


@dataclass(frozen=True, eq=False)
class Relative(PlacementGoal):
    """Move a frame to a placement relative to another frame of the figure, if possible.

    Use it for two hands on one object. If the relation must always hold, use `Hold` with `relative_to`. The error is
    the position minus the target [m], then the rotation vector from the target's orientation to the frame's [rad], both
    in the axes of `to`.

    Attributes:
        frame: name of the frame, segment or joint that is placed.
        to: name of the reference frame.
        placement: its target in the axes of `to`: (x, y, z), (x, y, z, qx, qy, qz, qw), a matrix (4, 4) or a pin.SE3;
            metres. None for the relative placement at the start.
        orientation: False leaves the frame free to turn about its origin.
        weight: factor on the squared error [1/m^2 and 1/rad^2].
        residual: computes the error, with frames, joints and target; once resolved.

    Raises:
        InputError: the placement is none of these, or not in metres.
    """

    frame: str
    to: str
    placement: inputs.Target | None = None
    _: KW_ONLY
    orientation: bool = True
    weight: inputs.Weight = 1.0
    resolved_placement: Any = field(init=False, repr=False, default=None)
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Relative:
        """Find the frames, and their relative placement at the start."""
        place = inputs.find_place(scene, self.frame, "Relative")
        base = inputs.find_base(scene, self.to, self.frame, "Relative")
        target = placement_between(scene, start, place, base) if self.placement is None else self.resolved_placement
        return filled(self, residual=PlacementResidual.build(place, target, base, orientation=self.orientation))
