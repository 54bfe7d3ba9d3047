"""Whether a step may have jumped over something: proof for most pairs, a continuous sweep for the others.

Two convex pieces that are d0 apart before a step and d1 after it can only have changed sides if they moved against each
other by d0 + d1 and the widths of both. Where a step is longer (a fast hand, a thin plate), the plane that parts them
before the step, carried along by one piece, may still part them after it, up to the height of the arcs that points
describe. What is left is swept.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.geometry.moved_pairs import Placed, distances, far_moved
from wholebody.geometry.proximity import Indices, PairTable
from wholebody.workspace import Workspace

Array = NDArray[np.float64]

DIP = 5e-4  # m: between two postures a piece may dip in by this much; half of the thinnest plate that counts
OVERLAP = 2e-4  # m: overlap on the way that does not count; finer than any piece is thick
GRAZE = 5e-4  # m: deeper than this a way goes into something; soles that are held dip in between two postures
SHORT = 0.03  # rad, m: a shorter way of joints whose every step was looked after dips in by less than GRAZE
HALVINGS = 3  # of a way before what is still in doubt is swept


def is_free(workspace: Workspace, before: Array, after: Array, unswept: float) -> bool:
    """Whether the way between two postures (nq,) goes into nothing.

    Args:
        workspace: of the run.
        before: where the way begins.
        after: where it ends.
        unswept: radians and metres: ways up to this are taken as they are.
    """
    if np.isinf(unswept) or np.abs(pin.difference(workspace.model, before, after)).max(initial=0.0) <= unswept:
        return True
    return workspace.sweep.first_contact(before, after, tolerance=GRAZE) is None


def jumps(workspace: Workspace, before: Placed, after: Placed, q0: Array, q1: Array) -> bool:
    """Whether some pair is on other sides of each other after a step than before it.

    A pair that touches on the way and still does at the end was bumped into, which its distance tells; one that is
    apart again was jumped over. The way is halved a few times, which parts most pairs beyond doubt at a tenth of the
    cost of a sweep; what remains is swept.

    Args:
        workspace: of the run that makes the step; its state is moved.
        before: where the pieces are before the step.
        after: where they are after it.
        q0: (nq,) posture before the step.
        q1: (nq,) posture after it.
    """
    table = workspace.table
    moved = far_moved(table, before, after)
    if not len(moved):
        return False
    moved = moved[~_passing_by(workspace, before, after, q0, q1, moved)]
    doubtful = _not_parted(table, before, after, moved)
    return bool(len(doubtful)) and _jumps(workspace, before, after, q0, q1, doubtful, HALVINGS)


def _jumps(
    workspace: Workspace, before: Placed, after: Placed, q0: Array, q1: Array, doubtful: Indices, halvings: int
) -> bool:
    table = workspace.table
    end = distances(after, len(table.pairs))
    if not halvings:
        return _sweep_jumps(workspace, q0, q1, doubtful, end)
    q = pin.interpolate(workspace.model, q0, q1, 0.5)
    middle = Placed(workspace.near(q, before.within), before.within)
    inside = distances(middle, len(table.pairs))[doubtful] < -OVERLAP
    if (inside & (end[doubtful] > -OVERLAP)).any():
        return True
    for first, last, start, stop in ((before, middle, q0, q), (middle, after, q, q1)):
        still = np.intersect1d(doubtful_pairs(table, first, last), doubtful, assume_unique=True)
        if len(still) and _jumps(workspace, first, last, start, stop, still, halvings - 1):
            return True
    return False


def _sweep_jumps(workspace: Workspace, q0: Array, q1: Array, doubtful: Indices, end: Array) -> bool:
    """By continuous collision detection of these pairs; `end` are the distances (pairs,) after the way."""
    while len(doubtful):
        hit = workspace.sweep.first_contact(q0, q1, workspace.table.pairs[doubtful], OVERLAP)
        if hit is None:
            return False
        if end[hit.index] > -OVERLAP:
            return True
        doubtful = doubtful[doubtful != hit.index]
    return False


def doubtful_pairs(table: PairTable, before: Placed, after: Placed) -> Indices:
    """Pairs (indices into the collision pairs) that may have changed sides between two postures."""
    return _not_parted(table, before, after, far_moved(table, before, after))


def _passing_by(
    workspace: Workspace, before: Placed, after: Placed, q0: Array, q1: Array, pairs: Indices
) -> NDArray[np.bool_]:
    """Which of these pairs keep their bounding spheres apart all the way, as a look at its middle has it.

    The centres' way against each other is taken for the two chords that meet in the middle; what it leaves them by is
    a quarter of what the middle is off the whole chord where the way is a parabola, and taken for twice that.
    """
    table, state = workspace.table, workspace.state
    halfway = workspace.proximity.placements(state.update(pin.interpolate(workspace.model, q0, q1, 0.5)).data)
    first, second = table.pairs[pairs, 0], table.pairs[pairs, 1]
    start, middle, end = (
        placements[first, 3] - placements[second, 3] for placements in (before.placements, halfway, after.placements)
    )
    bow = middle - 0.5 * (start + end)
    room = np.minimum(_nearest(start, middle), _nearest(middle, end)) - 0.5 * np.sqrt(np.einsum("ij,ij->i", bow, bow))
    apart: NDArray[np.bool_] = room > table.reach[first] + table.reach[second]
    return apart


def _nearest(start: Array, end: Array) -> Array:
    """Least distance (k,) of the origin from the segments between points (k, 3)."""
    along = end - start
    share = -np.einsum("ij,ij->i", start, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
    point = start + np.clip(share, 0.0, 1.0)[:, None] * along
    nearest: Array = np.sqrt(np.einsum("ij,ij->i", point, point))
    return nearest


def _not_parted(table: PairTable, before: Placed, after: Placed, doubtful: Indices) -> Indices:
    """Those of these pairs that no plane parts before and after."""
    listed = np.full(len(table.pairs), -1, dtype=np.intp)
    listed[before.contacts.number] = np.arange(len(before.contacts.number))
    return np.array([k for k in doubtful if not _parted(table, before, after, int(listed[k]))], dtype=np.intp)


def _parted(table: PairTable, before: Placed, after: Placed, contact: int) -> bool:
    """Whether the plane between two pieces before the step still parts them after it, carried by either."""
    if contact < 0:
        return False
    first, second = before.contacts.pair[contact]
    normal = before.contacts.normal[contact]
    for carrier, other, direction, point in (
        (first, second, normal, before.contacts.point_a[contact]),
        (second, first, -normal, before.contacts.point_b[contact]),
    ):
        core = table.cores[other]
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
