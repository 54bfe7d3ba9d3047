"""Signed distances between all pairs of a geometry model: coal for those that can be near.

A pair cannot be near where it was farther away than both pieces have moved since, or where spheres or boxes around its
pieces are apart. Telling this takes some 5 us for 1,000 pairs.
"""

from __future__ import annotations

import time
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import number
from wholebody.geometry.guesses import Guesses
from wholebody.geometry.memory_views import RESULT_DOUBLES, fields, placement_view, read_result, result_view
from wholebody.geometry.single_pairs import KEPT, SinglePairs, pair_data
from wholebody.geometry.swept_points import swept_points

COAL_ACCURACY = 1e-6  # m: of coal's distances
PENETRATION = 1e-5  # m: deeper than this a pair is called inside of each other; what touches is solved to it

SINGLY = 3000
"""Pairs of a scene from which on those that survive are asked one by one: to go through all that are not asked takes
Pinocchio 1 ns for each of them, to be called 200 ns for each that is."""

AWAY = 10.0  # m: between pieces that stand anywhere
ENDLESS = 1e9  # m: what counts for the reach of a half-space, and half the size of its box


class Contacts(NamedTuple):
    """Pairs nearer than a query distance. All arrays have k rows, and no gaps in memory.

    Attributes:
        pair: (k, 2) indices of the two pieces in the geometry model.
        distance: (k,) signed distance, metres; negative when one is inside the other.
        normal: (k, 3) unit vector from the first piece to the second, also in penetration.
        point_a: (k, 3) witness point on the first piece, world.
        point_b: (k, 3) witness point on the second; point_b - point_a = distance * normal.
        number: (k,) place of the pair among the geometry model's collision pairs.
        placements: (n, 4, 3) where all pieces were: columns of the rotation, then the translation.
    """

    pair: Indices
    distance: Array
    normal: Array
    point_a: Array
    point_b: Array
    number: Indices
    placements: Array

    def nearest_first(self) -> Contacts:
        """The same in the order of their distances."""
        return self._rows(np.argsort(self.distance, kind="stable"))

    def nearer(self, distance: float) -> Contacts:
        """Those that are nearer than a distance, metres.

        Raises:
            InputError: the distance is no number.
        """
        distance = number(distance, "nearer: distance", -np.inf, np.inf, "m")
        return self._rows(np.flatnonzero(self.distance < distance))

    def joined(self, others: Contacts) -> Contacts:
        """These and others at the same placements."""
        return Contacts(
            np.concatenate([self.pair, others.pair]), np.concatenate([self.distance, others.distance]),
            np.concatenate([self.normal, others.normal]), np.concatenate([self.point_a, others.point_a]),
            np.concatenate([self.point_b, others.point_b]), np.concatenate([self.number, others.number]),
            self.placements,
        )  # fmt: skip

    def _rows(self, rows: Indices) -> Contacts:
        return Contacts(
            self.pair[rows], self.distance[rows], self.normal[rows], self.point_a[rows], self.point_b[rows],
            self.number[rows], self.placements,
        )  # fmt: skip


class _ContactBuffer:
    """Room for contacts.

    Attributes:
        size: how many contacts it has room for.
        distance: (size,) see `Contacts`, like the following.
        vectors: (3, size, 3) normals, points on the first and on the second piece.
        number: (size,).
        pair: (size, 2).
    """

    def __init__(self, size: int) -> None:
        """Allocate."""
        self.size = size
        self.distance, self.vectors = np.empty(size), np.empty((3, size, 3))
        self.number, self.pair = np.empty(size, dtype=np.intp), np.empty((size, 2), dtype=np.intp)
        self._front: dict[int, Contacts] = {}

    def contacts(self, count: int, placements: Array) -> Contacts:
        """The first `count` of the contacts; the same object where both arguments are the same."""
        known = self._front.get(count)
        if known is None or known.placements is not placements:
            normal, point_a, point_b = self.vectors[:, :count]
            known = self._front[count] = Contacts(
                self.pair[:count], self.distance[:count], normal, point_a, point_b, self.number[:count], placements
            )
        return known


class PairTable:
    """The pieces and pairs of a geometry model as arrays: what is the same at every posture, and never changes.

    Attributes:
        model: Pinocchio's model.
        geometry: the geometry model; only the placements of its pieces may change.
        swept: the swept points of every piece.
        pairs: (pairs, 2) indices of the two pieces of every collision pair.
        joint: (n,) joint that carries each piece; 0 is the world.
        reach: (n,) radius of each piece about its origin, metres; infinite for a half-space.
        half: (n, 3) half the size of a box about each piece's origin, along its own axes, metres.
        widths: (pairs,) width of both pieces together, metres.
        points: (m, 3) swept points of all pieces, one piece after the other, each in its piece's frame.
        first_point: (n + 1,) where those of each piece begin.
        radius: (n,) around them, metres.
        points_meet: (pairs,) distance at and below which coal's normal means nothing, metres; -inf for most pairs.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, pairs: Indices | None = None) -> None:
        """Read the pieces and pairs.

        Args:
            model: Pinocchio's model.
            geometry: the geometry model.
            pairs: its pairs (pairs, 2), where they are known: to read a hundred thousand of them takes half a second.

        Raises:
            InputError: a geometry that is not a convex piece.
        """
        self.model, self.geometry = model, geometry
        self.swept = [swept_points(piece.geometry) for piece in geometry.geometryObjects]
        if pairs is None:
            listed = [[pair.first, pair.second] for pair in geometry.collisionPairs]
            pairs = np.array(listed, dtype=np.intp).reshape(-1, 2)
        self.pairs: Indices = pairs
        self.joint: Indices = np.array([piece.parentJoint for piece in geometry.geometryObjects], dtype=np.intp)
        self.reach = np.array([swept.reach for swept in self.swept]).reshape(-1)
        self.half = np.minimum(np.array([swept.half for swept in self.swept]).reshape(-1, 3), ENDLESS)
        width = np.array([swept.width for swept in self.swept]).reshape(-1)
        self.widths: Array = width[self.pairs].sum(axis=1)
        radius = self.radius = np.array([swept.radius for swept in self.swept]).reshape(-1)
        self.points = np.concatenate([np.zeros((0, 3)), *(swept.points for swept in self.swept)])
        counts = [len(swept.points) for swept in self.swept]
        self.first_point: Indices = np.cumsum([0, *counts], dtype=np.intp)
        # where round pieces' swept points meet, coal's normal is zero or noise along an axis
        self.points_meet = np.where(
            (radius[self.pairs] > 0.0).all(axis=1), COAL_ACCURACY - radius[self.pairs].sum(axis=1), -np.inf
        )


class Kinematics(Protocol):
    """What knows where the joints of a model are, such as `figures.state.State`."""

    @property
    def data(self) -> Any:
        """Pinocchio's data, with the joints' placements."""


class Joints(NamedTuple):
    """Where the joints of a model are: Pinocchio's data after its forward kinematics."""

    data: Any


class Proximity:
    """Distances of every collision pair of a geometry model, re-used from posture to posture by one run at a time.

    The pieces stand where the geometry model had them when this was made; see `place_piece`.

    Attributes:
        table: the pieces and pairs.
        geometry: the geometry model with the pieces' own placements.
        seconds: what all queries have taken together.
        asked: how many distances coal was asked for.
    """

    def __init__(self, table: PairTable) -> None:
        """Lay views over results of Pinocchio that nothing else uses."""
        self.table = table
        self.geometry = table.geometry.copy()  # shapes are shared
        self.seconds = 0.0
        self.asked = 0
        self.results = pair_data(self.geometry, len(table.pairs))
        self._guesses = Guesses(self.results)
        self._kernel = compiled_kernel()
        count, pairs = self.geometry.ngeoms, len(table.pairs)
        self._singly = pairs >= SINGLY
        self._index, self._changed = np.zeros((2, pairs), dtype=np.intp)
        self._marked, self._count = np.zeros(pairs, dtype=np.intp), 0
        self._travelled, self._bound = np.zeros(count), np.full(pairs, -np.inf)
        self._endless = np.full(pairs, np.inf)
        self._placed, self._buffer = np.zeros((count, 4, 3)), _ContactBuffer(64)
        self._last, self._extent = np.zeros((count, 4, 3)), np.zeros((count, 3))
        self._lay_views()

    def reset(self) -> None:
        """Forget how near each pair was and where coal ended for it: the same queries give the same answers again."""
        self._guesses.reset()
        self._ask_nothing()
        self._travelled[:] = 0.0
        self._bound[:] = -np.inf

    def place_piece(self, index: int, placement: pin.SE3) -> None:
        """Place a piece anew in its joint's frame."""
        self.geometry.geometryObjects[index].placement = placement

    def _lay_views(self) -> None:
        for k in range(self.geometry.ngeoms):  # anywhere apart: views are laid over results that were computed
            self.results.oMg[k] = pin.SE3(np.eye(3), np.array([AWAY * k, 0.0, 0.0]))
        self._kept, self._single = len(self.table.pairs) <= KEPT, SinglePairs(self.geometry)
        if self._kept:
            pin.computeDistances(self.geometry, self.results)
            self._distances = result_view(self.results.distanceResults)
        else:  # memory that is never written takes none
            pin.updateGeometryPlacements(self.table.model, self.table.model.createData(), self.geometry, self.results)
            self._distances = np.zeros((len(self.table.pairs), RESULT_DOUBLES))
        self._placements = placement_view(self.results.oMg)
        self.reset()

    def placements(self, state: Kinematics) -> Array:
        """Placements (n, 4, 3) of the pieces with the joints as in `state`; see `Contacts.placements`."""
        pin.updateGeometryPlacements(self.table.model, state.data, self.geometry, self.results)
        if self._placements is not None:
            return np.array(self._placements)
        return np.array([[*M.rotation.T, M.translation] for M in self.results.oMg], dtype=float).reshape(-1, 4, 3)

    def query(self, state: Kinematics, within: float, most: Array | None = None) -> Contacts:
        """Every pair nearer than `within` metres with the joints as in `state`, in the order of the pairs.

        With `most`, shape (pairs,), a pair that is as far apart as its entry [m] is left out too. Nothing else is left
        out. Results of pairs that were culled are never read: coal leaves old numbers in them.
        """
        began = time.perf_counter()
        placements = self.placements(state)
        most = self._endless if most is None else most
        index = self._asked(placements, within, most)
        contacts = self._gather(_ContactBuffer(len(index)), placements, index, within, most)
        self.seconds += time.perf_counter() - began
        return contacts

    def query_views(self, state: Kinematics, within: float, most: Array | None = None) -> Contacts:
        """What `query` returns, in arrays that the next call of this overwrites."""
        began = time.perf_counter()
        if self._placements is None:
            placements = self.placements(state)
        else:
            pin.updateGeometryPlacements(self.table.model, state.data, self.geometry, self.results)
            placements = self._placed
            placements[:] = self._placements
        most = self._endless if most is None else most
        index = self._asked(placements, within, most)
        if len(index) > self._buffer.size:
            self._buffer = _ContactBuffer(2 * len(index))
        contacts = self._gather(self._buffer, placements, index, within, most)
        self.seconds += time.perf_counter() - began
        return contacts

    def _asked(self, placements: Array, within: float, most: Array) -> Indices:
        """Compute with coal the distances of all pairs that can be nearer than `within`; their indices."""
        table, kernel = self.table, self._kernel
        results = self.results
        try:
            count, gone, came = kernel.look(
                placements, self._last, table.pairs, table.reach, table.half, self._travelled, self._bound,
                self._extent, within, most, self._index, self._marked, self._count, self._changed,
            )  # fmt: skip
            self._count = count
            self.asked += count
            if not self._kept:
                numbers = self._index[:count]
                assert self._distances is not None
                fields(self._distances)[numbers] = self._single.measured(placements, table.pairs[numbers])
                return numbers
            if self._singly:
                for number in self._index[:count].tolist():
                    pin.computeDistance(self.geometry, results, number)
                return self._index[:count]
            if gone or came:
                changed = self._changed[: gone + came].tolist()
                for number in changed[:gone]:
                    results.deactivateCollisionPair(number)
                for number in changed[gone:]:
                    results.activateCollisionPair(number)
            if count:
                pin.computeDistances(self.geometry, results)
        except BaseException:  # Ctrl-C between what is noted and what Pinocchio is told: begin again from no pairs
            self._ask_nothing()
            raise
        return self._index[:count]

    def _ask_nothing(self) -> None:
        self.results.deactivateAllCollisionPairs()
        self._count = 0

    def _gather(self, room: _ContactBuffer, placements: Array, index: Indices, within: float, most: Array) -> Contacts:
        results, known = self._distances, self.table
        if results is None:
            results = np.zeros((len(known.pairs), RESULT_DOUBLES))
            for number in index.tolist():
                fields(results)[number] = read_result(self.results.distanceResults[number])
        count, broken = self._kernel.gather(
            results, index, known.pairs, known.points_meet, self._travelled, self._bound, 10.0 * COAL_ACCURACY, within,
            most, room.distance, room.vectors, room.number, room.pair,
        )  # fmt: skip
        contacts = room.contacts(count, placements)
        if broken:
            self._repair_normals(contacts)
        return contacts

    def _repair_normals(self, contacts: Contacts) -> None:
        """Give a normal to pairs where coal has none: capsule axes that cross exactly, concentric spheres."""
        placements = contacts.placements
        for row in np.flatnonzero(contacts.distance <= self.table.points_meet[contacts.number]):
            first, second = contacts.pair[row]
            axis_a = self.table.swept[first].axis @ placements[first, :3]
            axis_b = self.table.swept[second].axis @ placements[second, :3]
            normal = np.cross(axis_a, axis_b)
            if np.linalg.norm(normal) < 1e-9:
                along = axis_a if axis_a.any() else axis_b if axis_b.any() else np.array([1.0, 0.0, 0.0])
                normal = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
            normal /= np.linalg.norm(normal)
            center = 0.5 * (contacts.point_a[row] + contacts.point_b[row])
            depth = -0.5 * contacts.distance[row] * normal
            contacts.normal[row], contacts.point_a[row], contacts.point_b[row] = normal, center + depth, center - depth


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.geometry import proximity_kernel

    placement, one, none = np.zeros((1, 4, 3)), np.zeros(1), np.zeros(0)
    index, pairs = np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp)
    proximity_kernel.look(
        placement, placement.copy(), pairs, one, np.zeros((1, 3)), one.copy(), none, np.zeros((1, 3)), 0.0, none, index,
        index, 0, index,
    )  # fmt: skip
    proximity_kernel.gather(
        np.zeros((0, RESULT_DOUBLES)), index, pairs, none, one, none, 0.0, 0.0, none, none, np.zeros((3, 0, 3)), index,
        pairs,
    )  # fmt: skip
    return proximity_kernel
