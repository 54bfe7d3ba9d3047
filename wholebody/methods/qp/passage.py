"""Whether a step may have jumped over something: proof for most pairs, a continuous sweep for the others.

Two convex pieces that are d0 apart before a step and d1 after it can only have changed sides if they moved against each
other by d0 + d1 and the widths of both. Where a step is longer (a fast hand, a thin plate), the plane that parts them
before the step, carried along by one piece, may still part them after it, up to the height of the arcs that points
describe. What is left is swept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.geometry.proximity import Contacts, Indices, Proximity
from wholebody.methods.qp.quadratic_program import Array

DIP = 5e-4  # m: between two postures a piece may dip in by this much; half of the thinnest plate that counts
ARC = 1.1  # length of an arc over its chord, at the most, for the turns that one step makes


class Placed(NamedTuple):
    """Where the pieces are at a posture, and which pairs are near: what a passage is judged by."""

    placements: Array
    contacts: Contacts
    within: float


def snapshot(proximity: Proximity, contacts: Contacts, within: float) -> Placed:
    """Remember the pieces' placements of the last query."""
    return Placed(proximity.placements.copy(), contacts, within)


def doubtful_pairs(proximity: Proximity, before: Placed, after: Placed) -> Indices:
    """Pairs (indices into the collision pairs) that may have changed sides between two postures."""
    motion = _motion(proximity, before.placements, after.placements)
    pairs = proximity.pairs
    room = proximity.widths + (before.within + after.within)
    room[before.contacts.number] += np.maximum(before.contacts.distance, 0.0) - before.within
    room[after.contacts.number] += np.maximum(after.contacts.distance, 0.0) - after.within
    doubtful = np.flatnonzero(motion[pairs[:, 0]] + motion[pairs[:, 1]] > room)
    if not len(doubtful):
        return doubtful
    listed = np.full(len(pairs), -1, dtype=np.intp)
    listed[before.contacts.number] = np.arange(len(before.contacts.number))
    return np.array([k for k in doubtful if not _parted(proximity, before, after, int(listed[k]))], dtype=np.intp)


def _motion(proximity: Proximity, before: Array, after: Array) -> Array:
    """Longest way that any point of each piece made, metres."""
    shift = after - before
    center = np.sqrt(np.einsum("ij,ij->i", shift[:, 3], shift[:, 3]))
    # |R1 - R0| in the Frobenius norm is 2 sqrt(2) sin(angle / 2): no point moves more than 1/sqrt(2) of it times reach
    turn = np.sqrt(0.5 * np.einsum("ijk,ijk->i", shift[:, :3], shift[:, :3]))
    reach = np.where(np.isfinite(proximity.reach), proximity.reach, 0.0)
    motion: Array = ARC * (center + turn * reach)
    return motion


def _parted(proximity: Proximity, before: Placed, after: Placed, contact: int) -> bool:
    """Whether the plane between two pieces before the step still parts them after it, carried by either."""
    if contact < 0:
        return False
    first, second = before.contacts.pair[contact]
    normal = before.contacts.normal[contact]
    for carrier, other, direction, point in (
        (first, second, normal, before.contacts.point_a[contact]),
        (second, first, -normal, before.contacts.point_b[contact]),
    ):
        core = proximity.cores[other]
        if not len(core.points):
            continue
        local_normal = before.placements[carrier, :3] @ direction
        local_point = before.placements[carrier, :3] @ (point - before.placements[carrier, 3])
        heights = []
        for placed in (before.placements, after.placements):
            world = core.points @ placed[other, :3] + placed[other, 3]
            local = (world - placed[carrier, 3]) @ placed[carrier, :3].T
            heights.append(float(((local - local_point) @ local_normal).min()) - core.radius)
        turned = after.placements[[carrier, other], :3] - before.placements[[carrier, other], :3]
        angle = float(np.sqrt(0.5 * np.einsum("ijk,ijk->i", turned, turned)).sum())
        arc = 0.125 * angle**2 * (core.reach + float(np.linalg.norm(before.placements[other, 3] - point)))
        if min(heights) - arc > -DIP:
            return True
    return False
