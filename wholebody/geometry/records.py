"""Records of arrays that distances, contact rows, sweeps and their compiled loops share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import number


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


class QueryResult(NamedTuple):
    """The near pairs at a posture and the query distance, for tests of motions."""

    contacts: Contacts
    within: float

    @property
    def placements(self) -> Array:
        """(n, 4, 3) placements of the pieces."""
        return self.contacts.placements


def no_contacts(placements: Array) -> Contacts:
    """No contacts at these placements."""
    lines, index = np.zeros((0, 3)), np.zeros(0, dtype=np.intp)
    return Contacts(np.zeros((0, 2), dtype=np.intp), np.zeros(0), lines, lines, lines, index, placements)


class PieceArrays(NamedTuple):
    """The n pieces and p pairs of a geometry model, as compiled loops take them.

    Attributes:
        pairs: (p, 2) indices of the two pieces of every collision pair.
        widths: (p,) width of both pieces together, metres.
        points_meet: (p,) distance at and below which coal's normal means nothing, metres; -inf for most pairs.
        joint: (n,) joint that carries each piece; 0 is the world.
        reach: (n,) radius of each piece about its origin, metres; infinite for a half-space.
        half: (n, 3) half the size of a box about each piece's origin, along its own axes, metres.
        radius: (n,) of the spheres around the swept points, metres.
        radii: (n, 3) of ellipsoids, metres; 0 for other pieces.
        axis: (n, 3) directions of capsules; 0 for other pieces.
        points: (m, 3) swept points of all pieces, one piece after the other, each in its piece's frame.
        first_point: (n + 1,) where those of each piece begin.
        faces: (f, 4) outward planes of all pieces, in the same order; see `SweptPoints`.
        first_face: (n + 1,) where those of each piece begin.
    """

    pairs: Indices
    widths: Array
    points_meet: Array
    joint: Indices
    reach: Array
    half: Array
    radius: Array
    radii: Array
    axis: Array
    points: Array
    first_point: Indices
    faces: Array
    first_face: Indices


class Memory(NamedTuple):
    """What `Proximity` remembers from query to query, and room for its answers.

    Attributes:
        last: (n, 4, 3) placements of the pieces at the last query.
        travelled: (n,) how far a point of each piece has moved since the beginning, at most, metres.
        bound: (p,) lower bound of the distance when a pair was last looked at, plus what both had travelled then.
        extent: (n, 3) half the sizes of boxes about the pieces, along the world's axes.
        index: (p,) the pairs that are asked.
        marked: (p,) the pairs that Pinocchio was told to ask.
        changed: (p,) those that it is to be told of.
    """

    last: Array
    travelled: Array
    bound: Array
    extent: Array
    index: Indices
    marked: Indices
    changed: Indices


class ContactRoom(NamedTuple):
    """Room for contacts: distances (k,), normals and points (3, k, 3), numbers (k,), pairs (k, 2)."""

    distance: Array
    vectors: Array
    number: Indices
    pair: Indices


class Parts(NamedTuple):
    """Pairs, each during a part of a motion; all parts have one length.

    Attributes:
        number: (k,) places among the collision pairs.
        first: (k,) number of the time at which a part begins.
        last: (k,) number of the time at which it ends.
        rows0: (k, 4) distance and normal, from the first piece to the second, at the beginning.
        rows1: (k, 4) the same at the end.
        speed: (k,) by how much a pair can come nearer during the whole motion, metres.
        wanted: (k,) a lower bound of the distance that is sufficient, metres.
    """

    number: Indices
    first: Indices
    last: Indices
    rows0: Array
    rows1: Array
    speed: Array
    wanted: Array


class RowSettings(NamedTuple):
    """What decides which rows a contact has; the constants of `contact_rows`, which have their meaning and trade."""

    lever_distance: float
    band: float
    inset: float
    shortest_lever: float
    same_normal: float
    normal_room: float
    setback: float
    most_ends: int


class RowRoom(NamedTuple):
    """Room for contact rows: wrenches (m, 6), gaps (m,), contacts (m,), and joints (m, 2) of both pieces."""

    wrench: Array
    gap: Array
    contact: Indices
    joints: Indices

    @classmethod
    def of(cls, rows: int) -> RowRoom:
        """Room for so many rows."""
        return cls(np.empty((rows, 6)), np.empty(rows), np.empty(rows, dtype=np.intp), np.empty((rows, 2), np.intp))
