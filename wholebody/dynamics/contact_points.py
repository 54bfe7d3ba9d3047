"""The points at which bodies touch or may touch during the next step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.dynamics import motion_kernel
from wholebody.dynamics.pieces import Pieces, PlacedPieces, PlacedProximity
from wholebody.geometry.contact_rows import ContactRowBuilder
from wholebody.geometry.proximity import Contacts

POINTS = 6  # of one contact beside its witness points: a box on a box has four, two crossed planks have six
SAME_NORMAL = 0.995  # cosine of 0.1 rad: where pieces are 50 um apart, coal's normal is off by some 0.02 rad


class ContactPoints(NamedTuple):
    """Points of contacts, one row each.

    Attributes:
        pair: (m,) place of the pair among the pairs of pieces.
        bodies: (m, 2) A and B.
        normal: (m, 3) unit normal from A to B.
        point: (m, 3) in the world, between the two surfaces.
        gap: (m,) metres.
    """

    pair: Indices
    bodies: Indices
    normal: Array
    point: Array
    gap: Array


class ContactFinder:
    """Finds near pairs and their contact points for one run of the engine."""

    def __init__(self, pieces: Pieces) -> None:
        """Build the tables of the pieces."""
        self.pieces = pieces
        self._proximity = PlacedProximity(pieces.table)
        self._rows = ContactRowBuilder(pieces.table, POINTS, SAME_NORMAL)
        self._bodies = pieces.body[pieces.table.pairs]

    @property
    def asked(self) -> int:
        """How many distances coal was asked for."""
        return self._proximity.asked

    def near(self, position: Array, rotation: Array, margin: Array, active: Mask) -> Contacts:
        """Pairs that are nearer than the margins (n,) of both bodies together, metres, and have an active body.

        Args:
            position: (n, 3) centres of mass.
            rotation: (n, 3, 3).
            margin: (n,) of each body.
            active: (n,) whether a body can make contact: it moves.
        """
        pieces = self.pieces
        placement = np.empty((len(pieces.body), 4, 3))
        motion_kernel.place_pieces(position, rotation, pieces.centre, pieces.body, pieces.local, placement)
        first, second = self._bodies[:, 0], self._bodies[:, 1]
        most = np.where(active[first] | active[second], margin[first] + margin[second], -np.inf)
        within = float(2.0 * margin.max(initial=0.0))
        return self._proximity.query(PlacedPieces(placement), within, most)

    def points(self, contacts: Contacts) -> ContactPoints:
        """Contact points of near pairs; the normals in `contacts` become those of faces where they are meant."""
        rows = self._rows.rows(contacts)
        owner = rows.contact
        normal = rows.wrench[:, :3].copy()
        middle = 0.5 * (contacts.point_a + contacts.point_b)
        height = (normal * middle[owner]).sum(axis=1)
        point = np.cross(normal, rows.wrench[:, 3:]) + height[:, None] * normal
        bodies: Indices = self.pieces.body[contacts.pair[owner]]
        return ContactPoints(contacts.number[owner], bodies, normal, point, rows.gap)
