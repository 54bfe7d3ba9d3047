"""Test whether a motion passes through something: proof for most pairs, a continuous sweep for the others.

Two convex pieces that are d0 apart before a motion and d1 after it can only have changed sides if they moved against
each other by d0 + d1 and the widths of both. If a motion is longer (a fast hand, a thin plate), it is halved a few
times. The remaining pairs are swept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.geometry.continuous.moved_pairs import QueryResult, distances, far_moved
from wholebody.geometry.proximity import Contacts, PairTable

if TYPE_CHECKING:
    from wholebody.geometry.continuous.sweep import FirstContact, Sweep
    from wholebody.geometry.continuous.swept_depth import Depths, SweptDepth


OVERLAP = 2e-4  # m: overlap during a motion that is ignored; smaller than the width of any piece
INSIDE = 1e-4  # m: overlap at the end of a motion that is ignored
GRAZE = 5e-4  # m: a motion that gets deeper than this is blocked; held soles overlap a little between two postures
SHORT = 0.03  # rad, m: a shorter motion whose every step was tested gets less deep than GRAZE


class Queries(Protocol):
    """Queries at postures between the two; `wholebody.scene.workspace.Workspace` implements them."""

    @property
    def model(self) -> pin.Model:
        """The model of the figure."""

    @property
    def table(self) -> PairTable:
        """The pieces and pairs."""

    @property
    def sweep(self) -> Sweep:
        """Conservative advancement with the present placements of the pieces."""

    def near(self, q: Array, within: float) -> Contacts:
        """Every pair nearer than `within` metres at a posture (nq,)."""


def is_free(
    queries: Queries, before: Array, after: Array, unswept: float, over: Callable[[], bool] = bool
) -> bool:  # fmt: skip
    """Whether a motion counts as free; one shorter than `unswept` is not swept."""
    if np.isinf(unswept) or np.abs(pin.difference(queries.model, before, after)).max(initial=0.0) <= unswept:
        return True
    return queries.sweep.first_contact(before, after, tolerance=GRAZE, over=over) is None


class Entered(NamedTuple):
    """A pair that gets deeper during a motion than it may."""

    number: int  # place among the collision pairs of the geometry model
    depth: float  # at the end, metres, if it overlaps there, otherwise the largest on the way
    inside: bool  # whether it overlaps at the end


def entered(
    sweep: Sweep, depths: SweptDepth, path: Sequence[Array], watched: NDArray[np.bool_]
) -> list[Entered]:  # fmt: skip
    """Pairs that get deeper by `OVERLAP` on a path of postures, or by `INSIDE` at its end, unless it is free."""
    last = _by_pair(depths.start(path[-1]), len(watched))
    paths = ((path[0], path[-1]), path) if len(path) > 2 else (path,)
    if not (last > INSIDE).any() and any(_is_clear(sweep, way) for way in paths):
        return []
    first = _by_pair(depths.start(path[0]), len(watched))
    most = first.copy()
    for q in path[1:]:
        most = np.maximum(most, _by_pair(depths.advance(q)[1], len(watched)))
    inside = last > np.where(watched, INSIDE, first + INSIDE)
    return [
        Entered(number, float(last[number] if inside[number] else most[number]), bool(inside[number]))
        for number in np.flatnonzero(inside | (most > first + OVERLAP)).tolist()
    ]


def _is_clear(sweep: Sweep, path: Sequence[Array]) -> bool:
    return all(sweep.first_contact(q0, q1, tolerance=OVERLAP) is None for q0, q1 in pairwise(path))


def _by_pair(depths: Depths, pairs: int) -> Array:
    depth = np.zeros(pairs)
    depth[depths.number] = depths.depth
    return depth


def last_free(model: pin.Model, free: Array, q: Array, overlaps: Callable[[Array], object], halvings: int) -> Array:
    """Bisect the motion from a free posture (nq,) to one that overlaps; the result was tested to be free."""
    # Algorithm 1, step 4, of Schmidl and Lin: accurate to 2 to the power of minus the number of halvings.
    inside, outside = 0.0, 1.0
    for _ in range(halvings):
        middle = 0.5 * (inside + outside)
        if overlaps(np.asarray(pin.interpolate(model, free, q, middle))):
            outside = middle
        else:
            inside = middle
    return np.asarray(pin.interpolate(model, free, q, inside))


def passes_through(queries: Queries, before: QueryResult, after: QueryResult, q0: Array, q1: Array) -> bool:
    """Whether some pair has changed sides during a motion from q0 to q1 (nq,); the state of `queries` is moved."""
    # Halving decides most pairs at a tenth of a sweep's cost. The distance shows a pair that touches at the end.
    doubtful = far_moved(queries.table, before, after)
    return bool(len(doubtful)) and _halved(queries, before, after, q0, q1, doubtful, 3)


def _halved(
    queries: Queries, before: QueryResult, after: QueryResult, q0: Array, q1: Array, doubtful: Indices, halvings: int
) -> bool:
    table = queries.table
    end = distances(after, len(table.pairs))
    if not halvings:
        return _swept_through(queries, q0, q1, doubtful, end)
    q = pin.interpolate(queries.model, q0, q1, 0.5)
    middle = QueryResult(queries.near(q, before.within), before.within)
    inside = distances(middle, len(table.pairs))[doubtful] < -OVERLAP
    if (inside & (end[doubtful] > -OVERLAP)).any():
        return True
    for first, last, start, stop in ((before, middle, q0, q), (middle, after, q, q1)):
        still = np.intersect1d(far_moved(table, first, last), doubtful, assume_unique=True)
        if len(still) and _halved(queries, first, last, start, stop, still, halvings - 1):
            return True
    return False


def _swept_through(queries: Queries, q0: Array, q1: Array, doubtful: Indices, end: Array) -> bool:
    """The same by a sweep of these pairs; `end` are the distances (pairs,) after the motion."""
    while len(doubtful):
        hit = queries.sweep.first_contact(q0, q1, doubtful, OVERLAP)
        if hit is None:
            return False
        if end[hit.index] > -OVERLAP:
            return True
        doubtful = doubtful[doubtful != hit.index]
    return False


def first_passed(
    queries: Queries, before: QueryResult, after: QueryResult, q0: Array, q1: Array, overlap: float
) -> FirstContact | None:
    """First contact, deeper than `overlap`, of a pair that may have changed sides and is separate after the motion."""
    table = queries.table
    moved = far_moved(table, before, after)
    doubtful = moved[distances(after, len(table.pairs))[moved] > -overlap]
    return queries.sweep.first_contact(q0, q1, doubtful, overlap) if len(doubtful) else None
