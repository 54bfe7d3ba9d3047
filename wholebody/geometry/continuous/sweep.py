"""The first contact of the motion from one posture to another, by conservative advancement.

Each pair is safe for the time that is its distance divided by the largest rate at which it can decrease
(`wholebody.geometry.continuous.motion_bounds`). The motion advances by the shortest such time, coal computes the
distances of the pairs that are due, and so on. So no pair can be passed between two queries, however thin (Mirtich
1996; Zhang, Lee and Kim 2006).

Pieces that slide on each other would need very many queries. For them the distance to a plane that moves with one of
the two pieces is bounded to second order: heights, their exact rates and a bound of their acceleration. The plane
supports that piece, so the least height of the other piece bounds the distance from below, in penetration too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, brief
from wholebody.base.errors import InputError
from wholebody.geometry.continuous.motion_bounds import MotionBounds
from wholebody.geometry.large_models import pairs_of
from wholebody.geometry.pair_distances import PairDistances
from wholebody.geometry.pieces import swept_points

TOLERANCE = 1e-4
"""Depth up to which an overlap is no contact, metres."""

MOST_QUERIES = 4000
"""Most queries of a motion, some 40 us each; ordinary motions take 10 to 100."""

TOGETHER = 0.05
"""Pairs due within this share of the motion are queried together: a query costs more than the pairs in it."""


@dataclass(frozen=True)
class FirstContact:
    """The first contact of a motion.

    Attributes:
        fraction: share of the motion, 0 to 1, that is free of contact.
        q: (nq,) the posture there; no pair is deeper than the tolerance allows.
        index: the pair that touches, as an index into the geometry model's collision pairs.
        pair: the two pieces of it.
        distance: its signed distance there, metres.
        certain: true if the pair touches there; false if the queries ran out there: the motion is free so far and
            unknown beyond.
    """

    __repr__ = brief

    fraction: float
    q: Array
    index: int
    pair: tuple[int, int]
    distance: float
    certain: bool


class Sweep:
    """Sweeps of one model and geometry; one object serves many motions."""

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel) -> None:
        """Read the pieces and pairs once; an InputError for a joint whose motion cannot be bounded, or other shapes."""
        self.model, self.geometry = model, geometry
        self._data, self._pairs = model.createData(), pairs_of(geometry)
        self._distances = PairDistances(geometry, self._pairs)
        self._places = self._distances.data.oMg
        self._swept = [swept_points(piece.geometry) for piece in geometry.geometryObjects]
        joint = np.array([piece.parentJoint for piece in geometry.geometryObjects], dtype=np.intp)
        reach = np.array([swept.reach for swept in self._swept], dtype=float)
        self._bounds = MotionBounds(model, joint, reach)
        self._reach = reach[self._pairs].sum(axis=1)

    def first_contact(
        self,
        q0: Array,
        q1: Array,
        numbers: Indices | None = None,
        tolerance: float = TOLERANCE,
        *,
        over: Callable[[], bool] = bool,
    ) -> FirstContact | None:
        """First contact on the geodesic ``pinocchio.interpolate(model, q0, q1, t)``; None if the whole motion is free.

        A contact is a pair deeper by `tolerance` than touching, or, if it overlaps at the start already, deeper by
        `tolerance` than there: soles may stay on the floor and hands on a handle, and an overlap may be left, but not
        be made worse. A motion that makes some pair deeper by `tolerance` is always reported, one that makes none
        deeper by half of it never. So nothing thicker than twice the tolerance is ever passed.

        Args:
            q0: (nq,) start of the motion.
            q1: (nq,) its end.
            numbers: (k,) places of the pairs to test among the collision pairs of the geometry model; all by default.
            tolerance: metres.
            over: whether the queries end here; the answer is then not `certain`.

        Raises:
            InputError: postures of the wrong shape, not finite or with a quaternion that is not of unit length; a
                tolerance below 1e-5 m.
        """
        q0, q1 = self._checked(q0, "start"), self._checked(q1, "end")
        if not (np.isfinite(tolerance) and tolerance >= 1e-5):
            raise InputError(f"sweep: tolerance is {tolerance!r}; give at least 1e-5 m, ten times coal's own accuracy")
        index = np.arange(len(self._pairs)) if numbers is None else numbers
        if not len(index):
            return None
        self._distances.reset()  # the same motion has the same answer, whatever was swept before
        velocity = np.asarray(pin.difference(self.model, q0, q1))
        self._place(q0, velocity)
        centers = self._distances.placed[:, 3].copy()
        self._bounds.update(self._data, velocity, centers)
        speed = self._bounds.approach(self._pairs[index, 0], self._pairs[index, 1])
        between = centers[self._pairs[index, 0]] - centers[self._pairs[index, 1]]
        near = np.sqrt(np.einsum("ij,ij->i", between, between)) < self._reach[index] + speed
        near &= speed > 0.0  # spheres that cannot meet need no query
        index, speed = index[near], speed[near]
        if not len(index):
            return None
        return self._advance(q0, velocity, index, speed, tolerance, over)

    def _advance(
        self, q0: Array, velocity: Array, index: Indices, speed: Array, tolerance: float, over: Callable[[], bool]
    ) -> FirstContact | None:
        start = self._distances.measured(index)[:, 0]
        level = np.minimum(start, 0.0) - tolerance
        free = (start - level) / speed
        asked = np.zeros(len(index), dtype=int)
        now = 0.0
        for _ in range(MOST_QUERIES):
            now = float(free.min())
            if now >= 1.0:
                return None
            q = np.asarray(pin.integrate(self.model, q0, now * velocity))
            self._place(q, velocity)
            due = np.flatnonzero(free <= now + TOGETHER)
            rows = self._distances.measured(index[due])
            room = rows[:, 0] - level[due]
            worst = int(np.argmin(room))
            if room[worst] <= 0.5 * tolerance:
                return self._found(now, q, int(index[due[worst]]), float(rows[worst, 0]), True)
            safe = room / speed[due]
            asked[due] += 1
            # Queries after which a pair is bounded to second order, which costs more and helps only if pieces slide.
            for k in np.flatnonzero((asked[due] > 3) & (safe < TOGETHER)):
                safe[k] = max(safe[k], self._second_order(int(index[due[k]]), rows[k], float(level[due[k]])))
            free[due] = np.maximum(free[due], now + safe)
            if free.min() < 1.0 and over():
                break
        worst = int(np.argmin(free))
        q = np.asarray(pin.integrate(self.model, q0, now * velocity))
        self._place(q, velocity)
        distance = float(self._distances.measured(index[worst : worst + 1])[0, 0])
        return self._found(now, q, int(index[worst]), distance, False)

    def _found(self, fraction: float, q: Array, index: int, distance: float, certain: bool) -> FirstContact:
        first, second = (int(k) for k in self._pairs[index])
        return FirstContact(fraction, q, index, (first, second), distance, certain)

    def _second_order(self, index: int, row: Array, level: float) -> float:
        """Share of the motion for which a plane between the pair, fixed to either piece, keeps them above `level`."""
        first, second = (int(k) for k in self._pairs[index])
        normal = row[1:4]
        if not normal @ normal > 0.25:
            return 0.0
        best = 0.0
        for points, plane, out in ((first, second, -normal), (second, first, normal)):
            if len(self._swept[points].points) and (
                len(self._swept[plane].points) or np.isinf(self._swept[plane].reach)
            ):
                best = max(best, self._planes_keep(points, plane, self._planes(plane, out), float(row[0]), level))
        return best

    def _planes(self, piece: int, normal: Array) -> Array:
        """Directions (k, 3) in which to bound a piece: a normal of coal's, and that of the face nearest to it.

        Every direction gives a valid bound, but a wide face needs its exact normal for a useful one: where faces touch,
        coal's normal can be 1e-4 rad off.
        """
        swept, rotation = self._swept[piece], self._places[piece].rotation
        if not len(swept.faces):
            return normal[None]
        faces = swept.faces[:, :3] @ rotation.T
        face = faces[int(np.argmax(faces @ normal))]
        return face[None] if np.isinf(swept.reach) else np.array([face, normal])

    def _planes_keep(self, points: int, plane: int, normals: Array, distance: float, level: float) -> float:
        """Time until a swept point of `points` can reach `level` above supporting planes (k, 3) of `plane`."""
        swept, base = self._swept[points], self._swept[plane]
        at, below = self._places[points], self._places[plane]
        if np.isinf(base.reach):
            heights = base.faces[0, 3] + normals @ below.translation
        else:
            heights = (base.points @ below.rotation.T @ normals.T).max(axis=0) + normals @ below.translation
        corners = swept.points @ at.rotation.T + at.translation
        room = corners @ normals.T - (heights + swept.radius + base.radius + level)
        above = room.min(axis=0) > 0.0
        if not above.any():
            return 0.0
        room = room[:, above]
        rate = (self._velocities(points, corners) - self._velocities(plane, corners)) @ normals[above].T
        bend = self._bounds.curvature(points, plane, distance)
        if bend <= 0.0:
            times = np.where(rate < 0.0, room / np.maximum(-rate, 1e-300), np.inf)
        else:
            times = (rate + np.sqrt(rate * rate + 2.0 * bend * room)) / bend
        return float(times.min(axis=0).max())

    def _velocities(self, piece: int, places: Array) -> Array:
        """Velocities (k, 3) of points at `places` that move with the piece's body."""
        joint = int(self._bounds.joint[piece])
        if joint == 0:
            return np.zeros_like(places)
        motion = self._data.oMi[joint].act(self._data.v[joint])
        return np.asarray(motion.linear + places @ pin.skew(motion.angular).T)

    def _place(self, q: Array, velocity: Array) -> None:
        pin.forwardKinematics(self.model, self._data, q, velocity)
        self._distances.place(self.model, self._data)

    def _checked(self, q: Array, which: str) -> Array:
        q = np.asarray(q, dtype=float)
        if q.shape != (self.model.nq,):
            raise InputError(f"sweep: the {which} has shape {q.shape}; a posture has shape ({self.model.nq},)")
        if not np.isfinite(q).all():
            raise InputError(f"sweep: the {which} is not finite at entry {int(np.argmin(np.isfinite(q)))}")
        if not pin.isNormalized(self.model, q, 1e-6):
            raise InputError(f"sweep: a quaternion of the {which} is not of unit length; use pinocchio.normalize")
        return q
