"""Which pairs moved against each other, from one posture to the next, by more than lay between them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from wholebody.errors import InputError
from wholebody.geometry.proximity import Array, Contacts, Indices, PairTable

ARC = 1.1  # length of an arc over its chord, at the most, for the turns that one step makes
ENDLESS = 1e9  # m: what counts for the reach of a half-space


class Placed(NamedTuple):
    """Which pairs are near at a posture, nearer than what: what a passage is judged by."""

    contacts: Contacts
    within: float

    @property
    def placements(self) -> Array:
        """(n, 4, 3) where the pieces are."""
        return self.contacts.placements


def far_moved(table: PairTable, before: Placed, after: Placed) -> Indices:
    """Pairs that moved against each other by more than lay between them.

    Raises:
        InputError: the placements are of other pieces.
    """
    count = len(table.joint)
    if len(before.placements) != count or len(after.placements) != count:
        raise InputError(
            f"placements of {len(before.placements)} and {len(after.placements)} pieces; give {count} each"
        )
    found: Indices = compiled_kernel().far_moved(
        before.placements, after.placements, table.pairs, table.widths, table.reach,
        before.contacts.number, np.ascontiguousarray(before.contacts.distance), float(before.within),
        after.contacts.number, np.ascontiguousarray(after.contacts.distance), float(after.within), ARC, ENDLESS,
    )  # fmt: skip
    return found


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.geometry import moved_pairs_kernel

    none, places, pairs = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp)
    placements = np.zeros((0, 4, 3))
    moved_pairs_kernel.far_moved(
        placements, placements, pairs, none, none, places, none, 0.0, places, none, 0.0, ARC, ENDLESS
    )
    return moved_pairs_kernel


def distances(placed: Placed, count: int) -> Array:
    """Signed distance (pairs,) of every pair: measured where it is near, else what it was looked for within."""
    distance = np.full(count, placed.within)
    distance[placed.contacts.number] = placed.contacts.distance
    return distance
