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
from wholebody.geometry.continuous.motion_bounds import MotionBounds, meeting_blocks
from wholebody.geometry.continuous.swept_depth import compiled_kernel, shapes_of
from wholebody.geometry.pair_distances import PairDistances
from wholebody.geometry.proximity import PairTable

TOLERANCE = 1e-4  # depth up to which an overlap is no contact, metres

MOST_QUERIES = 4000  # most queries of a motion, some 40 us each; ordinary motions take 10 to 100

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

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, table: PairTable | None = None) -> None:
        """Take a geometry, its table or None to make it; an InputError for a joint without bounds, or other shapes."""
        self.model, self.geometry = model, geometry
        self._table = PairTable(model, geometry) if table is None else table
        self._data, self._pairs = model.createData(), self._table.pairs
        self._distances = PairDistances(geometry, self._pairs)
        self._bounds = MotionBounds(model, self._table.joint, self._table.reach)
        self._reach = self._table.reach[self._pairs].sum(axis=1)
        self._shapes, self._kernel = shapes_of(self._table), compiled_kernel()
        self._twist = np.zeros((model.njoints, 6))

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
        if not len(self._pairs if numbers is None else numbers):
            return None
        self._distances.reset()  # the same motion has the same answer, whatever was swept before
        velocity = np.asarray(pin.difference(self.model, q0, q1))
        self._place(q0, velocity)
        centers = self._distances.placed[:, 3].copy()
        self._bounds.update(self._data, velocity, centers)
        index = numbers
        if index is None:
            index = meeting_blocks(self._table, centers, self._bounds.speed.sum(axis=1))
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
            slow = np.flatnonzero((asked[due] > 3) & (safe < TOGETHER))
            if len(slow):
                safe[slow] = self._second_order(index[due[slow]], rows[slow], level[due[slow]], safe[slow])
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

    def _second_order(self, numbers: Indices, rows: Array, level: Array, safe: Array) -> Array:
        """Shares of the motion (k,), at least `safe`, for which planes between pairs keep them above `level` (k,)."""
        data, joint = self._data, self._table.joint[self._pairs[numbers]]
        for number in set(joint.ravel().tolist()) - {0}:
            motion = data.oMi[number].act(data.v[number])
            self._twist[number, :3], self._twist[number, 3:] = motion.linear, motion.angular
        speeds = self._kernel.Speeds(self._bounds.turn, self._bounds.speed, self._bounds.carries)
        sliding = self._kernel.Sliding(
            numbers, np.ascontiguousarray(rows[:, :4]), level, self._distances.placed, self._twist
        )
        self._kernel.keep_apart(sliding, self._shapes, speeds, safe)
        return safe

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
