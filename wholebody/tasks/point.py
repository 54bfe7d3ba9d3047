"""Goals and a constraint of one point: a point of a frame or the centre of mass at a position, a frame in a plane."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import known, settle
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Goal, GoalOrConstraint, filled
from wholebody.tasks.frame import point_rows


@dataclass(frozen=True, eq=False)
class Point(Goal):
    """Move a point of a frame to a position; the orientation is free.

    The error is the position of the point minus the target, in world axes [m].

    Attributes:
        frame: name of the frame, segment or joint.
        target: (3,) position in the world [m].
        offset: (3,) the point in the frame's own axes [m].
        weight: factor on the squared error [1/m^2].

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> touch = wb.Point("right_index_tip", (0.55, -0.25, 0.95))
    """

    frame: str
    target: inputs.Position
    _: KW_ONLY
    offset: inputs.Position = (0.0, 0.0, 0.0)
    weight: inputs.Weight = 1.0
    place: inputs.Place = field(init=False, repr=False)  # the frame and the joint that carries it
    resolved_target: Array = field(init=False, repr=False)  # (3,) `target` as an array [m]
    resolved_offset: Array = field(init=False, repr=False)  # (3,) `offset` as an array [m]

    def resolve(self, scene: Scene, start: Array) -> Point:
        """Find the frame."""
        return filled(self, place=inputs.find_place(scene, self.frame, "Point"))

    def error(self, state: State) -> Array:
        """(3,) from the target to the point [m]."""
        return np.asarray(state.frame(self.place.frame).act(self.resolved_offset) - self.resolved_target)

    def jacobian(self, state: State) -> Wrench:
        """Three forces along the world's axes, through the point."""
        return Wrench(point_rows(state.frame(self.place.frame).act(self.resolved_offset)), self.place.joint)


@dataclass(frozen=True, eq=False)
class CenterOfMass(GoalOrConstraint):
    """Move the figure's centre of mass to a position, or above one; as a goal, or as a constraint that always holds.

    The error is the centre of mass minus the target, in world axes [m]. What is fixed to the world does not count.

    Attributes:
        target: (3,) position in the world [m].
        axes: "xyz", or "xy" to leave the height free.
        weight: factor on the squared error [1/m^2].
        figure: name of the figure whose centre of mass it is; None for all figures of the scene together.
        joints: its joints; None for all of the scene.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a figure that the scene does not have.

    Examples:
        >>> lean = wb.CenterOfMass((0.05, 0.0, 0.0), axes="xy")
    """

    target: inputs.Position
    _: KW_ONLY
    axes: Literal["xy", "xyz"] = "xyz"
    weight: inputs.Weight = 1.0
    figure: str | None = None
    joints: range | None = field(init=False, repr=False, default=None)
    resolved_target: Array = field(init=False, repr=False)  # (2,) or (3,) the components of `target` along `axes` [m]

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        settle(self, "resolved_target", self.resolved_target[: len(self.axes)])

    def resolve(self, scene: Scene, start: Array) -> CenterOfMass:
        """Find the figure; InputError if no moving part of it has mass."""
        frames: tuple[str, ...] = ()
        if self.figure is not None:
            frames = (f"{known(self.figure, scene.figure.members, 'figure', 'CenterOfMass')}/",)
        return filled(self, joints=inputs.joints_with_mass(scene, "CenterOfMass", frames))

    def error(self, state: State) -> Array:
        """(2,) or (3,) from the target to the centre of mass [m]."""
        return np.asarray(state.center_of_mass(self.joints)[: len(self.axes)] - self.resolved_target)

    def jacobian(self, state: State) -> Array:
        """(2, nv) or (3, nv)."""
        return state.center_of_mass_jacobian(self.joints)[: len(self.axes)]


@dataclass(frozen=True, eq=False)
class Plane(Constraint):
    """Keep the origin of a frame or joint in a plane, or on one side of it.

    The value is the distance (x - p) . n from the plane [m]. An elbow or a wrist that may leave its path only sideways
    moves in the plane through its position, normal to the direction of its path (eqs. 3.2 and 3.3 of the thesis on
    collision avoidance in motion capture clips, there squared and compared with a tolerance).

    Attributes:
        frame: name of the frame, segment or joint.
        normal: (3,) direction normal to the plane, in the world; any length.
        point: (3,) a point in the plane [m]; None for the frame's position at the start.
        side: "on" keeps it in the plane, "above" lets it move to the side to which the normal points.
        height: n . p of the plane, its distance from the world's origin along the normal [m]; once resolved.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> above_the_table = wb.Plane("right_wrist", (0, 0, 1), point=(0.0, 0.0, 0.8), side="above")
    """

    frame: str
    normal: inputs.Direction
    _: KW_ONLY
    point: inputs.Position | None = None
    side: Literal["on", "above"] = "on"
    resolved_normal: Array = field(init=False, repr=False)  # (3,) `normal` as a unit vector
    resolved_point: Array | None = field(init=False, repr=False, default=None)
    place: inputs.Place = field(init=False, repr=False)  # the frame and the joint that carries it
    height: float = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Plane:
        """Find the frame, and the plane through its position at the start."""
        place = inputs.find_place(scene, self.frame, "Plane")
        point = self.resolved_point
        if point is None:
            point = scene.figure.placement(start, self.frame).translation
        return filled(self, place=place, height=float(self.resolved_normal @ point))

    @property
    def upper(self) -> Array:
        """Zero, or inf for one side."""
        return np.array(0.0 if self.side == "on" else np.inf)

    def value(self, state: State) -> Array:
        """(1,) distance from the plane [m]."""
        return np.array((self.resolved_normal @ state.frame(self.place.frame).translation - self.height,))

    def jacobian(self, state: State) -> Wrench:
        """One force along the normal."""
        forces = point_rows(state.frame(self.place.frame).translation)
        return Wrench(self.resolved_normal[None] @ forces, self.place.joint)
