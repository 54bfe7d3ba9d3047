"""The pairs that moved against each other, from one posture to the next, by more than their distance."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import with_loops
from wholebody.base.errors import InputError
from wholebody.geometry.proximity import Contacts, PairTable


class QueryResult(NamedTuple):
    """The near pairs at a posture and the query distance, for tests of motions."""

    contacts: Contacts
    within: float

    @property
    def placements(self) -> Array:
        """(n, 4, 3) placements of the pieces."""
        return self.contacts.placements


def far_moved(table: PairTable, before: QueryResult, after: QueryResult) -> Indices:
    """Pairs that moved against each other by more than their distance; an InputError for placements of other pieces."""
    count = len(table.joint)
    if len(before.placements) != count or len(after.placements) != count:
        raise InputError(
            f"placements of {len(before.placements)} and {len(after.placements)} pieces; give {count} each"
        )
    one, other = before.contacts, after.contacts
    near = one.number, one.distance, float(before.within), other.number, other.distance, float(after.within)
    found: Indices = compiled_kernel().far_moved(
        before.placements, after.placements, (table.pairs, table.widths, table.reach), table.blocks, near
    )
    return found


@with_loops("wholebody.geometry.continuous.moved_pairs_kernel")
def compiled_kernel(moved_pairs_kernel: Any) -> None:
    """The module of compiled loops, compiled or loaded from the cache, before a solve."""
    none, places, pairs = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp)
    placements, near = np.zeros((0, 4, 3)), (places, none, 0.0, places, none, 0.0)
    moved_pairs_kernel.far_moved(placements, placements, (pairs, none, none), (places,) * 5, near)


def distances(placed: QueryResult, count: int) -> Array:
    """Signed distance (pairs,) of every pair; the query distance for pairs that are not near."""
    distance = np.full(count, placed.within)
    distance[placed.contacts.number] = placed.contacts.distance
    return distance
