"""Pairs among many pieces that stand anywhere: boxes along the world's axes first, coal for those that overlap."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.geometry.pair_distances import SinglePairs
from wholebody.geometry.proximity import Contacts, PairTable

AT_ONCE = 1_000_000  # pairs of boxes that are compared in one go; more = more memory, 50 bytes each


def box_pairs(low: Array, high: Array) -> Indices:
    """Pairs (k, 2), the lesser index first, of boxes that overlap or touch, with corners `low` and `high` (n, 3)."""
    if len(low) < 2:
        return np.zeros((0, 2), dtype=np.intp)
    axis = int(np.argmax(np.ptp(low + high, axis=0)))
    order = np.argsort(low[:, axis], kind="stable")
    low, high = low[order], high[order]
    begins = np.arange(1, len(low) + 1)
    counts = np.maximum(np.searchsorted(low[:, axis], high[:, axis], side="right") - begins, 0)
    ends, found, done = np.cumsum(counts), [np.zeros((0, 2), dtype=np.intp)], 0
    while done < len(counts):
        before = int(ends[done - 1]) if done else 0
        upto = max(int(np.searchsorted(ends, before + AT_ONCE, side="right")), done + 1)
        some = counts[done:upto]
        first = np.repeat(np.arange(done, upto), some)
        second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(some) - some, some)
        both = ((low[first] <= high[second]) & (low[second] <= high[first])).all(axis=1)
        found.append(np.sort(order[np.column_stack([first[both], second[both]])], axis=1))
        done = upto
    return np.concatenate(found)


def near_among(
    table: PairTable,
    placements: Array,
    pieces: Indices,
    group: Indices,
    within: float,
    left_out: Collection[tuple[int, int]] = (),
) -> Contacts:
    """Pairs of the pieces (m,) nearer than `within` metres, the nearest first, whatever pairs the table has.

    Half-spaces make no pair with each other. `placements` (n, 4, 3) as in `Contacts`; pieces of one `group` (m,), or of
    two groups that are `left_out` (lesser first), make no pair. `number` is -1 for all.
    """
    centre = placements[pieces, 3]
    half = np.einsum("kji,kj->ki", np.abs(placements[pieces, :3]), table.half[pieces]) + 0.5 * within
    pairs = box_pairs(centre - half, centre + half)
    groups = np.sort(group[pairs], axis=1)
    kept = groups[:, 0] != groups[:, 1]
    for one, other in left_out:
        kept &= (groups[:, 0] != one) | (groups[:, 1] != other)
    chosen = pieces[pairs[kept]]
    chosen = chosen[_beyond_no_face(table, placements, chosen, within)]
    found = SinglePairs(table.geometry).measured(placements, chosen)
    # coal has no normal where two centres meet: any parts them as well
    found[~(np.linalg.norm(found[:, 1:4], axis=1) > 0.5), 1:4] = (0.0, 0.0, 1.0)
    near = np.flatnonzero(found[:, 0] < within)
    found, chosen = found[near], chosen[near]
    number = np.full(len(near), -1, dtype=np.intp)
    distance, normal, point_a, point_b = (np.ascontiguousarray(part) for part in np.split(found, (1, 4, 7), axis=1))
    return Contacts(chosen, distance[:, 0], normal, point_a, point_b, number, placements).nearest_first()


def _beyond_no_face(table: PairTable, placements: Array, pairs: Indices, within: float) -> Mask:
    """Whether no box of pairs (k, 2) is farther than `within` from a half-space; False for two half-spaces.

    Half-spaces are beside everything in boxes along the axes of the world: each would be measured with all pieces.
    """
    endless = np.isinf(table.reach[pairs])
    kept: Mask = np.asarray(~endless.all(axis=1))
    for plane in np.unique(pairs[endless]).tolist():
        rows = np.flatnonzero((pairs == plane).any(axis=1) & kept)
        other = pairs[rows].sum(axis=1) - plane
        normal = table.swept[plane].faces[0, :3] @ placements[plane, :3]
        height = (placements[other, 3] - placements[plane, 3]) @ normal - table.swept[plane].faces[0, 3]
        kept[rows] = height - (np.abs(placements[other, :3] @ normal) * table.half[other]).sum(axis=1) < within
    return np.asarray(kept)
