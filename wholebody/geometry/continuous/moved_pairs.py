"""Which pairs moved against each other, from one posture to the next, by more than lay between them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from wholebody.compiled import compiled_module
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
    kernel = compiled_kernel()
    if kernel is None:
        return far_moved_in_arrays(table, before, after)
    found: Indices = kernel.far_moved(
        before.placements, after.placements, table.pairs, table.widths, table.reach,
        before.contacts.number, np.ascontiguousarray(before.contacts.distance), float(before.within),
        after.contacts.number, np.ascontiguousarray(after.contacts.distance), float(after.within), ARC, ENDLESS,
    )  # fmt: skip
    return found


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops where numba is installed (the extra "fast"), else None."""
    moved_pairs_kernel = compiled_module("wholebody.geometry.continuous.moved_pairs_kernel")
    if moved_pairs_kernel is None:
        return None
    none, places, pairs = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp)
    placements = np.zeros((0, 4, 3))
    # compiled, or read back: here, and not in the middle of a solve
    moved_pairs_kernel.far_moved(
        placements, placements, pairs, none, none, places, none, 0.0, places, none, 0.0, ARC, ENDLESS
    )
    return moved_pairs_kernel


def far_moved_in_arrays(table: PairTable, before: Placed, after: Placed) -> Indices:
    """`far_moved` in array code, which takes ten times as long: for machines without numba."""
    motion = _motion(table, before.placements, after.placements)
    pairs = table.pairs
    way = motion[pairs[:, 0]] + motion[pairs[:, 1]]
    room = table.widths + _apart(before, len(pairs)) + _apart(after, len(pairs))
    doubtful = np.flatnonzero(way > room)
    if not len(doubtful):
        return doubtful
    # pairs that were not measured are at least as far apart as their bounding spheres
    spheres = _spheres_apart(table, before, doubtful) + _spheres_apart(table, after, doubtful)
    beyond = way[doubtful] > table.widths[doubtful] + spheres
    doubtful, spheres = doubtful[beyond], spheres[beyond]
    # neighbouring segments move far together: what counts is the way of one seen from the other
    seen = np.minimum(
        _relative_motion(table, before.placements, after.placements, pairs[doubtful, 0], pairs[doubtful, 1]),
        _relative_motion(table, before.placements, after.placements, pairs[doubtful, 1], pairs[doubtful, 0]),
    )
    moved: Indices = doubtful[seen > table.widths[doubtful] + spheres]
    return moved


def distances(placed: Placed, count: int) -> Array:
    """Signed distance (pairs,) of every pair: measured where it is near, else what it was looked for within."""
    distance = np.full(count, placed.within)
    distance[placed.contacts.number] = placed.contacts.distance
    return distance


def _apart(placed: Placed, count: int) -> Array:
    """The same, not less than zero."""
    apart: Array = np.maximum(distances(placed, count), 0.0)
    return apart


def _spheres_apart(table: PairTable, placed: Placed, pairs: Indices) -> Array:
    """Distance of the bounding spheres of these pairs, or the distance above where it is larger."""
    first, second = table.pairs[pairs, 0], table.pairs[pairs, 1]
    between = placed.placements[first, 3] - placed.placements[second, 3]
    gap = np.sqrt(np.einsum("ij,ij->i", between, between)) - table.reach[first] - table.reach[second]
    apart: Array = np.maximum(gap, _apart(placed, len(table.pairs))[pairs])
    return apart


def _relative_motion(table: PairTable, before: Array, after: Array, carrier: Indices, other: Indices) -> Array:
    """Longest way (k,) that any point of the other pieces made in the axes of their carriers, metres."""
    shift, turn = np.zeros((len(other), 3)), np.zeros((len(other), 3, 3))
    for sign, placements in ((1.0, after), (-1.0, before)):
        axes = placements[carrier, :3].transpose(0, 2, 1)
        shift += sign * np.einsum("ij,ijk->ik", placements[other, 3] - placements[carrier, 3], axes)
        turn += sign * (placements[other, :3] @ axes)
    angle = np.sqrt(0.5 * np.einsum("ijk,ijk->i", turn, turn))
    reach = table.reach[other]
    motion: Array = ARC * (
        np.sqrt(np.einsum("ij,ij->i", shift, shift))
        + np.where(angle > 1e-12, angle, 0.0) * np.where(np.isfinite(reach), reach, ENDLESS)
    )
    return motion


def _motion(table: PairTable, before: Array, after: Array) -> Array:
    """Longest way that any point of each piece made, metres."""
    shift = after - before
    center = np.sqrt(np.einsum("ij,ij->i", shift[:, 3], shift[:, 3]))
    # |R1 - R0| in the Frobenius norm is 2 sqrt(2) sin(angle / 2): no point moves more than 1/sqrt(2) of it times reach
    turn = np.sqrt(0.5 * np.einsum("ijk,ijk->i", shift[:, :3], shift[:, :3]))
    reach = np.where(np.isfinite(table.reach), table.reach, 0.0)
    motion: Array = ARC * (center + turn * reach)
    return motion
