"""What contact terms are made of: a gap between two surfaces, an axis against a face, a place over a face."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask, cross, with_values
from wholebody.figures.state import State, Wrench
from wholebody.tasks.axis import equidistant_error, equidistant_jacobian
from wholebody.tasks.base import Constraint, Goal, SupportingPlanes, filled
from wholebody.tasks.faces import Carried, Face
from wholebody.tasks.inputs import Place
from wholebody.tasks.kinks import MOST_FACES, bends, crossed_edges, faces_met
from wholebody.tasks.surfaces import Nearest, Surface, foot, nearest

_T = TypeVar("_T")

FOOT_STEP = 1e-4  # m: of the difference that tells how the nearest point moves; coal has it to 1e-9
ROUND_DEPTH = 8e-6  # m: by which a round end may be inside: four fifths of the usual tolerance
PLANES_WITHIN = 0.02  # m: surfaces farther apart are not about to slide along each other


class Part(Protocol):
    """Some rows of a contact term."""

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """(m,) which of its rows are in radians."""

    def rows(self, state: State) -> tuple[Array, Array]:
        """Values (m,) and their derivative (m, nv)."""


Made: TypeAlias = tuple[tuple[Part, ...], tuple[tuple[str, str], ...]]
"""The parts of a contact term, and the pairs of owners that touch."""


class OwnSurface(NamedTuple):
    """A point on the surface of its own piece, which touches there only where the two normals are opposed.

    With c the centre of curvature, p the point and P(c) the point of the other surface nearest to c, they are where
    p = P(c): two rows t_k . (p - P(c)), which may leave the point at most `ROUND_DEPTH` off where the piece touches;
    within that, the distance is that of the piece. Of a flat face any point behind p serves as c.
    """

    middle: Surface  # c as a surface
    radius: float  # of the piece, or of a flat face about the point [m]
    across: Array  # (2, 3) t_k, two directions in the axes of the joint, along the surface at the point
    flat: bool = False

    @property
    def room(self) -> float:
        """What the rows may be in any direction along the surface [m]: a corner of a face is as deep as they are."""
        return ROUND_DEPTH if self.flat else float(np.sqrt(2.0 * self.radius * ROUND_DEPTH))

    def nearest(self, near: Nearest, other: Surface, state: State) -> Nearest:
        """The nearest points of the piece and the other surface where the point is about there, else of the point."""
        if self.flat:
            return near
        of_middle = nearest(self.middle, other, state)
        distance = max(of_middle.distance - self.radius, near.distance - ROUND_DEPTH)
        return with_values(of_middle if distance > near.distance - ROUND_DEPTH else near, distance=distance)

    def bends(self, other: Surface, state: State) -> Array:
        """Wrenches (b, 6) of how the distance of the piece bends: see `kinks.bends`."""
        turned = bends(self.middle, other, nearest(self.middle, other, state), self.radius)
        return through(self.middle.placed(0, state).translation, turned)

    def rows(self, point: Surface, other: Surface, near: Nearest, state: State) -> tuple[Array, Array]:
        """Values (2,) and derivatives (2, nv)."""
        place, center = state.data.oMi[near.against], self.middle.placed(0, state).translation
        tip, across = point.placed(0, state).translation, self.across @ place.rotation.T
        there = foot(other, near.pieces[1], center, state)
        moves = np.array([foot(other, near.pieces[1], center + FOOT_STEP * way, state) - there for way in across])
        arm = tip - there
        wrench = through(tip, across) - through(center, moves / FOOT_STEP)
        wrench[:, 3:] += cross(across, arm)
        return across @ arm, between(state, wrench, near.against, near.joint)


class Gap(NamedTuple):
    """The signed distance of two surfaces: one row, zero where they touch [m]."""

    first: Surface  # the surfaces
    second: Surface
    face: Face | None = None  # the face of the second that the first is to lie on; None where any side will do
    own: OwnSurface | None = None  # of a first surface that is a point on its own piece
    in_radians: tuple[bool, ...] = (False,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The distance, and a force along the normal."""
        near = nearest(self.first, self.second, state)
        if self.own is not None:
            near = self.own.nearest(near, self.second, state)
        wrench = through(near.point, near.normal[None])
        return np.array([near.distance]), between(state, wrench, near.joint, near.against)

    def planes(self, state: State) -> SupportingPlanes:
        """Of faces and edges that what touches is not beyond, and of the angle where a point is on its own piece."""
        near = nearest(self.first, self.second, state)
        if near.distance > PLANES_WITHIN:
            return no_planes(state.model.nv)
        edges = crossed_edges(self.first, self.second, near)
        ahead = faces_met(self.first, self.second, near.pieces, near.where, edges)
        back = faces_met(self.second, self.first, near.pieces[::-1], near.where[::-1])
        value, normals, points, key = ahead
        if len(back.key):
            value, normals, points, key = (np.concatenate(part) for part in zip(ahead, back, strict=True))
            key[len(ahead.key) :] += MOST_FACES
        wrench = np.concatenate((normals, cross(points, normals)), axis=1)
        wrench[len(ahead.key) :] *= -1.0  # of the second surface against the first
        rows = between(state, wrench, near.against, near.joint)
        if self.own is None or self.own.flat:
            turned = bends(self.first, self.second, near)
            turned = through(near.point, turned) if len(turned) else turned
        else:
            turned = self.own.bends(self.second, state)
        bend = between(state, turned, near.joint, near.against) if len(turned) else rows[:0]
        if self.own is not None:
            upright, turns = self.own.rows(self.first, self.second, near, state)
            sides = 2.0 * np.pi * np.arange(8) / 8  # of the octagon within the circle of the room
            directions, room = np.column_stack([np.cos(sides), np.sin(sides)]), self.own.room * np.cos(np.pi / 8)
            value, rows = np.concatenate([value, directions @ upright - room]), np.vstack([rows, directions @ turns])
            key = np.concatenate([key, 2 * MOST_FACES + np.arange(8)])
        return SupportingPlanes(value, rows, key, bend, np.zeros(len(bend), dtype=np.intp))


class Meeting(NamedTuple):
    """Two points that meet: three rows along the world's axes [m], as a distance has no derivative where it is zero."""

    first: Surface  # the points
    second: Surface
    in_radians: tuple[bool, ...] = (False, False, False)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The way from the second point to the first, and forces through each."""
        ends = [(point.placed(0, state).translation, point.joints[0]) for point in self[:2]]
        moves = [between(state, through(place, np.eye(3)), joint, 0) for place, joint in ends]
        return ends[0][0] - ends[1][0], moves[0] - moves[1]


class Near(NamedTuple):
    """Two surfaces not farther apart than a distance: one row, zero within it, and what is beyond it [m]."""

    first: Surface  # the surfaces
    second: Surface
    most: float  # the distance [m]
    face: Face | None = None  # as for a `Gap`
    in_radians: tuple[bool, ...] = (False,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """What is beyond, and a force along the normal."""
        return beyond(*Gap(self.first, self.second).rows(state), np.array([-np.inf]), np.array([self.most]))

    def planes(self, state: State) -> SupportingPlanes:
        """The distance that they may be apart."""
        return ends(*Gap(self.first, self.second).rows(state), np.array([-np.inf]), np.array([self.most]))


class Facing(NamedTuple):
    """An axis of a frame along a direction that goes with a face: the two rows of `Axis`, angle between them [rad]."""

    place: Place  # the frame and its joint
    basis: Array  # (3, 3) rows in the frame: two directions across the axis, and the axis
    face: Carried  # the face
    direction: Array  # (3,) in the face's own axes, unit
    either: bool = False  # whether the opposite direction will do as well: the nearer one counts
    in_radians: tuple[bool, ...] = (True, True)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The angle along the two directions, and moments."""
        direction = self.direction @ self.face.at(state)[1]
        axes = self.basis @ state.frame(self.place.frame).rotation.T
        if self.either and axes[2] @ direction < 0.0:
            direction = -direction
        components = (axes @ direction).tolist()
        wrench = np.zeros((2, 6))
        wrench[:, 3:] = (equidistant_jacobian(*components) @ axes) @ pin.skew(direction)
        return equidistant_error(*components), self.face.rows(state, wrench, self.place.joint)


class Level(NamedTuple):
    """An axis of a frame in the plane of a face: one row, the sine of its angle to that plane [rad]."""

    place: Place
    axis: Array
    face: Face
    in_radians: tuple[bool, ...] = (True,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The sine, and a moment."""
        normal = self.face.at(state)[1][2]
        axis = state.frame(self.place.frame).rotation @ self.axis
        wrench = np.array([[0.0, 0.0, 0.0, *(pin.skew(axis) @ normal)]])
        return np.array([axis @ normal]), self.face.rows(state, wrench, self.place.joint)


class Over(NamedTuple):
    """A point of a frame within a box that stands on a face: rows are zero within, and its distances outside [m]."""

    place: Place  # the frame and its joint
    face: Carried  # the face
    low: Array  # (k,) ends along the face's first k axes: across it and, with three, along its normal
    high: Array
    offset: Array = np.zeros(3)  # (3,) the point in the frame

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """None is."""
        return (False,) * len(self.low)

    def rows(self, state: State) -> tuple[Array, Array]:
        """How far out it is along each axis."""
        return beyond(*self._along(state), self.low, self.high)

    def planes(self, state: State) -> SupportingPlanes:
        """The sides of the box."""
        return ends(*self._along(state), self.low, self.high)

    def _along(self, state: State) -> tuple[Array, Array]:
        """Coordinates (k,) of the point along the axes, and their derivative (k, nv)."""
        center, axes = self.face.at(state)
        axes = axes[: len(self.low)]
        point = state.frame(self.place.frame).act(self.offset)
        return axes @ (point - center), self.face.rows(state, through(point, axes), self.place.joint)


def through(point: Array, forces: Array) -> Array:
    """Wrenches (k, 6) of forces (k, 3) through a point (3,)."""
    return np.concatenate((forces, forces @ pin.skew(point).T), axis=1)


def between(state: State, wrench: Array, joint: int, against: int) -> Array:
    """Rows (m, nv) of wrenches (m, 6) on one joint against another."""
    return state.wrench_jacobian(Wrench(wrench, joint, against))


@dataclass(frozen=True, eq=False)
class TermOfParts(Constraint):
    """A constraint made of parts, whose rows are one after the other."""

    parts: Sequence[Part] = field(init=False, repr=False)  # once resolved
    touches: tuple[tuple[str, str], ...] = field(init=False, repr=False, default=())

    @property
    def touching(self) -> tuple[tuple[str, str], ...]:
        """Owners that are to touch: their clearance is zero."""
        return self.touches

    @property
    def angular(self) -> Mask:
        """(m,) which rows are in radians."""
        return np.array([flag for part in self.parts for flag in part.in_radians], dtype=bool)

    def value(self, state: State) -> Array:
        """(m,) residual of the contact [m, rad]."""
        return np.concatenate([part.rows(state)[0] for part in self.parts])

    def jacobian(self, state: State) -> Array:
        """(m, nv) the derivative."""
        return np.vstack([part.rows(state)[1] for part in self.parts])

    def value_and_jacobian(self, state: State, value: Callable[[State], Array]) -> tuple[Array, Array]:
        """Both from one search for the nearest points."""
        values, rows = zip(*(part.rows(state) for part in self.parts), strict=True)
        return np.concatenate(values), np.vstack(rows)

    def supporting_planes(self, state: State) -> SupportingPlanes:
        """Planes of the faces about every gap: past an edge there is no surface left to slide on."""
        found, row = list[SupportingPlanes](), 0
        for number, part in enumerate(self.parts):
            if hasattr(part, "planes"):  # what says where its rows have kinks; keys are less than 3 `MOST_FACES`
                value, rows, key, bend, bend_row = part.planes(state)
                if len(value) or len(bend):
                    found.append(SupportingPlanes(value, rows, key + 3 * MOST_FACES * number, bend, bend_row + row))
            row += len(part.in_radians)
        if not found:
            return no_planes(state.model.nv)
        return SupportingPlanes(*(np.concatenate(each) for each in zip(*found, strict=True)))


class ContactTerm(TermOfParts, Goal):
    """A term all of whose rows are zero where the contact is made."""

    upper = np.zeros(())

    def error(self, state: State) -> Array:
        """(m,) the value: a goal is met where it is zero."""
        return self.value(state)


def beyond(value: Array, jacobian: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """What of values (k,) is out of their ranges, and the derivative (k, nv), which is zero within."""
    excess = value - np.minimum(np.maximum(value, low), high)  # np.clip takes four times as long
    return excess, np.where(((excess != 0.0) | (low == high))[:, None], jacobian, 0.0)


def ends(value: Array, jacobian: Array, low: Array, high: Array) -> SupportingPlanes:
    """Planes of the ends of the ranges of values (k,) with their derivative (k, nv); without those far beyond."""
    value, none = np.concatenate([value - high, low - value]), no_planes(jacobian.shape[1])
    near = np.flatnonzero(np.isfinite(value) & (value <= PLANES_WITHIN))
    if not len(near):
        return none
    return with_values(none, value=value[near], jacobian=np.concatenate([jacobian, -jacobian])[near], key=near)


def no_planes(nv: int) -> SupportingPlanes:
    """None at all."""
    none, rows, index = np.zeros(0), np.zeros((0, nv)), np.zeros(0, dtype=np.intp)
    return SupportingPlanes(none, rows, index, rows, index)


def owner_pairs(first: Iterable[str], second: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Every pair of an owner of the first surface with one of the second."""
    others = tuple(second)
    return tuple((a, b) for a in first for b in others)


def has_face(term: Any) -> bool:
    """Whether a resolved term brings a surface to a face of a thing."""
    return any(isinstance(part, (Gap, Near)) and part.face is not None for part in getattr(term, "parts", ()))


def approached(term: _T, distance: float) -> _T:
    """A resolved term whose surfaces are to be in front of the planes of their faces by a distance [m]."""
    # The signed distance does not tell the side: a foot under a pedal is pushed down out of it, never up through it.
    if not has_face(term):
        return term
    return filled(term, parts=tuple(_approached(part, distance) for part in getattr(term, "parts", ())))


def _approached(part: Any, distance: float) -> Any:
    """A part whose second surface is the half-space behind its face, moved outwards; it goes where the thing goes."""
    if not isinstance(part, (Gap, Near)) or part.face is None:
        return part
    whole, normal = part.face.surface, part.face.axes[2]
    space = coal.Halfspace(normal, float(normal @ part.face.center) + distance)
    plane = with_values(whole, pieces=whole.pieces[:1], joints=whole.joints[:1], flesh=())
    return with_values(part, second=plane.with_shapes((space,)))
