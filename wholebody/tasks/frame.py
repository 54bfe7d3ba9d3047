"""Goals: a frame at a placement, at an orientation, or at a placement relative to another frame."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any

from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State, Wrench
from wholebody.tasks import inputs
from wholebody.tasks.base import Goal, Surroundings, filled
from wholebody.tasks.residuals import PlacementResidual, placement_between


class PlacementGoal(Goal):
    """A goal whose error is a difference of placements: in position [m], then in orientation [rad], of those asked for.

    Attributes:
        residual: computes the error, with frames, joints and target; once resolved.
    """

    residual: PlacementResidual

    @property
    def angular(self) -> Mask:
        """(m,) which rows are in radians: three of six, or of three all or none."""
        return self.residual.angular

    def error(self, state: State) -> Array:
        """(m,) difference in position [m] and orientation [rad]."""
        return self.residual.value(state)

    def jacobian(self, state: State) -> Wrench:
        """(m, 6) rows on the frame's joint, or between the joints of the two frames."""
        return self.residual.wrench(state)


@dataclass(frozen=True, eq=False)
class Frame(PlacementGoal):
    """Move a frame to a position and an orientation.

    The error is the position of the frame minus the target [m], then the rotation vector from the target's orientation
    to the frame's [rad], both in world axes. The vector is exact up to half a turn; at exactly half a turn it has one
    of two equivalent directions.

    Attributes:
        frame: name of the frame, segment or joint.
        target: its target: (x, y, z) with the axes of the world, (x, y, z, qx, qy, qz, qw), a matrix (4, 4) or a
            pin.SE3; metres.
        weight: factor on the squared error [1/m^2 and 1/rad^2: a metre counts as much as a radian].
        resolved_target: `target` as a pin.SE3.
        residual: computes the error, with frame, joint and target; once resolved.

    Raises:
        InputError: the target is none of these, or not in metres.
    """

    frame: str
    target: inputs.Target
    _: KW_ONLY
    weight: inputs.Weight = 1.0
    resolved_target: Any = field(init=False, repr=False)
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Frame:
        """Find the frame."""
        place = inputs.find_place(scene, self.frame, "Frame")
        return filled(self, residual=PlacementResidual.build(place, self.resolved_target))


@dataclass(frozen=True, eq=False)
class Orientation(PlacementGoal):
    """Turn a frame to an orientation; its position is free.

    The error is the rotation vector from the target to the frame, in world axes [rad].

    Attributes:
        frame: name of the frame, segment or joint.
        target: quaternion (x, y, z, w) or rotation matrix (3, 3) of the frame in the world.
        weight: factor on the squared error [1/rad^2].
        resolved_target: `target` as a pin.SE3 without translation.
        residual: computes the error, with frame, joint and target; once resolved.

    Raises:
        InputError: the target is not a rotation.
    """

    frame: str
    target: Annotated[ArrayLike, inputs.target_rotation]
    _: KW_ONLY
    weight: inputs.Weight = 1.0
    resolved_target: Any = field(init=False, repr=False)
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Orientation:
        """Find the frame."""
        place = inputs.find_place(scene, self.frame, "Orientation")
        return filled(self, residual=PlacementResidual.build(place, self.resolved_target, position=False))


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
        given = self.placement is not None
        target = self.resolved_placement if given else placement_between(scene, start, self.frame, self.to)
        return filled(self, residual=PlacementResidual.build(place, target, base, orientation=self.orientation))
