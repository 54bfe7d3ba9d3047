"""Signed distances between all pairs of a geometry model: coal for those that can be near.

A pair cannot be near where it was farther away than both pieces have moved since, or where spheres or boxes around its
pieces are apart. Telling this takes some 5 us for 1,000 pairs.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, brief
from wholebody.base.checks import number
from wholebody.base.compiled import with_loops
from wholebody.geometry.flesh import beside_limbs
from wholebody.geometry.large_models import pairs_of
from wholebody.geometry.memory_views import RESULT_DOUBLES, fields
from wholebody.geometry.pair_distances import PairDistances
from wholebody.geometry.pieces import COAL_ACCURACY, ENDLESS, SweptPoints, normal_across, swept_points_of

PENETRATION = 1e-5  # m: deeper than this a pair is called inside of each other; what touches is solved to it

SINGLY = 3000
"""Pairs of a scene from which on those that survive are asked one by one: to go through all that are not asked takes
Pinocchio 1 ns for each of them, to be called 200 ns for each that is."""


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

    def __repr__(self) -> str:
        return brief(self)

    def nearest_first(self) -> Contacts:
        """The same in the order of their distances."""
        return self._rows(np.argsort(self.distance, kind="stable"))

    def nearer(self, distance: float) -> Contacts:
        """Those that are nearer than a distance, metres."""
        distance = number(distance, "nearer: distance", -np.inf, np.inf, "m")
        return self._rows(np.flatnonzero(self.distance < distance))

    def joined(self, others: Contacts) -> Contacts:
        """These and others at the same placements."""
        joined: Any = [*map(np.concatenate, zip(self[:6], others[:6], strict=True)), self.placements]
        return Contacts(*joined)

    def _rows(self, rows: Indices) -> Contacts:
        chosen: Any = [*(part[rows] for part in self[:6]), self.placements]
        return Contacts(*chosen)


class ContactBuffer:
    """Room for so many contacts: distances; normals, points on the first and on the second piece; numbers; pairs."""

    def __init__(self, size: int) -> None:
        number, pair = np.empty(size, dtype=np.intp), np.empty((size, 2), dtype=np.intp)
        self.size, self.arrays = size, (np.empty(size), np.empty((3, size, 3)), number, pair)
        self._front: dict[int, Contacts] = {}

    def contacts(self, count: int, placements: Array) -> Contacts:
        """The first `count` of the contacts; the same object where both arguments are the same."""
        known = self._front.get(count)
        if known is None or known.placements is not placements:
            distance, vectors, number, pair = self.arrays
            normal, point_a, point_b = vectors[:, :count]
            known = self._front[count] = Contacts(
                pair[:count], distance[:count], normal, point_a, point_b, number[:count], placements
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
        reach: (n,) radius of each piece about its origin, metres; infinite for a half-space. That of flesh is larger by
            what it moves a radian beside its limb, so that bounds of motions hold for it.
        half: (n, 3) half the size of a box about each piece's origin, along its own axes, metres.
        widths: (pairs,) width of both pieces together, metres.
        points: (m, 3) swept points of all pieces, one piece after the other, each in its piece's frame.
        first_point: (n + 1,) where those of each piece begin.
        radius: (n,) around them, metres.
        axis: (n, 3) unit direction of a capsule in its own frame; zero for everything else.
        faces: (f, 4) outward planes of all pieces, see `SweptPoints.faces`.
        first_face: (n + 1,) where those of each piece begin.
        points_meet: (pairs,) distance at and below which coal's normal means nothing, metres; -inf for most pairs.
        blocks: pairs in a row of one second piece with first pieces of one body; see `pair_blocks`.
    """

    def __init__(
        self,
        model: pin.Model,
        geometry: pin.GeometryModel,
        pairs: Indices | None = None,
        swept: Sequence[SweptPoints] | None = None,
    ) -> None:
        """Read the pieces, and the pairs and swept points that are not given; an InputError for no convex piece."""
        self.model, self.geometry = model, geometry
        pieces = list(geometry.geometryObjects)
        self.swept = swept_points_of([piece.geometry for piece in pieces]) if swept is None else swept
        self.pairs: Indices = pairs_of(geometry) if pairs is None else pairs
        self.joint: Indices = np.array([piece.parentJoint for piece in pieces], dtype=np.intp)
        reach = np.array([swept.reach for swept in self.swept]).reshape(-1)
        self.reach: Array = reach + beside_limbs(pieces, reach)
        self.half = np.minimum(np.array([swept.half for swept in self.swept]).reshape(-1, 3), ENDLESS)
        width = np.array([swept.width for swept in self.swept]).reshape(-1)
        first, second = self.pairs.T
        self.widths: Array = width[first] + width[second]
        radius = self.radius = np.array([swept.radius for swept in self.swept]).reshape(-1)
        self.axis: Array = np.array([swept.axis for swept in self.swept]).reshape(-1, 3)
        self.points, self.first_point = _joined([np.zeros((0, 3)), *(swept.points for swept in self.swept)])
        self.faces, self.first_face = _joined([np.zeros((0, 4)), *(swept.faces for swept in self.swept)])
        # where round pieces' swept points meet, coal's normal is zero or noise along an axis
        one, other = radius[first], radius[second]
        self.points_meet = np.where((one > 0.0) & (other > 0.0), COAL_ACCURACY - (one + other), -np.inf)
        self.blocks = pair_blocks(model, self.joint, self.pairs)


def pair_blocks(model: pin.Model, joint: Indices, pairs: Indices) -> tuple[Indices, Indices, Indices, Indices, Indices]:
    """Blocks of pairs: a body, all pieces that come first and that one joint of the world carries, and one that stands.

    Returns:
        Where the blocks begin, and the last ends (b + 1,); of each the piece that stands (b,), -1 for a block of pairs
        of which none does, and its body (b,); where the pieces of the bodies begin (c + 1,), and these (m,). They are
        none where blocks would have few pairs each.
    """
    root = np.array([supports[1] if len(supports) > 1 else 0 for supports in model.supports], dtype=np.intp)
    first, second = pairs.T
    stands = joint[second] == 0
    roots, members = np.unique(root[joint[first[stands]]]), np.unique(first[stands])
    last, body = np.where(stands, second, -1), np.where(stands, np.searchsorted(roots, root[joint[first]]), -1)
    begin = np.flatnonzero(np.concatenate([[True], (np.diff(body) != 0) | (np.diff(last) != 0)])[: len(pairs)])
    if len(pairs) < 3 * len(begin):  # looking at so small blocks takes longer than looking at all pairs
        begin = begin[:0]
    members = members[np.argsort(root[joint[members]], kind="stable")]
    ends = np.append(begin, len(pairs)).astype(np.intp)
    return (
        ends,
        last[begin],
        body[begin],
        np.append(np.searchsorted(root[joint[members]], roots), len(members)),
        members,
    )


def _joined(parts: list[Array]) -> tuple[Array, Indices]:
    """The rows of all parts, the first of which is empty, and where those of each part begin."""
    return np.concatenate(parts), np.cumsum([len(part) for part in parts], dtype=np.intp)


class Proximity:
    """Distances of every collision pair of a geometry model, re-used from posture to posture by one run at a time.

    The pieces stand where the geometry model had them when this was made; see `place_piece`.

    Attributes:
        table: the pieces and pairs.
        geometry: the geometry model with the pieces' own placements.
        seconds: what all questions have taken together.
        asked: how many distances coal was asked for.
        distances: what asks it, and `results`, Pinocchio's data.
        known: pairs, how far each piece can have moved, and bounds of the pairs; see `proximity_kernel.gather`.
    """

    def __init__(self, table: PairTable) -> None:
        self.table = table
        self.geometry = table.geometry.copy()  # shapes are shared
        self.seconds, self.asked = 0.0, 0
        self.distances = PairDistances(self.geometry, table.pairs)
        self.results = self.distances.data
        self._kernel = compiled_kernel()
        count, pairs = self.geometry.ngeoms, len(table.pairs)
        marks, self._count = np.zeros((3, pairs), dtype=np.intp), 0
        self._index, _, self._changed = marks
        self._singly = pairs >= SINGLY
        self._travelled, self._endless = np.zeros(count), np.full(pairs, np.inf)
        self._bound = np.array([self._endless, table.points_meet])
        self._placed, self._buffer = np.zeros((count, 4, 3)), ContactBuffer(64)
        self._none = self._buffer.contacts(0, self._placed)
        self._looked = (
            table.pairs, table.reach, table.half, np.zeros((count, 4, 3)), self._travelled, self._bound,
            np.zeros((count, 3)), marks,
        )  # fmt: skip
        self._blocks = *table.blocks, np.zeros((len(table.blocks[3]), 4))
        self.known = table.pairs, self._travelled, self._bound
        # memory that is never written takes none
        self._read = None if self.distances.kept else np.zeros((pairs, RESULT_DOUBLES))
        self.reset()

    def reset(self) -> None:
        """Forget how near each pair was and where coal ended for it: the same queries give the same answers again."""
        self.distances.reset()
        self._ask_nothing()
        self._travelled[:] = 0.0
        self._bound[0] = -np.inf

    def place_piece(self, index: int, placement: pin.SE3) -> None:
        """Place a piece anew in its joint's frame."""
        self.geometry.geometryObjects[index].placement = placement

    def place(self, data: Any) -> Array:
        """Move the pieces to where the joints are in Pinocchio's `data`; a view of their placements (n, 4, 3)."""
        self.distances.place(self.table.model, data)
        return self.distances.placed

    def placements(self, data: Any) -> Array:
        """Placements (n, 4, 3) of the pieces with the joints as in Pinocchio's `data`; see `Contacts.placements`."""
        return np.array(self.place(data))

    def query(self, data: Any, within: float, most: Array | None = None) -> Contacts:
        """Every pair nearer than `within` metres, or its `most` (pairs,) where less, at Pinocchio's `data`."""
        # Results of culled pairs are never read, because coal leaves old numbers in them.
        index, placed = self.ask(data, within, most)
        return self._gathered(ContactBuffer(len(index)), np.array(placed), index, within, most)

    def query_views(self, data: Any, within: float) -> Contacts:
        """What `query` returns, in arrays that the next call of this overwrites."""
        index, placed = self.ask(data, within)
        self._placed[:] = placed
        if not len(index):
            return self._none
        if len(index) > self._buffer.size:
            self._buffer = ContactBuffer(2 * len(index))
        return self._gathered(self._buffer, self._placed, index, within, None)

    def least(self, data: Any, within: float) -> Array:
        """Distances (pairs,) of pairs that may be nearer than `within` metres, and bounds from below of all others."""
        index, _ = self.ask(data, within, whole=True)
        found = np.empty(len(self.table.pairs))
        self._kernel.bound_from_below(self.results_of(index), index, self.known, found)
        return found

    def ask(self, data: Any, within: float, most: Array | None = None, *, whole: bool = False) -> tuple[Indices, Array]:
        """Have coal compute the pairs of `query`: numbers (k,) and placements, until the next; see `results_of`.

        With `whole` all pairs get bounds, also those that are told to be far by the bodies that they are of.
        """
        began = time.perf_counter()
        distances, results, placed = self.distances, self.results, self.place(data)
        try:
            count, gone, came = self._kernel.look(
                placed, self._looked, self._blocks, within, self._endless if most is None else most, self._count, whole
            )
            self._count = count
            self.asked += count
            numbers = self._index[:count]
            if self._read is not None:
                fields(self._read)[numbers] = distances.measured(numbers)
            elif self._singly:
                for number in numbers.tolist():
                    pin.computeDistance(self.geometry, results, number)
            else:
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
        self.seconds += time.perf_counter() - began
        return numbers, placed

    def distance(self, data: Any, number: int) -> float:
        """The signed distance of one pair at Pinocchio's `data`, metres."""
        self.place(data)
        self.asked += 1
        return self.distances.one(number)

    def results_of(self, index: Indices) -> Array:
        """(pairs, 20) what coal computed last, see `memory_views.fields`; only the rows of `index` (k,) count."""
        results = self.distances.results if self._read is None else self._read
        if results is None:
            results = np.zeros((len(self.table.pairs), RESULT_DOUBLES))
            fields(results)[index] = self.distances.read(index)
        return results

    def _gathered(
        self, room: ContactBuffer, placements: Array, index: Indices, within: float, most: Array | None
    ) -> Contacts:
        most = self._endless if most is None else most
        count, broken = self._kernel.gather(self.results_of(index), index, self.known, within, most, room.arrays)
        contacts = room.contacts(count, placements)
        if broken:
            self.repair_normals(contacts)
        return contacts

    def _ask_nothing(self) -> None:
        self.results.deactivateAllCollisionPairs()
        self._count = 0

    def repair_normals(self, contacts: Contacts) -> None:
        """Give a normal to pairs where coal has none: capsule axes that cross exactly, concentric spheres."""
        placements = contacts.placements
        for row in np.flatnonzero(contacts.distance <= self.table.points_meet[contacts.number]):
            first, second = contacts.pair[row]
            axis_a = self.table.swept[first].axis @ placements[first, :3]
            axis_b = self.table.swept[second].axis @ placements[second, :3]
            normal = normal_across(axis_a, axis_b)
            center = 0.5 * (contacts.point_a[row] + contacts.point_b[row])
            depth = -0.5 * contacts.distance[row] * normal
            contacts.normal[row], contacts.point_a[row], contacts.point_b[row] = normal, center + depth, center - depth


@with_loops("wholebody.geometry.proximity_kernel")
def compiled_kernel(proximity_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    placement, one, none = np.zeros((1, 4, 3)), np.zeros(1), np.zeros(0)
    index, pairs = np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp)
    lines, bound, marks = np.zeros((1, 3)), np.zeros((2, 0)), np.zeros((3, 0), dtype=np.intp)
    known = pairs, one, lines, placement.copy(), one.copy(), bound, lines, marks
    blocks = index, index, index, index, index, np.zeros((0, 4))
    proximity_kernel.look(placement, known, blocks, 0.0, none, 0, False)
    room = none, np.zeros((3, 0, 3)), index, pairs
    results = np.zeros((0, RESULT_DOUBLES))
    proximity_kernel.gather(results, index, (pairs, one, bound), 0.0, none, room)
    proximity_kernel.bound_from_below(results, index, (pairs, one, bound), none)
