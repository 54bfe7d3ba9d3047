"""Rows that keep pairs apart: the gap between two pieces and its rate, at every place where they can touch next.

With n the unit normal from the first piece to the second and x a point of the contact, the gap changes by

    [n, x cross n] . (V_second - V_first)                                                        (one wrench a row)

where V are spatial velocities at the world's origin. At the witness point this is the exact derivative of the signed
distance, on both sides of zero. It is not enough between flat faces: the witness point jumps from corner to corner as
the bodies turn, every linear row is satisfied and the bodies rock into each other. So a pair also gets a row at the
ends of the patch in which its two faces look at each other: core points of one piece near the separating plane, drawn
back towards the witness point until they are over the other piece. Points that hang over an edge make no row, which
would forbid turning about that edge.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.errors import InputError
from wholebody.geometry.proximity import Contacts, PairTable

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

BAND = 0.02  # m: core points this much farther than the witness point still make a row; wider = more rows
LEVER_DISTANCE = 0.025  # m: pairs that are this much farther apart than they must be get their witness row only
INSET = 5e-4  # m: how far below the plane a point must find the other piece; larger = larger patches on round pieces
SAME_NORMAL = 1.0 - 5e-5  # cosine of 0.01 rad: nearer to a face's normal than this, coal's may be meant to be it
COAL_ACCURACY = 2e-6  # m: of coal's distances, with some room
MOST_ENDS = 8  # rows of one contact beside the witness row: a round face has dozens of corners; fewer rows rock more
SHORTEST_LEVER = 8e-3  # m: rows nearer to the witness point than this say what the witness row says


class ContactRows(NamedTuple):
    """Rows ``gap + jacobian @ dq >= clearance``: one for each of the k contacts, then more, sorted by contact.

    Attributes:
        gap: (m,) metres.
        wrench: (m, 6) [n, x cross n] in the world.
        contact: (m,) which contact a row belongs to.
        first: (m,) joint of the first piece.
        second: (m,) joint of the second piece; the row is for its motion relative to the first.
    """

    gap: Array
    wrench: Array
    contact: Indices
    first: Indices
    second: Indices


class ContactRowBuilder:
    """Builds contact rows for all near pairs at once. It remembers no posture, so any number of runs may share one."""

    def __init__(self, table: PairTable) -> None:
        """Lay the core points and faces of all pieces in flat tables."""
        self.table = table
        cores = table.cores
        self._points = np.vstack([core.points for core in cores] or [np.zeros((0, 3))])
        self._point_count = np.array([len(core.points) for core in cores], dtype=np.intp)
        self._point_start = np.concatenate([[0], np.cumsum(self._point_count)])[:-1].astype(np.intp)
        self._faces = np.vstack([core.faces for core in cores] or [np.zeros((0, 4))])
        self._face_count = np.array([len(core.faces) for core in cores], dtype=np.intp)
        self._face_start = np.concatenate([[0], np.cumsum(self._face_count)])[:-1].astype(np.intp)
        self._radius = np.array([core.radius for core in cores])
        self._axis = np.array([core.axis for core in cores]).reshape(-1, 3)
        self._is_capsule: NDArray[np.bool_] = np.asarray(self._axis.any(axis=1))
        flat = (self._point_count >= 2) | np.isinf(table.reach)
        self._extended = flat[table.pairs].all(axis=1)
        self._kernel = compiled_kernel()

    def rows(self, contacts: Contacts, clearance: Array | float = 0.0) -> ContactRows:
        """Rows of all contacts, at the placements they were found at.

        Args:
            contacts: the near pairs of the same pieces.
            clearance: distance asked of each contact, (k,) or one for all, metres.

        Raises:
            InputError: contacts of other pieces.
        """
        k = len(contacts.distance)
        joint = self.table.joint
        if len(contacts.placements) != len(joint):
            raise InputError(
                f"contacts among {len(contacts.placements)} pieces are not among these {len(joint)}; ask the scene "
                "that they come from"
            )
        wide = np.flatnonzero(self._extended[contacts.number] & (contacts.distance < clearance + LEVER_DISTANCE))
        if len(wide):
            self._snap(contacts, wide)
        wrench = _wrenches(contacts.normal, contacts.point_a)
        first, second = joint[contacts.pair[:, 0]], joint[contacts.pair[:, 1]]
        index = np.arange(k)
        if not len(wide):
            return ContactRows(contacts.distance, wrench, index, first, second)
        contact, point, gap = self._patch_ends(contacts, wide)
        return ContactRows(
            np.concatenate([contacts.distance, gap]),
            np.vstack([wrench, _wrenches(contacts.normal[contact], point)]),
            np.concatenate([index, contact]),
            np.concatenate([first, first[contact]]),
            np.concatenate([second, second[contact]]),
        )

    def _snap(self, contacts: Contacts, wide: Indices) -> None:
        """Put the exact normal of a face where coal's is that normal but for rounding.

        coal stops within 1e-6 m of the distance, which at a few centimetres leaves its normal up to 6e-3 rad off: half
        a millimetre at the end of a forearm that lies along a table. The face's own normal is right if it parts the
        pieces by as much.
        """
        self._kernel.snap_normals(
            wide, contacts.pair, contacts.distance, contacts.normal, contacts.placements, self._points,
            self._point_start, self._point_count, self._faces, self._face_start, self._face_count, self._radius,
            SAME_NORMAL, COAL_ACCURACY,
        )  # fmt: skip

    def _patch_ends(self, contacts: Contacts, wide: Indices) -> tuple[Indices, Array, Array]:
        """Ends of the contact patches: contact, point (m, 3) and gap of each."""
        contact, point, gap = self._kernel.patch_ends(
            wide, contacts.pair, contacts.distance, contacts.normal, contacts.point_a, contacts.point_b,
            contacts.placements, self._points, self._point_start, self._point_count, self._faces,
            self._face_start, self._face_count, self._radius, self._axis, self._is_capsule, BAND, INSET, SHORTEST_LEVER,
            MOST_ENDS,
        )  # fmt: skip
        return contact, point, gap


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.geometry import patch_kernel

    none, points, table = np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros((2, 10))
    pair, faces, placement = np.zeros((2, 2), dtype=np.intp), np.zeros((0, 4)), np.zeros((2, 4, 3))
    patch_kernel.snap_normals(
        none, pair, table[:, 0], table[:, 1:4], placement, points, none, none, faces, none, none, np.zeros(0),
        SAME_NORMAL, COAL_ACCURACY,
    )  # fmt: skip
    patch_kernel.patch_ends(
        none, pair, table[:, 0], table[:, 1:4], table[:, 4:7], table[:, 7:10], placement, points, none, none, faces,
        none, none, np.zeros(0), points, np.zeros(0, dtype=bool), BAND, INSET, SHORTEST_LEVER,
        MOST_ENDS,
    )  # fmt: skip
    return patch_kernel


def _cross(a: Array, b: Array) -> Array:
    """Row-wise cross product, written out (np.cross takes 15 us more)."""
    out = np.empty_like(a)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def _wrenches(normal: Array, point: Array) -> Array:
    """Rows [n, x cross n] of shape (m, 6)."""
    return np.hstack([normal, _cross(point, normal)])
