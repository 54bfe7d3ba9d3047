"""Rows that keep pairs apart: the gap between two pieces and its rate, at every place where they can touch next.

With n the unit normal from the first piece to the second and x a point of the contact, the gap changes by

    [n, x cross n] . (V_second - V_first)                                                        (one wrench a row)

where V are spatial velocities at the world's origin. At the witness point this is the exact derivative of the signed
distance, on both sides of zero. It is not enough between flat faces: the witness point jumps from corner to corner as
the bodies turn, every linear row is satisfied and the bodies rock into each other. So a pair also gets a row at the
ends of the patch in which its two faces look at each other: swept points of one piece near the separating plane, drawn
back towards the witness point until they are over the other piece. Points that hang over an edge make no row, which
would forbid turning about that edge.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import with_loops
from wholebody.base.errors import InputError
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.geometry.proximity import Contacts, PairTable

BAND = 0.02  # m: swept points this much farther than the witness point still make a row; wider = more rows
LEVER_DISTANCE = 0.025  # m: pairs that are this much farther apart than they must be get their witness row only
INSET = 5e-4  # m: how far below the plane a point must find the other piece; larger = larger patches on round pieces
SAME_NORMAL = 1.0 - 5e-5  # cosine of 0.01 rad: nearer to a face's normal than this, coal's may be meant to be it
NORMAL_ROOM = 2.0 * COAL_ACCURACY  # m: by which a face's normal may part the pieces by less than coal's does
MOST_ENDS = 8  # rows of one contact beside the witness row: a round face has dozens of corners; fewer rows rock more
SETBACK = 1e-3  # m: of too many ends, one this much farther off counts as half as far out; less = more of the near ones
SHORTEST_LEVER = 8e-3  # m: rows nearer to the witness point than this say what the witness row says
LENGTHS = np.array([LEVER_DISTANCE, BAND, INSET, SHORTEST_LEVER, SAME_NORMAL, NORMAL_ROOM, SETBACK, MOST_ENDS])
"""What the compiled loops take of the above."""


class ContactRows(NamedTuple):
    """Rows ``gap + jacobian @ dq >= clearance``: one for each of the k contacts, then more, sorted by contact."""

    gap: Array  # (m,) metres
    wrench: Array  # (m, 6) [n, x cross n] in the world
    contact: Indices  # (m,) which contact a row belongs to
    first: Indices  # (m,) joint of the first piece
    second: Indices  # (m,) joint of the second piece; the row is for its motion relative to the first


class ContactRowBuilder:
    """Builds contact rows for all near pairs at once, for any number of runs; `arrays` are those of the pieces."""

    def __init__(self, table: PairTable, most_ends: int = MOST_ENDS, same_normal: float = SAME_NORMAL) -> None:
        """Take the pieces and pairs; `same_normal`: least cosine between coal's normal and a face's that it means."""
        self.table, self.most_ends = table, most_ends
        lengths = LENGTHS.copy()
        lengths[4], lengths[7] = same_normal, most_ends
        flat = (np.diff(table.first_point) >= 2) | np.isinf(table.reach)
        self.arrays = (
            flat[table.pairs].all(axis=1), table.joint, lengths, table.points, table.first_point, table.faces,
            table.first_face, table.radius, table.axis,
        )  # fmt: skip

    def rows(self, contacts: Contacts, clearance: Array | float = 0.0) -> ContactRows:
        """Rows of all contacts among the same pieces, for `clearance` metres, (k,) or one for all."""
        # coal's normal is up to 6e-3 rad off; a face's own, where it parts the pieces by as much, replaces it
        if len(contacts.placements) != len(self.table.joint):
            raise InputError(
                f"contacts among {len(contacts.placements)} pieces are not among these {len(self.table.joint)}; ask "
                "the scene that they come from"
            )
        most = len(contacts.distance) * (1 + self.most_ends)
        wrench, gap = np.empty((most, 6)), np.empty(most)
        contact, joints = np.empty(most, dtype=np.intp), np.empty((most, 2), dtype=np.intp)
        asked = np.full(contacts.distance.shape, clearance, dtype=float)  # not a view: numba takes it for another type
        count: int = compiled_kernel().contact_rows(contacts[:], asked, self.arrays, (wrench, gap, contact, joints))
        return ContactRows(
            gap[:count].copy(), wrench[:count].copy(), contact[:count].copy(), joints[:count, 0].copy(),
            joints[:count, 1].copy(),
        )  # fmt: skip


@with_loops("wholebody.geometry.patch_kernel")
def compiled_kernel(patch_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    none, points, lengths, yes = np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=bool)
    pair, faces, placement = np.zeros((0, 2), dtype=np.intp), np.zeros((0, 4)), np.zeros((0, 4, 3))
    contacts = pair, lengths, points, points, points, none, placement
    table = yes, none, LENGTHS, points, none, faces, none, lengths, points
    room = np.zeros((0, 6)), lengths, none, pair
    patch_kernel.contact_rows(contacts, lengths, table, room)
