"""Array code for which pairs moved by more than lay between them: what `far_moved` of the package must find."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.geometry.continuous.moved_pairs import QueryResult, distances
from wholebody.geometry.continuous.moved_pairs_kernel import ARC
from wholebody.geometry.pieces import ENDLESS
from wholebody.geometry.proximity import PairTable


def far_moved(table: PairTable, before: QueryResult, after: QueryResult) -> Indices:
    """Return what `far_moved` returns."""
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


def _apart(placed: QueryResult, count: int) -> Array:
    """Signed distance (pairs,) of every pair, not less than zero; those that were not measured at their least."""
    apart: Array = np.maximum(distances(placed, count), 0.0)
    return apart


def _spheres_apart(table: PairTable, placed: QueryResult, pairs: Indices) -> Array:
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
