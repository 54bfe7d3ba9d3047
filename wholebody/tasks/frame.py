"""A frame at a placement, at an orientation, or at a placement relative to another frame: goals, and a constraint.

A spatial velocity V = (v, w) has its linear part at the world's origin, so a point p has the rows ``[I, -skew(p)]``.
The rotation vector log3(R T') from a target T has the derivative Jlog3(R T')' w, in world axes (Chirikjian 2011,
"Stochastic Models, Information Theory, and Lie Groups", vol. 2, section 10.6).
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Mask
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Goal, GoalOrConstraint, Term, filled
from wholebody.tasks.inputs import WORLD, Place

_FORCES: Array = np.eye(3, 6)


def point_rows(point: Array) -> Array:
    """Wrenches (3, 6) of a moving point's velocity; written out, as numpy's cross product costs 20 times as much."""
    rows: Array = _FORCES.copy()
    fill_point_rows(rows, point)
    return rows


def fill_point_rows(rows: Array, point: Array) -> None:
    """Write -skew(point) into columns 3 to 5 of the first three rows, whose diagonal there is already zero."""
    x, y, z = point.tolist()
    rows[0, 4] = z
    rows[0, 5] = -y
    rows[1, 3] = -z
    rows[1, 5] = x
    rows[2, 3] = y
    rows[2, 4] = -x


_angular = np.repeat((False, True), 3)
_angular.flags.writeable = False


class PlacementResidual(NamedTuple):
    """Placement of a frame relative to another less its target: position [m], then rotation vector [rad]."""

    place: Place  # the frame that moves
    placement: Any  # pin.SE3, its target in the base
    base: Place = WORLD  # the reference frame
    position: bool = True  # whether the residual has the position
    orientation: bool = True  # whether it has the rotation

    @property
    def angular(self) -> Mask:
        """(m,) whether each row is in radians."""
        return _angular[3 * (not self.position) : 3 + 3 * self.orientation]

    def value(self, state: State) -> Array:
        """(m,) the difference."""
        place = state.frame(self.place.frame)
        if self.base.frame:
            place = state.frame(self.base.frame).actInv(place)
        if not self.orientation:
            return np.asarray(place.translation - self.placement.translation)
        if not self.position:
            return np.asarray(pin.log3(self._turn(place)))
        result = np.empty(6)
        np.subtract(place.translation, self.placement.translation, out=result[:3])
        result[3:] = pin.log3(self._turn(place))
        return result

    def _turn(self, place: Any) -> Array:
        """(3, 3) from the orientation of the target to that of a placement."""
        turn: Array = place.rotation @ self.placement.rotation.T
        return turn

    def wrench(self, state: State) -> Wrench:
        """Derivative of `value`: m rows between the two joints."""
        place = state.frame(self.place.frame)
        if self.base.frame:
            rows = self._relative_rows(place, state.frame(self.base.frame))
        else:
            rows = np.zeros((3 * (self.position + self.orientation), 6))
            if self.position:
                rows[0, 0] = rows[1, 1] = rows[2, 2] = 1.0
                fill_point_rows(rows, place.translation)
            if self.orientation:
                rows[-3:, 3:] = pin.Jlog3(self._turn(place)).T
        return Wrench(rows, self.place.joint, self.base.joint)

    def _relative_rows(self, place: Any, base: Any) -> Array:
        """Rows on the velocity of the frame minus that of the base, both at the world's origin, in the base's axes."""
        turn = base.rotation.T
        blocks = []
        if self.position:
            blocks.append(turn @ point_rows(place.translation))
        if self.orientation:
            rows = np.zeros((3, 6))
            rows[:, 3:] = pin.Jlog3(self._turn(base.actInv(place))).T @ turn
            blocks.append(rows)
        return np.concatenate(blocks)


def placement_between(scene: Scene, q: Array, frame: str, base: str | None) -> Any:
    """Placement (pin.SE3) of one frame in another, or in the world, at the posture q (nq,)."""
    place = scene.figure.placement(q, frame)
    return place if base is None else scene.figure.placement(q, base).actInv(place)


class PlacementTerm(Term):
    """A term whose rows are those of a residual: in position [m], then in orientation [rad], of those asked for."""

    residual: PlacementResidual  # with frames, joints and target; once resolved

    @property
    def angular(self) -> Mask:
        """(m,) which rows are in radians: three of six, or of three all or none."""
        return self.residual.angular

    def jacobian(self, state: State) -> Wrench:
        """(m, 6) rows on the frame's joint, or between the joints of the two frames."""
        return self.residual.wrench(state)


class PlacementGoal(PlacementTerm, Goal):
    """A goal to place a frame."""

    def error(self, state: State) -> Array:
        """(m,) difference in position [m] and orientation [rad]."""
        return self.residual.value(state)


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

    Raises:
        InputError: a value of the wrong kind, shape or range. A quaternion that is not of unit length.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> goal = wb.Frame("right_palm", (0.5, -0.2, 1.0, 0.0, 0.0, 0.0, 1.0))  # x, y, z and a quaternion x, y, z, w
    """

    frame: str
    target: inputs.Target
    _: KW_ONLY
    weight: inputs.Weight = 1.0
    resolved_target: Any = field(init=False, repr=False)  # `target` as a pin.SE3
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Frame:
        """Find the frame."""
        place = inputs.find_place(scene, self.frame, "Frame")
        return filled(self, residual=PlacementResidual(place, self.resolved_target))


@dataclass(frozen=True, eq=False)
class Orientation(PlacementGoal, GoalOrConstraint):
    """Turn a frame to an orientation; its position is free. As a goal, or as a constraint that always holds.

    The error is the rotation vector from the target to the frame, in world axes [rad].

    Attributes:
        frame: name of the frame, segment or joint.
        target: quaternion (x, y, z, w) or rotation matrix (3, 3) of the frame in the world.
        weight: factor on the squared error [1/rad^2].

    Raises:
        InputError: a value of the wrong kind, shape or range. A quaternion that is not of unit length.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> level = wb.Orientation("right_palm", (0.0, 0.0, 0.0, 1.0))  # a quaternion x, y, z, w
    """

    frame: str
    target: Annotated[ArrayLike, inputs.target_rotation]
    _: KW_ONLY
    weight: inputs.Weight = 1.0
    resolved_target: Any = field(init=False, repr=False)  # `target` as a pin.SE3 without translation
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Orientation:
        """Find the frame."""
        place = inputs.find_place(scene, self.frame, "Orientation")
        return filled(self, residual=PlacementResidual(place, self.resolved_target, position=False))


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

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> together = wb.Relative("left_palm", "right_palm", (0.0, 0.0, 0.3), orientation=False)
    """

    frame: str
    to: str
    placement: inputs.Target | None = None
    _: KW_ONLY
    orientation: bool = True
    weight: inputs.Weight = 1.0
    resolved_placement: Any = field(init=False, repr=False, default=None)
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Relative:
        """Find the frames, and their relative placement at the start."""
        place = inputs.find_place(scene, self.frame, "Relative")
        base = inputs.find_base(scene, self.to, self.frame, "Relative")
        given = self.placement is not None
        target = self.resolved_placement if given else placement_between(scene, start, self.frame, self.to)
        return filled(self, residual=PlacementResidual(place, target, base, orientation=self.orientation))


@dataclass(frozen=True, eq=False)
class Hold(PlacementTerm, Constraint):
    """Keep a frame at a placement, in the world or relative to another frame of the figure.

    Relative to another frame it closes a loop: two hands that carry one box, or the second hand on a two-handed tool.

    Attributes:
        frame: name of the frame, segment or joint.
        at: its placement: (x, y, z) with the axes of the world or of `relative_to`, (x, y, z, qx, qy, qz, qw), a matrix
            (4, 4) or a pin.SE3; metres. None for its placement at the start.
        orientation: False holds only the frame's origin and leaves the frame free to turn.
        relative_to: name of the frame that `at` is relative to; None for the world.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    """

    upper = np.zeros(())
    frame: str
    at: inputs.Target | None = None
    _: KW_ONLY
    orientation: bool = True
    relative_to: str | None = None
    resolved_at: Any = field(init=False, repr=False, default=None)
    residual: PlacementResidual = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Hold:
        """Find the frames, and their placements at the start."""
        place = inputs.find_place(scene, self.frame, "Hold")
        base = inputs.find_base(scene, self.relative_to, self.frame, "Hold")
        at = placement_between(scene, start, self.frame, self.relative_to) if self.at is None else self.resolved_at
        return filled(self, residual=PlacementResidual(place, at, base, orientation=self.orientation))

    @property
    def kept_at(self) -> Any:
        """The placement at which the frame is held, in the world or in the other frame, once resolved."""
        return self.residual.placement.copy()

    def value(self, state: State) -> Array:
        """(m,) difference in position [m] and orientation [rad]."""
        return self.residual.value(state)
