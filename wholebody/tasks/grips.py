"""Parts of a grip: bars and rings that a hand closes around, and sides of a thing that are pressed against each other.

A bar has the direction of its thing's longest axis; the rim of a ring, such as a steering wheel, counts as one. Two
contacts oppose where their normals are antiparallel within the friction angle (Nguyen 1988, "Constructing force-closure
grasps"); of several fingers the mean of their normals counts.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, cross, with_values
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.hull import coal_convex, coal_triangles
from wholebody.geometry.pieces import swept_points
from wholebody.tasks.axis import across, equidistant_error, equidistant_jacobian
from wholebody.tasks.base import SupportingPlanes, filled
from wholebody.tasks.contact_parts import Gap, Near, between, beyond, ends, no_planes, through
from wholebody.tasks.faces import Face
from wholebody.tasks.inputs import Place
from wholebody.tasks.surfaces import Nearest, Surface, between_transforms, nearest, outermost

ROUNDNESS = 0.1  # largest deviation of a ring's pieces from a circle and its plane, as a share of its radius
STEP = 1e-4  # m, rad: half of the differences that the derivative of a normal is made of
SHORTEST = 1e-6  # length of a mean normal, and sine of an angle, below which they have no direction

BELOW = np.array([-np.inf]), np.zeros(1)  # the range of what is to be at most zero
AHEAD, BEHIND = ([pin.exp6(sign * STEP * axis) for axis in np.eye(6)] for sign in (1.0, -1.0))


def bar_of(thing: Surface, state: State, where: str) -> Face:
    """A "face" through the middle of a thing, whose normal is the thing's longest axis; `half` has all three sizes."""
    at = thing.placed(0, state)
    bounded = [(shape, thing.placed(k, state)) for k, shape in enumerate(thing.shapes) if np.isfinite(thing.reach[k])]
    if not bounded:
        raise InputError(f"{where}: {thing.name!r} is endless, so no hand closes around it; take it with the palm")
    ends = np.array([(-_support(bounded, -along), _support(bounded, along)) for along in at.rotation.T])
    center, half = 0.5 * (ends[:, 0] + ends[:, 1]) - at.rotation.T @ at.translation, 0.5 * (ends[:, 1] - ends[:, 0])
    order = np.argsort(half, kind="stable")
    return Face(thing, center, np.eye(3)[order], half[order])


def _support(pieces: Iterable[tuple[Any, Any]], way: Array) -> float:
    """How far shapes at their placements reach along a unit direction (3,) [m]."""
    return max(float((outermost(shape, place, way) @ way).max()) for shape, place in pieces)


class Rim(NamedTuple):
    """The rim of a ring where it is nearest to a palm, as a bar whose axes are outwards, the ring's and the tangent.

    It goes with the palm: where the palm moves by v along the tangent, at a distance r from the ring's axis, the bar
    turns about that axis by v / r.
    """

    ring: Face  # its middle; the axes of the ring's plane, the first one to the hand's side, and its own
    place: Place  # the palm
    radius: float  # from the middle to the bar [m]
    half: Array  # (3,) of the bar, as of `bar_of` [m]

    @property
    def joint(self) -> int:
        """Joint that carries the ring."""
        return self.ring.joint

    def at(self, state: State) -> tuple[Array, Array]:
        """Middle (3,) and axes (3, 3) in the world."""
        middle, out, axis, _ = self._outwards(state)
        return middle + self.radius * out, np.array([*quarter(out, axis), cross(axis, out)])

    def rows(self, state: State, wrench: Array, joint: int) -> Array:
        """Rows (m, nv) of wrenches (m, 6) on a joint against the bar."""
        middle, out, axis, r = self._outwards(state)
        palm = state.frame(self.place.frame).translation
        turned = wrench[:, :3] @ cross(middle, axis) + wrench[:, 3:] @ axis
        return self.ring.rows(state, wrench - np.outer(turned / r, through(palm, cross(axis, out)[None])), joint)

    def _outwards(self, state: State) -> tuple[Array, Array, Array, float]:
        """The ring's middle (3,), directions (3,) outwards and of its axis, and how far the palm is from that [m]."""
        middle, axes = self.ring.at(state)
        way = state.frame(self.place.frame).translation - middle
        flat = way - (way @ axes[2]) * axes[2]
        r = float(np.linalg.norm(flat))
        return (middle, flat / r, axes[2], r) if r > SHORTEST else (middle, axes[0], axes[2], np.inf)


def quarter(middle: Array, across: Array) -> tuple[Array, Array]:
    """Normals (3,) of the two sides of the quarter about a unit direction (3,), in its plane with one across it."""
    return (middle + across) / np.sqrt(2.0), (middle - across) / np.sqrt(2.0)


def rim_of(thing: Surface, hand: Surface, place: Place, outwards: Array, state: State) -> Rim | None:
    """The rim of a ring for the palm, on its side in a direction (3,); None for no ring.

    The side is turned as little as has what a hand holds already: answers at its edge are answers from there too.
    """
    if len(thing.shapes) < 8:  # least number of pieces of a ring
        return None
    shapes = [(shape, thing.placed(k, state)) for k, shape in enumerate(thing.shapes)]
    at = thing.placed(0, state)
    axes = at.rotation.T  # middles of boxes along these are the same wherever the ring is
    points = 0.5 * np.array([[_support([one], way) - _support([one], -way) for way in axes] for one in shapes]) @ axes
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
    away = state.frame(place.frame).translation - center
    turned = float(np.arctan2(away @ cross(n, e), away @ e))
    if abs(turned) > 0.25 * np.pi and holds(hand, thing, state):
        rest = turned - np.copysign(0.25 * np.pi, turned)
        e = np.cos(rest) * e + np.sin(rest) * cross(n, e)
    local = np.array([*quarter(e, cross(n, e)), n]) @ at.rotation
    ring = Face(thing, at.actInv(center), local, np.full(2, radius))
    thick = 0.5 * (_support(shapes, n) + _support(shapes, -n))
    return Rim(ring, place, radius, np.array([thick, thick, radius]))


def holds(hand: Surface, thing: Surface, state: State) -> bool:
    """Whether a hand is at a thing."""
    return nearest(hand, thing, state).distance < 1e-4  # m: answers may miss contacts by less


class Crossing(NamedTuple):
    """A bar that crosses the palm: one row across the palm, and one along the bar that is zero within its room [m].

    The first row is what x . w has beyond its room, with x the fingers' axis and w the vector from the palm's middle
    to the bar's axis.
    """

    place: Place  # the palm
    bar: Face | Rim  # the bar
    low: float  # where along it the palm may be, from its middle [m]
    high: float
    across: float = 0.0  # largest x . w, either way [m]
    in_radians: tuple[bool, ...] = (False, False)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The two rows, and wrenches."""
        return beyond(*_beside(self.place, self.bar, 0, state), *self._room)

    def planes(self, state: State) -> SupportingPlanes:
        """The ends of the room along the bar, and those across the palm where it has room."""
        open_ = slice(0 if self.across else 1, 2)
        value, rows = _beside(self.place, self.bar, 0, state)
        return ends(value[open_], rows[open_], *(side[open_] for side in self._room))

    @property
    def _room(self) -> tuple[Array, Array]:
        """Ranges (2,) of what is across the palm, and of how far the bar's middle is along the bar."""
        return np.array([-self.across, -self.high]), np.array([self.across, -self.low])


class Oblique(NamedTuple):
    """A bar in the plane of the palm, turned in it within a range from the palm's y: two rows [rad].

    The first is how far the bar is turned beyond the range, about the palm's z from y to x; the second its angle to the
    plane. Either way along the bar will do.
    """

    place: Place  # the palm
    bar: Face | Rim  # the bar
    low: float  # [rad]
    high: float
    in_radians: tuple[bool, ...] = (True, True)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The two angles, and moments."""
        way, turned, axes = self._turned(state)
        least = min(max(turned, self.low), self.high)
        c, s = np.cos(least), np.sin(least)
        basis = np.array([(c, -s, 0.0), (0.0, 0.0, 1.0), (s, c, 0.0)]) @ axes
        components = (basis @ way).tolist()
        values, slopes = equidistant_error(*components), equidistant_jacobian(*components) @ basis
        if self.low < turned < self.high:
            values[0], slopes[0] = 0.0, 0.0
        wrench = np.zeros((2, 6))
        wrench[:, 3:] = slopes @ pin.skew(way)
        return values, self.bar.rows(state, wrench, self.place.joint)

    def planes(self, state: State) -> SupportingPlanes:
        """The ends of the range."""
        way, turned, axes = self._turned(state)
        x, y, _ = axes @ way
        wrench = np.zeros((1, 6))
        wrench[0, 3:] = (y * axes[0] - x * axes[1]) @ pin.skew(way) / max(x * x + y * y, SHORTEST)
        rows = self.bar.rows(state, wrench, self.place.joint)
        return ends(np.array([turned]), rows, np.array([self.low]), np.array([self.high]))

    def _turned(self, state: State) -> tuple[Array, float, Array]:
        """The bar's direction (3,) nearer to the range, its angle from y in the palm, and the palm's axes (3, 3)."""
        way, axes = self.bar.at(state)[1][2], state.frame(self.place.frame).rotation.T
        middle = 0.5 * (self.low + self.high)
        way = -way if np.array((np.sin(middle), np.cos(middle), 0.0)) @ axes @ way < 0.0 else way
        return way, float(np.arctan2(axes[0] @ way, axes[1] @ way)), axes


class Ahead(NamedTuple):
    """A bar's axis at a distance from the palm, on the side where the palm looks: one row [m]."""

    place: Place  # the palm
    bar: Face | Rim  # the bar
    distance: float  # [m]
    in_radians: tuple[bool, ...] = (False,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """How far it is too far away, and a wrench."""
        value, rows = _beside(self.place, self.bar, 2, state)
        return value[:1] - self.distance, rows[:1]


def takes_bar(term: Any) -> bool:
    """Whether a resolved term closes a hand around a bar."""
    return any(isinstance(part, Crossing) for part in getattr(term, "parts", ()))


def opened(term: Any, distance: float) -> Any:
    """A resolved term whose hand is about to close: the bar is in front of the palm by a distance [m], fingers free."""
    if not takes_bar(term):
        return term
    crossing = next(part for part in term.parts if isinstance(part, Crossing))
    ahead = Ahead(crossing.place, crossing.bar, float(crossing.bar.half[1]) + distance)
    parts: list[Any] = [ahead]  # in the place of the hand's gap, which is the first part; rows stay as many
    for part in term.parts[1:]:
        if isinstance(part, Gap):
            parts.append(Near(part.first, part.second, np.inf))
        elif isinstance(part, Crossing):
            parts.append(with_values(part, across=0.0))
        else:
            parts.append(with_values(part, most=np.pi) if isinstance(part, Opposing) else part)
    return filled(term, parts=tuple(parts))


def _beside(place: Place, bar: Face | Rim, axis: int, state: State) -> tuple[Array, Array]:
    """From the palm to a bar's middle along a palm's axis, across and along the bar, metres; derivatives (2, nv)."""
    center, axes = bar.at(state)
    frame, along = state.frame(place.frame), axes[2]
    palm, across_palm = frame.translation, frame.rotation[:, axis]
    way = center - palm
    level = across_palm - (across_palm @ along) * along  # x . (1 - l l') (c - p) = level . way
    reach = float(along @ way)
    # of the hand against the thing, seen from the thing: the hand's velocity v and rotation w
    wrench = through(palm, np.array([-level, -along]))
    wrench[0, 3:] += pin.skew(across_palm) @ (way - reach * along)
    return np.array([level @ way, reach]), bar.rows(state, wrench, place.joint)


class Looking(NamedTuple):
    """An axis of a frame within an angle of a direction in the world, or of a plane across it: one row [rad]."""

    place: Place  # the frame, of a grip the palm
    direction: Array  # (3,) unit
    most: float  # largest angle from it [rad]
    level: bool  # whether the angle is to the plane across the direction
    axis: Array = np.array((0.0, 0.0, 1.0))  # (3,) in the frame
    in_radians: tuple[bool, ...] = (True,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The angle beyond, and a moment."""
        return beyond(*self._signed(state), *BELOW)

    def planes(self, state: State) -> SupportingPlanes:
        """The end of the range of angles."""
        return ends(*self._signed(state), *BELOW)

    def _signed(self, state: State) -> tuple[Array, Array]:
        """The angle beyond, negative within, and its derivative (1, nv)."""
        axis = state.frame(self.place.frame).rotation @ self.axis
        cosine = min(max(float(axis @ self.direction), -1.0), 1.0)
        angle = abs(float(np.arcsin(cosine))) if self.level else float(np.arccos(cosine))
        slope = (1.0 if cosine > 0.0 else -1.0) if self.level else -1.0
        moment = pin.skew(axis) @ self.direction
        wrench = np.zeros((1, 6))
        wrench[0, 3:] = slope * moment / max(float(np.linalg.norm(moment)), 1e-6)
        return np.array([angle - self.most]), between(state, wrench, self.place.joint, 0)


class Opposing(NamedTuple):
    """The normals of one contact and of several others within an angle of opposite: the angle beyond, times a lever."""

    first: Surface  # surface on one side, such as a thumb
    others: tuple[Surface, ...]  # surfaces on the other, such as fingers
    thing: Surface  # what is between them
    smooth: Surface  # the same with its edges `rounded`, whose normals count
    most: float  # largest angle from opposite [rad]
    # distance of the farthest contact from which the angle does not count; nearer, it counts more and more [m]. Far
    # away the normals say where the thing is, not how it is held
    far: float
    # of the arc that the row then measures [m]: so short that a finger rather turns than leaves to where the angle does
    # not count, which ends a descent there
    lever: float
    in_radians: tuple[bool, ...] = (False,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The angle beyond, and wrenches on every finger."""
        found = self._signed(state, 0.0)
        return (np.zeros(1), np.zeros((1, state.model.nv))) if found is None else found

    def planes(self, state: State) -> SupportingPlanes:
        """The end of the range of angles, where it is near."""
        # rad: of a step. Less: measures that pull beyond the end are taken back again and again; more: time.
        found = self._signed(state, -0.3)
        return no_planes(state.model.nv) if found is None else ends(*found, *BELOW)

    def _signed(self, state: State, least: float) -> tuple[Array, Array] | None:
        """The angle beyond, negative within, and its derivative (1, nv); None where it is not more than `least`."""
        surfaces, thing = (self.first, *self.others), self.thing
        distances = [nearest(surface, thing, state).distance for surface in surfaces]
        farthest = distances.index(max(distances))
        left = 1.0 - max(distances[farthest], 0.0) / self.far
        if left <= 0.0:
            return None
        # how much of the angle counts at the distance of the farthest contact, all at contact, and its derivative
        share, fall = left * left, -2.0 * left / self.far * (distances[farthest] > 0.0)
        nears = [nearest(surface, self.smooth, state) for surface in surfaces]
        normals = np.array([near.normal for near in nears])
        total = normals[1:].sum(axis=0)
        length = max(float(np.linalg.norm(total)), SHORTEST)
        mean = total / length
        cosine = min(max(float(-normals[0] @ mean), -1.0), 1.0)
        beyond = float(np.arccos(cosine)) - self.most
        if beyond <= least:
            return None
        ahead = mean + cosine * normals[0]  # of the mean across the first normal: the angle grows along it
        sine = float(np.linalg.norm(ahead))
        toward = ahead / sine if sine > SHORTEST else across(normals[0])[0]
        back = normals[0] + cosine * mean
        other = back / sine if sine > SHORTEST else across(mean)[0]
        row = fall * beyond * Gap(surfaces[farthest], thing).rows(state)[1]
        for number, (surface, near) in enumerate(zip(surfaces, nears, strict=True)):
            force = share * (toward if number == 0 else other / length)
            wrench = _by_twist(surface, self.smooth, near, state) @ force
            row += between(state, wrench[None], near.against, near.joint)
        return np.array([self.lever * share * beyond]), self.lever * row


def rounded(thing: Surface) -> Surface:
    """The surface with boxes and hulls smaller by the radius of their rounded edges; the normals on others stay."""
    return thing.with_shapes(tuple(_rounded(shape) for shape in thing.shapes))


def _rounded(shape: Any) -> Any:
    """A piece smaller by nine tenths of the radius of the largest ball in it, so that normals turn on its faces."""
    if isinstance(shape, coal.Box):
        half = np.asarray(shape.halfSide)
        return coal.Box(*(2.0 * (half - 0.9 * half.min())))
    if not isinstance(shape, coal.Convex):
        return shape
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    normals, offsets = np.split(swept_points(shape).faces, [3], axis=1)
    ball = linprog((0, 0, 0, -1), np.column_stack([normals, np.ones(len(normals))]), offsets, bounds=(None, None)).x
    planes = np.column_stack([normals, 0.9 * ball[3] - offsets])
    hull = ConvexHull(HalfspaceIntersection(planes, ball[:3]).intersections)
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    return coal_convex(hull.points[used], coal_triangles(triangles.reshape(-1, 3)))


def _by_twist(surface: Surface, thing: Surface, near: Nearest, state: State) -> Array:
    """Derivative (6, 3) of the normal of two pieces by the twist of the first at the world's origin, by differences."""
    key = "twist", id(surface.shapes), id(thing.shapes)
    kept = state.kept.get(key)
    if kept is None or kept[0] is not near:  # rows and planes of one posture share it
        i, j = near.pieces
        (place, still), normals = near.places, np.empty((12, 3))
        other = coal.Transform3s(still)
        for row, moved in enumerate((*AHEAD, *BEHIND)):
            at = coal.Transform3s(moved * place)
            normals[row] = between_transforms(surface.shapes[i], at, thing.shapes[j], other).normal
        kept = state.kept[key] = near, (normals[:6] - normals[6:]) / (2.0 * STEP)
    return np.asarray(kept[1])
