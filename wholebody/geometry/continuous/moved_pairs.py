"""The pairs that moved against each other, from one posture to the next, by more than their distance."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.errors import InputError
from wholebody.geometry.proximity import ENDLESS, PairTable
from wholebody.geometry.records import QueryResult, no_contacts

ARC = 1.1  # largest ratio of an arc to its chord, for the rotations of one step


def far_moved(table: PairTable, before: QueryResult, after: QueryResult) -> Indices:
    """Pairs that moved against each other by more than their distance.

    Raises:
        InputError: the placements are of other pieces.
    """
    count = len(table.joint)
    if len(before.placements) != count or len(after.placements) != count:
        raise InputError(
            f"placements of {len(before.placements)} and {len(after.placements)} pieces; give {count} each"
        )
    found: Indices = compiled_kernel().far_moved(table.arrays, before, after, ARC, ENDLESS)
    return found


def separated(table: PairTable, before: QueryResult, after: QueryResult, pairs: Indices, overlap: float) -> Mask:
    """Which pairs (k,) the plane between their pieces before a motion, fixed to either, still separates after it.

    The heights of the arcs that points describe are allowed for; a pair that was not near before is not separated.

    Args:
        table: the pieces and pairs.
        before: near pairs before the motion.
        after: near pairs after it.
        pairs: (k,) places among the collision pairs.
        overlap: metres by which a piece may be beyond the plane.
    """
    found: Mask = compiled_kernel().separated(pairs, table.arrays, before.contacts, after.placements, overlap)
    return found


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or loaded from the cache, before a solve."""
    from wholebody.geometry.continuous import moved_pairs_kernel

    table = PairTable(pin.Model(), pin.GeometryModel())
    placed = QueryResult(no_contacts(np.zeros((0, 4, 3))), 0.0)
    moved_pairs_kernel.far_moved(table.arrays, placed, placed, ARC, ENDLESS)
    none = np.zeros(0, dtype=np.intp)
    moved_pairs_kernel.separated(none, table.arrays, placed.contacts, placed.placements, 0.0)
    return moved_pairs_kernel


def distances(placed: QueryResult, count: int) -> Array:
    """Signed distance (pairs,) of every pair; the query distance for pairs that are not near."""
    distance = np.full(count, placed.within)
    distance[placed.contacts.number] = placed.contacts.distance
    return distance
