"""Bars and rings that a hand closes around: the direction of the bar at the hand, and what crosses the palm.

A bar has the direction of its thing's longest axis. A ring, such as a steering wheel, is a bar whose direction is that
of the rim next to the palm.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.figures.state import State
from wholebody.tasks.axis import equidistant_error, equidistant_jacobian
from wholebody.tasks.contact_parts import through
from wholebody.tasks.inputs import Place
from wholebody.tasks.surfaces import Face, Surface, outermost

ROUNDNESS = 0.1  # largest deviation of a ring's pieces from a circle and its plane, as a share of its radius
RING = 8  # least number of pieces of a ring
AT_CENTER = 1e-6  # m: distance from a ring's axis below which the rim next to a place is not known


def bar_of(thing: Surface, state: State, where: str) -> Face:
    """A "face" through the middle of a thing, whose normal is the thing's longest axis; `half` has all three sizes.

    Raises:
        InputError: the thing has no end.
    """
    at = thing.placed(0, state)
    bounded = [(shape, thing.placed(k, state)) for k, shape in enumerate(thing.shapes) if np.isfinite(thing.reach[k])]
    if not bounded:
        raise InputError(f"{where}: {thing.name!r} has no end, so no hand closes around it; take it by the palm")
    center, half = np.zeros(3), np.zeros(3)
    for axis, along in enumerate(at.rotation.T):
        ends = [outermost(shape, placed, sign * along) @ along for shape, placed in bounded for sign in (1.0, -1.0)]
        low, high = float(np.concatenate(ends).min()), float(np.concatenate(ends).max())
        center[axis], half[axis] = 0.5 * (low + high) - float(at.translation @ along), 0.5 * (high - low)
    order = np.argsort(half, kind="stable")
    return Face(thing, center, np.eye(3)[order], half[order])


class Ring(NamedTuple):
    """A ring: its middle and axis in the axes of the thing's first piece, and the radius of its rim [m]."""

    surface: Surface
    center: Array
    axis: Array
    radius: float

    @property
    def joint(self) -> int:
        """Joint that carries the thing; 0 is the world."""
        return self.surface.joints[0]


def ring_of(thing: Surface, state: State) -> Ring | None:
    """The ring that the pieces of a thing make, or None."""
    if len(thing.shapes) < RING:
        return None
    middles = []
    for k, shape in enumerate(thing.shapes):
        place = thing.placed(k, state)
        ends = [outermost(shape, place, sign * axis) @ axis for axis in np.eye(3) for sign in (1.0, -1.0)]
        lows, highs = [end.min() for end in ends[1::2]], [end.max() for end in ends[::2]]
        middles.append(0.5 * (np.array(lows) + np.array(highs)))
    points = np.array(middles)
    center = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - center)
    way = (points - center) @ axes.T
    radii = np.hypot(way[:, 0], way[:, 1])
    radius = float(radii.mean())
    flat = np.abs(way[:, 2]).max() <= ROUNDNESS * radius and np.ptp(radii) <= 2.0 * ROUNDNESS * radius
    even = sizes[1] >= (1.0 - ROUNDNESS) * sizes[0]  # all around, not an arc
    if not (flat and even):
        return None
    at = thing.placed(0, state)
    return Ring(thing, at.actInv(center), at.rotation.T @ axes[2], radius)


class Crossing(NamedTuple):
    """A bar that crosses the palm: one row across the palm, and one along the bar that is zero within its room [m].

    The first row is x . w, with x the axis of the fingers and w the way from the palm to the bar's axis.

    Attributes:
        place: the palm.
        bar: the bar.
        low, high: where along it the palm may be, from its middle [m].
    """

    place: Place
    bar: Face
    low: float
    high: float

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """None is."""
        return False, False

    def rows(self, state: State) -> tuple[Array, Array]:
        """The two rows, and wrenches."""
        center, axes = self.bar.at(state)
        frame, along = state.frame(self.place.frame), axes[2]
        palm, fingers = frame.translation, frame.rotation[:, 0]
        way = center - palm
        level = fingers - (fingers @ along) * along  # x . (1 - l l') (c - p) = level . way
        reach = float(along @ way)
        excess = reach - float(np.clip(reach, -self.high, -self.low))
        # of the hand against the thing, seen from the thing: the hand's velocity v and rotation w
        held = bool(excess) or self.low == self.high
        wrench = through(palm, np.array([-level, -along if held else np.zeros(3)]))
        wrench[0, 3:] += pin.skew(fingers) @ (way - reach * along)
        joints = np.full(2, self.place.joint, dtype=np.intp), np.full(2, self.bar.joint, dtype=np.intp)
        return np.array([level @ way, excess]), state.rows(wrench, *joints)


class Rim(NamedTuple):
    """A hand around the rim of a ring, from outside: four rows [rad, rad, m, m].

    With e the direction from the ring's axis to the palm, k the rim there and n the axis: two rows are the angle of
    the palm's y to the tangent n x e, whichever of its two directions is nearer. One is x . (k - p), with x the axis of
    the fingers and p the palm. The last is how far the palm is within the rim, zero outside of it.
    """

    place: Place
    ring: Ring

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """The first two."""
        return True, True, False, False

    def rows(self, state: State) -> tuple[Array, Array]:
        """The rows, and wrenches."""
        at, frame = self.ring.surface.placed(0, state), state.frame(self.place.frame)
        center, n = at.act(self.ring.center), at.rotation @ self.ring.axis
        palm, (x, y, z) = frame.translation, frame.rotation.T
        flat = np.eye(3) - np.outer(n, n)
        radial = flat @ (palm - center)
        distance = max(float(np.linalg.norm(radial)), AT_CENTER)
        e = radial / distance
        tangent = np.cross(n, e)
        turning = np.outer(tangent, tangent) / distance  # of e, by a motion of the palm seen from the ring
        sign = 1.0 if y @ tangent >= 0.0 else -1.0
        axes = np.array((z, x, y))
        components = (axes @ (sign * tangent)).tolist()
        slope = equidistant_jacobian(*components) @ axes
        rim = center + self.ring.radius * e
        way = rim - palm
        inside = self.ring.radius - distance
        forces = np.zeros((4, 3))
        forces[:2] = sign * slope @ pin.skew(n) @ turning
        forces[2] = x @ (self.ring.radius * turning - np.eye(3))
        forces[3] = -e if inside > 0.0 else 0.0
        wrench = through(palm, forces)
        # the palm's turn moves its axes, seen from the ring: y' = w x y
        wrench[:2, 3:] += slope @ pin.skew(sign * tangent)
        wrench[2, 3:] += np.cross(x, way)
        joints = np.full(4, self.place.joint, dtype=np.intp), np.full(4, self.ring.joint, dtype=np.intp)
        values = np.array([*equidistant_error(*components), x @ way, max(inside, 0.0)])
        return values, state.rows(wrench, *joints)


class Looking(NamedTuple):
    """The palm's z within an angle of a direction in the world, or of a plane across it: one row [rad].

    Attributes:
        place: the palm.
        direction: (3,) unit.
        most: largest angle from it [rad].
        level: whether the angle is to the plane across the direction.
    """

    place: Place
    direction: Array
    most: float
    level: bool

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """It is."""
        return (True,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The angle beyond, and a moment."""
        axis = state.frame(self.place.frame).rotation[:, 2]
        cosine = float(np.clip(axis @ self.direction, -1.0, 1.0))
        angle = abs(float(np.arcsin(cosine))) if self.level else float(np.arccos(cosine))
        wrench = np.zeros((1, 6))
        beyond = max(0.0, angle - self.most)
        if beyond > 0.0:
            slope = (1.0 if cosine > 0.0 else -1.0) if self.level else -1.0
            moment = pin.skew(axis) @ self.direction
            wrench[0, 3:] = slope * moment / max(float(np.linalg.norm(moment)), 1e-6)
        joints = np.array([self.place.joint]), np.zeros(1, dtype=np.intp)
        return np.array([beyond]), state.rows(wrench, *joints)
