"""Bars and rings that a hand closes around: the direction of the bar at the hand, and what crosses the palm.

A bar has the direction of its thing's longest axis. A ring, such as a steering wheel, is held at the side of the hand,
where its rim counts as a bar.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.tasks.base import SupportingPlanes
from wholebody.tasks.contact_parts import one_sided, through
from wholebody.tasks.inputs import Place
from wholebody.tasks.surfaces import Face, Surface, outermost

ROUNDNESS = 0.1  # largest deviation of a ring's pieces from a circle and its plane, as a share of its radius


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


def rim_of(thing: Surface, outwards: Array, state: State) -> Face | None:
    """The rim of a ring where it lies in a direction (3,) from the ring's middle, as a bar; None for no ring.

    Args:
        thing: what may be a ring: pieces all around a circle.
        outwards: in the world.
        state: at the start.

    Returns:
        Its axes are the ring's own, the direction outwards in the ring's plane, and that of the rim; `half` is half the
        rim's thickness along the ring's axis, twice, and half the size of what counts as straight.
    """
    if len(thing.shapes) < 8:  # least number of pieces of a ring
        return None
    middles = []
    for k, shape in enumerate(thing.shapes):
        place = thing.placed(k, state)
        high = np.array([(outermost(shape, place, axis) @ axis).max() for axis in np.eye(3)])
        low = np.array([(outermost(shape, place, -axis) @ axis).min() for axis in np.eye(3)])
        middles.append(0.5 * (low + high))
    points = np.array(middles)
    center = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - center, full_matrices=False)
    way = (points - center) @ axes.T
    radii = np.hypot(way[:, 0], way[:, 1])
    radius, n = float(radii.mean()), axes[2]
    flat = np.abs(way[:, 2]).max() <= ROUNDNESS * radius and np.ptp(radii) <= 2.0 * ROUNDNESS * radius
    if not (flat and sizes[1] >= (1.0 - ROUNDNESS) * sizes[0]):  # all around, not an arc
        return None
    level = outwards - (outwards @ n) * n
    # sine of the angle to a ring's axis below which a direction names no place of the rim
    if np.linalg.norm(level) < 0.1:  # it looks along the ring's axis: the rim's highest place
        up = np.array((0.0, 0.0, 1.0))
        level = up - (up @ n) * n
    e = level / np.linalg.norm(level)
    at = thing.placed(0, state)
    local = np.array([n, e, np.cross(n, e)]) @ at.rotation
    shapes = [(shape, thing.placed(k, state)) for k, shape in enumerate(thing.shapes)]
    ends = [np.concatenate([outermost(shape, place, way) @ n for shape, place in shapes]) for way in (n, -n)]
    thick = 0.5 * float(ends[0].max() - ends[1].min())
    # share of a ring's radius along which its rim counts as straight: it turns by 14 degrees
    return Face(thing, at.actInv(center + radius * e), local, np.array([thick, thick, 0.25 * radius]))


class Crossing(NamedTuple):
    """A bar that crosses the palm: one row across the palm, and one along the bar that is zero within its room [m].

    The first row is what x . w has beyond its room, with x the axis of the fingers and w the way from the palm's middle
    to the bar's axis.

    Attributes:
        place: the palm.
        bar: the bar.
        low, high: where along it the palm may be, from its middle [m].
        across: largest x . w, either way [m].
    """

    place: Place
    bar: Face
    low: float
    high: float
    across: float = 0.0

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """None is."""
        return False, False

    def rows(self, state: State) -> tuple[Array, Array]:
        """The two rows, and wrenches."""
        value, rows = self._all(state)
        low, high = np.array([-self.across, -self.high]), np.array([self.across, -self.low])
        excess = value - np.clip(value, low, high)
        return excess, np.where(((excess != 0.0) | (low == high))[:, None], rows, 0.0)

    def planes(self, state: State) -> SupportingPlanes:
        """The ends of the room along the bar, and those across the palm where it has room."""
        value, rows = self._all(state)
        ends = np.array([value[1] + self.low, -value[1] - self.high])
        across = np.array([value[0] - self.across, -value[0] - self.across])
        sides = 4 if self.across else 2
        return one_sided(np.r_[ends, across][:sides], np.vstack([rows[1], -rows[1], rows[0], -rows[0]])[:sides])

    def _all(self, state: State) -> tuple[Array, Array]:
        """What is across the palm and how far the bar's middle is along the bar (2,), and their derivative (2, nv)."""
        center, axes = self.bar.at(state)
        frame, along = state.frame(self.place.frame), axes[2]
        palm, fingers = frame.translation, frame.rotation[:, 0]
        way = center - palm
        level = fingers - (fingers @ along) * along  # x . (1 - l l') (c - p) = level . way
        reach = float(along @ way)
        # of the hand against the thing, seen from the thing: the hand's velocity v and rotation w
        wrench = through(palm, np.array([-level, -along]))
        wrench[0, 3:] += pin.skew(fingers) @ (way - reach * along)
        joints = np.full(2, self.place.joint, dtype=np.intp), np.full(2, self.bar.joint, dtype=np.intp)
        return np.array([level @ way, reach]), state.rows(wrench, *joints)


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
