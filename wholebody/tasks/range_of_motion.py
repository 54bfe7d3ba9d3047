"""Constraints: ball joints within their reach cones, and ranges of motion that more than one joint angle decides."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple, TypeAlias, TypeVar

import numpy as np

from wholebody.base.arrays import Array, cross
from wholebody.base.checks import known
from wholebody.base.errors import InputError
from wholebody.base.fields import Names
from wholebody.figures.description import JointCone
from wholebody.figures.motion_ranges import CoupledRange, EllipticRange, MotionRange, TwistRange
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, filled


class ConeRow(NamedTuple):
    """The signed angle from a limb's direction to the nearest edge of its reach cone."""

    cone: Any  # the spherical polygon
    reference: inputs.Place  # the frame to which the cone is fixed
    limb: inputs.Place  # the frame that turns within the cone
    axis: Array  # (3,) the limb's direction in its frame, a unit vector

    def value(self, state: State) -> float:
        """Radians, positive inside."""
        turn = state.frame(self.reference.frame).rotation
        return float(self.cone.signed_angle((state.frame(self.limb.frame).rotation @ self.axis) @ turn)[0])

    def write(self, state: State, row: Array) -> None:
        """Write the derivative into a row (nv,) of zeros."""
        turn = state.frame(self.reference.frame).rotation
        direction, wrench = state.frame(self.limb.frame).rotation @ self.axis, np.zeros((1, 6))
        # The direction turns as w x d, so the angle changes by g . (w x d) = w . (d x g).
        wrench[0, 3:] = cross(direction, turn @ self.cone.signed_angle(direction @ turn)[1])
        row += state.rows(wrench, np.array([self.limb.joint]), np.array([self.reference.joint]))[0]


OPPOSITE = 1e-9
"""Least square of 1 + cosine of the swing: nearer to the opposite of its central direction a limb has no twist."""


class Coordinate(NamedTuple):
    """A joint angle's places in the posture and in the tangent, and its factor."""

    idx_q: int
    idx_v: int
    factor: float


class CoupledRow(NamedTuple):
    """``bound - sum_i c_i q_i``; see `CoupledRange`."""

    coordinates: tuple[Coordinate, ...]
    bound: float

    def value(self, state: State) -> float:
        """Radians, positive inside."""
        return self.bound - sum(factor * float(state.q[q]) for q, _, factor in self.coordinates)

    def largest(self, least: Array, most: Array) -> float:
        """Largest value that any posture between two postures (nq,) gives, radians."""
        return self.bound - _between(self.coordinates, least, most)[0]

    def write(self, state: State, row: Array) -> None:
        """Write the derivative into a row (nv,) of zeros."""
        for _, v, factor in self.coordinates:
            row[v] -= factor


class EllipticRow(NamedTuple):
    """``(1 - sum_k (a_k / l_k)^2) size / 2``, about the distance from the ellipsoid near it; see `EllipticRange`."""

    axes: tuple[tuple[Coordinate, ...], ...]  # the coordinates that each angle a is the sum of
    offset: Array  # (k,) radians added to each
    limits: Array  # (2, k) lower and upper limits l
    size: float  # radians

    def value(self, state: State) -> float:
        """Radians, positive inside."""
        shares = [angle / limit for angle, limit in self._angles(state)]
        return 0.5 * self.size * (1.0 - sum(share * share for share in shares))

    def largest(self, least: Array, most: Array) -> float:
        """Largest value that any posture between two postures (nq,) gives, radians; no joint is in two of the axes."""
        total = 0.0
        for k, axis in enumerate(self.axes):
            low, high = _between(axis, least, most)
            angle = min(max(0.0, low + float(self.offset[k])), high + float(self.offset[k]))
            total += (angle / float(self.limits[int(angle > 0.0), k])) ** 2
        return 0.5 * self.size * (1.0 - total)

    def write(self, state: State, row: Array) -> None:
        """Write the derivative into a row (nv,) of zeros."""
        for axis, (angle, limit) in zip(self.axes, self._angles(state), strict=True):
            for _, v, factor in axis:
                row[v] -= self.size * factor * angle / (limit * limit)

    def _angles(self, state: State) -> list[tuple[float, float]]:
        found = []
        for k, axis in enumerate(self.axes):
            angle = float(self.offset[k]) + sum(factor * float(state.q[q]) for q, _, factor in axis)
            found.append((angle, float(self.limits[int(angle > 0.0), k])))
        return found


class TwistRow(NamedTuple):
    """``bound + slope . z - sign twist``; see `TwistRange`."""

    reference: inputs.Place  # the frame that carries the range
    limb: inputs.Place  # the frame that turns
    part: TwistRange  # center, sign, bound and slope

    def value(self, state: State) -> float:
        """Radians, positive inside."""
        _, seen = self._rotations(state)
        twist = math.atan2(seen[1, 0] - seen[0, 1], seen[0, 0] + seen[1, 1])
        slope = self.part.slope @ self.part.center
        return float(self.part.bound + slope @ seen[:, 2] - self.part.sign * twist)

    def write(self, state: State, row: Array) -> None:
        """Write the derivative into a row (nv,) of zeros."""
        base, seen = self._rotations(state)
        sine, cosine = seen[1, 0] - seen[0, 1], seen[0, 0] + seen[1, 1]
        square = max(sine * sine + cosine * cosine, OPPOSITE)
        x, y, _ = seen[2]
        # The limb turns by w in the world and by w' in the axes of the central rotation.
        turn = np.array([(sine * y - cosine * x) / square, (-cosine * y - sine * x) / square, 1.0])
        along = cross(seen[:, 2], self.part.slope @ self.part.center)
        wrench = np.zeros((1, 6))
        wrench[0, 3:] = base @ (along - self.part.sign * turn)
        row += state.rows(wrench, np.array([self.limb.joint]), np.array([self.reference.joint]))[0]

    def _rotations(self, state: State) -> tuple[Array, Array]:
        """The central rotation in the world, and the limb's seen from it."""
        base = state.frame(self.reference.frame).rotation @ self.part.center
        return base, base.T @ state.frame(self.limb.frame).rotation


Row: TypeAlias = ConeRow | CoupledRow | EllipticRow | TwistRow
_T = TypeVar("_T", bound="RangeConstraint")


@dataclass(frozen=True, eq=False)
class RangeConstraint(Constraint):
    """A row for each of some cones or ranges: the angle to its end, positive inside [rad]."""

    angular = np.ones((), dtype=bool)  # of all rows
    of: ClassVar[str]  # the attribute of figures that has the cones or ranges
    word: ClassVar[str]  # what one of these is called
    names: Annotated[Sequence[str], Names("['neck']", least=0)] | None = None
    rows: tuple[Row, ...] = field(init=False, repr=False)  # each cone or range with its frames and joints
    row_names: tuple[str, ...] = field(init=False, repr=False)  # its name

    def resolve(self: _T, scene: Scene, start: Array) -> _T:
        """Find the cones or ranges, their frames and joints."""
        parts: Mapping[str, JointCone | MotionRange] = getattr(scene.figure, self.of)
        if not parts:
            raise InputError(f"{type(self).__name__}: this figure has no {self.word}s; leave the constraint out")
        names = tuple(parts) if self.names is None else tuple(self.names)
        found = [_row(parts[known(name, parts, self.word, type(self).__name__)], scene, name) for name in names]
        return filled(self, rows=tuple(found), row_names=names)

    def value(self, state: State) -> Array:
        """(m,) angle to the end of each range, positive inside [rad]."""
        return np.array([row.value(state) for row in self.rows])

    def jacobian(self, state: State) -> Array:
        """(m, nv)."""
        result = np.zeros((len(self.rows), state.model.nv))
        for row, into in zip(self.rows, result, strict=True):
            row.write(state, into)
        return result


@dataclass(frozen=True, eq=False)
class ReachCones(RangeConstraint):
    """Keep the direction of limbs inside the spherical polygons that bound the range of their joints.

    Limits of three revolute joints in a row allow directions that a shoulder or a hip does not (Wilhelms and Van Gelder
    2001, "Fast and Easy Reach-Cone Joint Limits", Journal of Graphics Tools 6(2)). The value is the signed angle from
    the limb's direction to the nearest edge of its polygon, positive inside [rad].

    Attributes:
        names: names of the figure's cones; None for all of them.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a cone that the figure does not have.

    Examples:
        >>> shoulder = wb.tasks.ReachCones(["left_shoulder"])
    """

    of, word = "cones", "reach cone"


@dataclass(frozen=True, eq=False)
class RangeOfMotion(RangeConstraint):
    """Keep joints within the ranges of motion that more than one joint angle decides.

    Muscles over two joints (hamstrings, gastrocnemius, rectus femoris), the inward rotation of the raised upper arm,
    and the neck, which does not flex, bend and turn by all of its range at once: the figure's `ranges`. There is a row
    for each: the angle to its end, positive inside [rad].

    A problem of a person has this constraint by default; see `Problem`.

    Attributes:
        names: names of the figure's ranges; None for all of them.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a range that the figure does not have.

    Examples:
        >>> neck = wb.tasks.RangeOfMotion(["neck"])
    """

    of, word = "ranges", "motion range"


def _between(coordinates: tuple[Coordinate, ...], least: Array, most: Array) -> tuple[float, float]:
    """Least and largest weighted sum of joint angles between two postures (nq,)."""
    low = sum(min(factor * float(least[q]), factor * float(most[q])) for q, _, factor in coordinates)
    return low, sum(max(factor * float(least[q]), factor * float(most[q])) for q, _, factor in coordinates)


def _row(part: JointCone | MotionRange, scene: Scene, name: str) -> Row:
    if isinstance(part, JointCone):
        reference, limb = (inputs.find_place(scene, frame, "ReachCones") for frame in (part.reference, part.limb))
        return ConeRow(part.cone, reference, limb, inputs.direction(part.axis, f"ReachCones: axis of {name}"))
    if isinstance(part, CoupledRange):
        return CoupledRow(tuple(_coordinate(scene, joint, factor) for joint, factor in part.joints.items()), part.bound)
    if isinstance(part, EllipticRange):
        axes = tuple(tuple(_coordinate(scene, joint, 1.0) for joint in axis.joints) for axis in part.axes)
        limits = np.array([[axis.lower for axis in part.axes], [axis.upper for axis in part.axes]])
        return EllipticRow(axes, np.array([axis.offset for axis in part.axes]), limits, part.size)
    places = [inputs.find_place(scene, name, "RangeOfMotion") for name in (part.reference, part.limb)]
    return TwistRow(places[0], places[1], part)


def _coordinate(scene: Scene, name: str, factor: float) -> Coordinate:
    joint: Any = scene.model.joints[scene.figure.joint_id(name)]
    if joint.nq != 1:
        raise InputError(f"RangeOfMotion: joint {name!r} has no single angle; name joints of one degree of freedom")
    return Coordinate(int(joint.idx_q), int(joint.idx_v), factor)
