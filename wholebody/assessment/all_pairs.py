"""Distances of all pairs of a scene at a posture: what judgements of postures look at, without culling or memory.

Of few pairs coal is asked for every one; of many for all that balls and boxes about their pieces do not tell apart.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, cross
from wholebody.base.errors import InputError
from wholebody.base.pool import Pool
from wholebody.figures.state import State
from wholebody.geometry.memory_views import RESULT_FIELDS
from wholebody.geometry.pair_distances import PairDistances
from wholebody.scene.geometry_model import SceneGeometry

MANY = 3000  # pairs from which on they are bounded first; coal takes 0.4 us for each, a bound 0.02 us

NEAR = 8  # first pieces whose distances to all second ones, 0.3 MB of 5,000, stay in the processor's own memory

NOT_A_NUMBER = "a distance is not a number; an object's placement or shape is broken"

Label = tuple[Literal["contact", "limit", "bound", "constraint"], tuple[str, ...]]


class AllPairs:
    """All pairs of a scene, at one posture after the other; on data of its own, borrowed by one judgement at a time.

    Attributes:
        state: the kinematic state of the last posture.
        distance: (pairs,) signed distance of every pair there, metres. In a scene of `MANY` pairs or more a lower bound
            of those that no question was about: they do not overlap, and are farther apart than the nearest pair and
            than what `nearer` and `ask` were asked.
        least: the least of them; inf without pairs.
        none: no pairs.
    """

    def __init__(self, built: SceneGeometry) -> None:
        self._built, self.state = built, State(built.model)
        pairs = built.table.pairs
        self._distances = PairDistances(built.geometry, pairs)
        self._bounds = _Balls(pairs, built.table.reach) if len(pairs) >= MANY else None
        self._found = np.zeros((0, RESULT_FIELDS))  # of all pairs, or where they are bounded, of those that were asked
        self._row = np.full(len(pairs), -1, dtype=np.intp)  # where a pair is among these; -1 where it was not asked
        self._near = np.empty(len(pairs), dtype=bool)
        self.distance, self.least = np.zeros(0), float("inf")
        none = np.zeros(0, dtype=np.intp)
        self.none = NearPairs(built, none, pairs[none], np.zeros((0, RESULT_FIELDS)), np.zeros((0, 2, 4, 3)))

    def move(self, q: Array) -> None:
        """Measure all pairs at the posture q (nq,); InputError for a q or a distance that is no finite number."""
        distances = self._distances
        self.state.update(q)
        with self._built.lock:  # not while a thing is moved, one piece after the other
            distances.place(self._built.model, self.state.data)
        distances.reset()
        if self._bounds is None:
            self._found, self.least = _numbers(distances.all_measured())
            self.distance = self._found[:, 0].copy()
        else:
            if np.isnan(distances.placed).any():
                raise InputError(NOT_A_NUMBER)
            self.distance = self._bounds.gaps(distances.placed[:, 3])
            self._row[:], self._found = -1, np.zeros((0, RESULT_FIELDS))
            self.ask(0.0)  # what overlaps is counted
            if not len(self._found):
                self._ask(np.array([np.argmin(self.distance)]))
            self.ask(max(0.0, float(self._found[:, 0].min())))
            self.least = float(self._found[:, 0].min(initial=np.inf))

    def shortfalls(self, q: Array, clearances: Array) -> tuple[Array, Array, Array]:
        """Joints (k, njoints, 4, 3), deepest overlap and shortfall (k,) at q (k, nq) for clearances (k, pairs)."""
        table, distances, depth, short = self._built.table, self._distances, *np.zeros((2, len(q)))
        joints = np.empty((len(q), self._built.model.njoints, 4, 3))
        placed = np.empty((len(q), *distances.placed.shape))
        for k, posture in enumerate(q):
            self.state.update(posture)
            with self._built.lock:
                distances.place(self._built.model, self.state.data)
            joints[k], placed[k] = self.state.joints, distances.placed
        within = np.maximum(clearances, 0.0)
        row, number = np.nonzero(~(self._gaps(placed[:, :, 3]) >= within))  # those whose bound is not a number too
        pair = table.pairs[number]
        near = ~(_between_boxes(placed[row[:, None], pair], table.half[pair]) >= within[row, number])
        row, number = row[near], number[near]
        for k in np.unique(row).tolist():
            asked = number[row == k]
            distances.put(placed[k])
            distances.reset()
            found, least = _numbers(distances.measured(asked))
            depth[k], short[k] = max(0.0, -least), max(0.0, (clearances[k, asked] - found[:, 0]).max())
        return joints, depth, short

    def _gaps(self, centres: Array) -> Array:
        """Gaps (k, pairs) between balls about pieces with centres (k, n, 3)."""
        if self._bounds is not None:
            return np.array([self._bounds.gaps(centre).copy() for centre in centres])
        (first, second), reach = self._built.table.pairs.T, self._built.table.reach
        away = centres[:, second] - centres[:, first]
        return np.asarray(np.sqrt(np.einsum("kpi,kpi->kp", away, away)) - (reach[first] + reach[second]))

    def ask(self, within: Array | float) -> None:
        """Let `distance` be exact for all pairs that are nearer than `within` metres, (pairs,) or one for all."""
        if self._bounds is None:
            return
        beyond = np.greater_equal(self.distance, within, out=self._near)
        number = np.flatnonzero(np.logical_not(beyond, out=beyond))  # those whose bound is not a number too
        number = number[self._row[number] < 0]
        table = self._built.table
        pair = table.pairs[number]
        between = _between_boxes(self._distances.placed[pair], table.half[pair])
        self.distance[number] = np.maximum(self.distance[number], between)
        self._ask(number[~(self.distance[number] >= np.broadcast_to(within, self.distance.shape)[number])])

    def _ask(self, number: Indices) -> None:
        """Ask coal for pairs (k,)."""
        found, _ = _numbers(self._distances.measured(number))
        self.distance[number], self._row[number] = found[:, 0], len(self._found) + np.arange(len(number))
        self._found = np.concatenate([self._found, found])

    def nearer(self, within: Array) -> NearPairs:
        """What there is to know of pairs nearer than `within` (pairs,), metres; it outlives the next `move`."""
        self.ask(within)
        number = (self.distance < within).nonzero()[0]  # each of them was asked
        rows = number if self._bounds is None else self._row[number]
        pair = self._built.table.pairs[number]
        return NearPairs(self._built, number, pair, self._found[rows], self._distances.placed[pair])


def _between_boxes(placed: Array, half: Array) -> Array:
    """Greatest gap (k,) along a world's axis between boxes of half sizes (k, 2, 3) at placements (k, 2, 4, 3)."""
    extent = np.einsum("ksji,ksj->ki", np.abs(placed[:, :, :3]), half)
    return np.asarray((np.abs(placed[:, 1, 3] - placed[:, 0, 3]) - extent).max(axis=1))


class _Balls:
    """Gaps between balls about the pieces of all pairs, by one table over all first and all second pieces."""

    def __init__(self, pairs: Indices, reach: Array) -> None:
        (self._first, row), (self._second, column) = (np.unique(side, return_inverse=True) for side in pairs.T)
        self._cell, self._reach = row * len(self._second) + column, reach[pairs].sum(axis=1)
        # room: to ask the system for megabytes takes longer than to fill them
        self._away, self._square = np.empty((NEAR, len(self._second))), np.empty((len(self._first), len(self._second)))
        self._apart = np.empty(len(pairs))

    def gaps(self, centre: Array) -> Array:
        """(pairs,) metres, of pieces with these centres (n, 3); overwritten by the next call."""
        first, second = centre[self._first], np.ascontiguousarray(centre[self._second].T)
        for row in range(0, len(first), NEAR):
            some, square = first[row : row + NEAR], self._square[row : row + NEAR]
            away = self._away[: len(some)]
            for k in range(3):
                np.subtract(some[:, None, k], second[k], out=away)
                np.multiply(away, away, out=away if k else square)
                if k:
                    np.add(square, away, out=square)
            np.sqrt(square, out=square)
        np.take(self._square.ravel(), self._cell, out=self._apart, mode="clip")
        self._apart -= self._reach
        return self._apart


def _numbers(found: Array) -> tuple[Array, float]:
    """Distances with what belongs to them (k, 10), where all are numbers, and the least."""
    least = float(np.minimum.reduce(found[:, 0], initial=np.inf))  # NaN where one is, in half the time of isnan
    if least != least:
        raise InputError(NOT_A_NUMBER)
    return found, least


def all_pairs(built: SceneGeometry) -> Pool[AllPairs]:
    """What judgements of a scene borrow."""
    return built.pool(AllPairs, lambda: AllPairs(built))


class NearPairs(NamedTuple):
    """Some pairs of a scene at a posture; arrays have k rows."""

    built: SceneGeometry  # the scene's geometry; where its pieces are now is not read
    number: Indices  # (k,) places among the geometry model's collision pairs
    pair: Indices  # (k, 2) the two pieces
    found: Array  # (k, 10) distance, normal from the first piece to the second, nearest points of both
    placement: Array  # (k, 2, 4, 3) where both pieces were: columns of the rotation, then the translation

    def label(self, row: int) -> Label:
        """What the pair in a row is called."""
        first, second = self.pair[row].tolist()
        return "contact", (self.built.owners[first], self.built.owners[second])

    def gradients(self, state: State) -> tuple[Array, list[int]]:
        """Derivatives (n, nv) of the gaps at the corners of the patches, and the row of the pair of each (n,)."""
        corners = [(row, *corner) for row in range(len(self.number)) for corner in self._patch(row)]
        rows = np.zeros((len(corners), state.model.nv))
        numbers = [corner[0] for corner in corners]
        if not corners:
            return rows, numbers
        normals, points = np.array([corner[1] for corner in corners]), np.array([corner[2] for corner in corners])
        wrenches = np.hstack([normals, cross(points, normals)])
        pieces = self.built.geometry.geometryObjects
        joints = np.array([[int(pieces[k].parentJoint) for k in pair] for pair in self.pair.tolist()])[numbers]
        for side, sign in ((1, 1.0), (0, -1.0)):
            for joint in set(joints[:, side].tolist()) - {0}:
                moved = joints[:, side] == joint
                jacobian = pin.getJointJacobian(state.model, state.data, joint, pin.WORLD)
                rows[moved] += sign * wrenches[moved] @ jacobian.reshape(6, -1)  # of one degree of freedom it is (6,)
        return rows, numbers

    def _patch(self, row: int) -> list[tuple[Array, Array]]:
        """Normal and place of the witness point and of the corners of the contact patch."""
        normal, places = self.found[row, 1:4], [self.found[row, 4:7]]
        if np.linalg.norm(normal) < 0.5:
            return []
        first, placed_first, second, placed_second = (*self._placed(row, 0), *self._placed(row, 1))
        request, contact = coal.CollisionRequest(), coal.CollisionResult()
        # m: beyond the nearest points up to which corners of a contact patch count
        request.security_margin = float(self.found[row, 0]) + 1e-4
        coal.collide(first, placed_first, second, placed_second, request, contact)
        if contact.isCollision():
            patch = coal.ContactPatchResult()
            try:
                coal.computeContactPatch(
                    first, placed_first, second, placed_second, contact, coal.ContactPatchRequest(), patch
                )
                for number in range(patch.numContactPatches()):
                    polygon = patch.getContactPatch(number)
                    places += [np.array(polygon.getPoint(i)) for i in range(polygon.size())]
            except (RuntimeError, ValueError):
                pass  # coal has no patch for this pair of shapes; the witness point stands alone
        return [(normal, place) for place in places]

    def _placed(self, row: int, side: int) -> tuple[Any, Any]:
        piece = self.built.geometry.geometryObjects[int(self.pair[row, side])].geometry
        place = self.placement[row, side]
        return piece, coal.Transform3s(place[:3].T, place[3])
