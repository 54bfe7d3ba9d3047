"""How deep pairs overlap at postures that follow each other, and at most in between.

A pair is looked at only where it may overlap: its distance was once known, and each motion since can have made it
smaller by a bounded length (`motion_bounds`). What is in doubt is asked of coal at both ends of a motion. Where bounds
from the ends cannot tell how deep a pair gets in between, the motion is halved, for this pair, until they can.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import with_loops
from wholebody.geometry.continuous.motion_bounds import MotionBounds
from wholebody.geometry.pair_distances import PairDistances
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.geometry.proximity import PairTable

SHARP = 0.1
"""Share of the tolerance that decides: a pair found to be less deep than the tolerance by this much is looked at until
it is proved to be less deep than the tolerance. A smaller share makes more queries of coal."""

COARSE = 0.05
"""Share of a depth to which it is known between two postures: nobody needs an overlap of 5 cm to 0.01 mm. A smaller
share makes more queries where a clip collides: 0.02 makes a check of recordings slower by a tenth."""

ACCURACY = 2.0 * COAL_ACCURACY


class Depths(NamedTuple):
    """Pairs that overlap, and how deep."""

    number: Indices  # (k,) places among the collision pairs of the geometry model, ascending
    depth: Array  # (k,) metres, positive


class SweptDepth:
    """Depths along one sequence of postures at a time."""

    def __init__(self, table: PairTable, geometry: pin.GeometryModel, tolerance: float) -> None:
        """Read the pieces, which stand where `geometry` has them; `tolerance` metres matter. Raises as `Sweep`."""
        self._table, self._geometry, self._tolerance = table, geometry, tolerance
        self._bounds = MotionBounds(table.model, table.joint, table.reach)
        self._kernel = compiled_kernel()
        self._shapes = shapes_of(table)
        self._before, self._now, self._middle = (_Postures(table, geometry) for _ in range(3))
        count = len(table.pairs)
        self._extent, self._index = np.zeros((geometry.ngeoms, 3)), np.zeros(count, dtype=np.intp)
        self._q: Array | None = None
        self.asked = 0

    def start(self, q: Array) -> Depths:
        """Look at the first posture (nq,) of a sequence; what was looked at before is forgotten."""
        for place in (self._before, self._now, self._middle):
            place.distances.reset()
        self._now.move(q)
        self._q = q
        nothing = np.zeros(len(self._table.pairs))
        self._screened(np.full(len(nothing), -np.inf), nothing)
        return self._overlaps(np.flatnonzero(self._now.least < 0.0))

    def advance(self, q: Array) -> tuple[Depths, Depths]:
        """Go on to the next posture (nq,): the pairs that overlap there, and along the motion or at one of its ends."""
        # None gets deeper than tolerance and depth; depths beyond it may be large by `SHARP` of it and `COARSE`.
        assert self._q is not None
        self._before, self._now = self._now, self._before
        before, now = self._before, self._now
        velocity = np.asarray(pin.difference(self._table.model, self._q, q))
        self._bounds.update(before.data, velocity, before.places[:, 3])
        now.move(q)
        pairs = self._table.pairs
        speed = self._bounds.approach(pairs[:, 0], pairs[:, 1])
        found, doubtful = self._look(before.least, speed)
        unknown = doubtful[~before.exact[doubtful]]
        if len(unknown):
            self._ask(before, unknown)
            still = before.least[doubtful] + now.least[doubtful] - speed[doubtful] < 0.0
            doubtful = doubtful[still]
        passing = self._between(doubtful, speed, velocity) if len(doubtful) else Depths(doubtful, np.zeros(0))
        self._q = q
        return found, passing

    def _look(self, before: Array, speed: Array) -> tuple[Depths, Indices]:
        """Overlaps at the present posture, and the pairs that may overlap on the motion there."""
        doubtful = self._screened(before, speed)
        overlaps = self._overlaps(doubtful)
        return overlaps, doubtful[before[doubtful] + self._now.least[doubtful] - speed[doubtful] < 0.0]

    def _screened(self, before: Array, speed: Array) -> Indices:
        """The pairs that may overlap on the motion to the present posture or at it; bounds there of all."""
        now, table = self._now, self._table
        count = self._kernel.screen(
            now.places, (table.pairs, table.reach, table.half), speed, before, now.least, self._extent, self._index
        )
        now.exact[:] = False
        return np.asarray(self._index[:count].copy())

    def _overlaps(self, numbers: Indices) -> Depths:
        """Those of some pairs that overlap at the present posture."""
        now = self._now
        self._ask(now, numbers)
        overlap = numbers[now.rows[numbers, 0] < 0.0]
        return Depths(overlap, -now.rows[overlap, 0])

    def _ask(self, place: _Postures, numbers: Indices) -> None:
        self.asked += len(numbers)
        place.ask(numbers)

    def _between(self, doubtful: Indices, speed: Array, velocity: Array) -> Depths:
        """Depths on the motion from the posture before to the present one, all parts halved together."""
        # Each row is a pair during a part: `which` of the pairs, and the places before and after it in `stack`.
        assert self._q is not None
        stack = _Stack(self._before.places, self._now.places)
        rows0, rows1 = self._before.rows[doubtful], self._now.rows[doubtful]
        deepest = np.maximum(0.0, -np.minimum(rows0[:, 0], rows1[:, 0]))  # found
        bound = np.zeros(len(doubtful))  # proved
        which, share = np.arange(len(doubtful)), 1.0
        first, last = np.zeros(len(doubtful), dtype=np.intp), np.ones(len(doubtful), dtype=np.intp)
        while len(which):
            allowed, least, numbers = self._allowed(deepest)[which], np.empty(len(which)), doubtful[which]
            parts = self._kernel.Parts(numbers, first, last, rows0, rows1, speed[numbers], -allowed)
            motion = self._kernel.Speeds(self._bounds.turn, self._bounds.speed, self._bounds.carries)
            self._kernel.lower_bounds(parts, stack.places, self._shapes, motion, share, ACCURACY, least)
            # The shortest parts, 0.02 mm of a hand: what is in doubt there gets the depth that it may have.
            kept = least >= -allowed if share > 2.0**-12 else np.ones(len(which), dtype=bool)
            np.maximum.at(bound, which[kept], -least[kept])
            going = np.flatnonzero(~kept)
            if not len(going):
                break
            going = going[np.argsort(first[going], kind="stable")]  # rows of one middle beside each other
            which, first, last, share = which[going], first[going], last[going], 0.5 * share
            middle, rows = self._halfway(stack, first, share, doubtful[which], velocity)
            rows0, rows1 = rows0[going], rows1[going]
            np.maximum.at(deepest, which, -rows[:, 0])
            which, first, last = np.tile(which, 2), np.concatenate([first, middle]), np.concatenate([middle, last])
            rows0, rows1 = np.concatenate([rows0, rows]), np.concatenate([rows, rows1])
        depth = np.where(bound > self._tolerance, np.maximum(bound, deepest), deepest)
        deep = np.flatnonzero(depth > 0.0)
        return Depths(doubtful[deep], depth[deep])

    def _halfway(
        self, stack: _Stack, first: Indices, share: float, numbers: Indices, velocity: Array
    ) -> tuple[Indices, Array]:
        """Places in the stack, and distances and normals, `share` of the motion after the places `first`, ascending."""
        assert self._q is not None
        here, model, q = self._middle, self._table.model, self._q
        middle, rows = np.empty(len(first), dtype=np.intp), np.empty((len(first), 4))
        ends = [*(np.flatnonzero(np.diff(first)) + 1).tolist(), len(first)]
        begin = 0
        for end in ends:
            at = stack.times[first[begin]] + share
            here.move(pin.integrate(model, q, at * velocity))
            rows[begin:end] = here.measured(numbers[begin:end])
            middle[begin:end] = stack.add(at, here.places)
            begin = end
        self.asked += len(first)
        return middle, rows

    def _allowed(self, deepest: Array) -> Array:
        """How deep pairs may at most be, (k,), that were found to be `deepest`, so that no more has to be known."""
        sharp = SHARP * self._tolerance
        beyond = deepest + np.maximum(sharp, COARSE * deepest)
        return np.where(deepest <= self._tolerance - sharp, self._tolerance, beyond)


class _Stack:
    """Placements `places` (m, n, 4, 3) of the pieces at `times`, shares of one motion; as many as times are filled."""

    def __init__(self, before: Array, after: Array) -> None:
        self.times, self.places = [0.0, 1.0], np.empty((16, *before.shape))
        self.places[0], self.places[1] = before, after

    def add(self, time: float, places: Array) -> int:
        """Copy placements; returns their number."""
        if len(self.times) == len(self.places):
            self.places = np.concatenate([self.places, np.empty_like(self.places)])
        self.places[len(self.times)] = places
        self.times.append(time)
        return len(self.times) - 1


class _Postures:
    """One posture after the other: where pieces are, and the distances that were asked for there.

    Attributes:
        places: (n, 4, 3) placements of the pieces.
        rows: (pairs, 4) distances and normals; only those that were asked for are of the present posture.
        least: (pairs,) lower bounds of the distances.
        exact: (pairs,) whether a pair was asked for.
    """

    def __init__(self, table: PairTable, geometry: pin.GeometryModel) -> None:
        self._model, self.data = table.model, table.model.createData()
        self.distances, count = PairDistances(geometry, table.pairs), len(table.pairs)
        self.places = np.zeros((geometry.ngeoms, 4, 3))
        self.rows, self.least, self.exact = np.zeros((count, 4)), np.zeros(count), np.zeros(count, dtype=bool)

    def move(self, q: Array) -> None:
        pin.forwardKinematics(self._model, self.data, q)
        self.distances.place(self._model, self.data)
        self.places[:] = self.distances.placed

    def measured(self, numbers: Indices) -> Array:
        """Distances and normals (k, 4) of pairs, by coal."""
        return self.distances.measured(numbers)[:, :4]

    def ask(self, numbers: Indices) -> None:
        """Remember the distances of pairs."""
        self.rows[numbers] = self.measured(numbers)
        distance = self.rows[numbers, 0]
        self.least[numbers] = distance - ACCURACY * (1.0 + np.abs(distance))
        self.exact[numbers] = True


def shapes_of(table: PairTable) -> Any:
    """The pieces and pairs of a table as the loops take them."""
    ellipsoids = [isinstance(piece.geometry, coal.Ellipsoid) for piece in table.geometry.geometryObjects]
    radii = np.where(np.array(ellipsoids, dtype=bool)[:, None], table.half, 0.0)
    return compiled_kernel().Shapes(
        table.pairs, table.joint, table.reach, table.points, table.first_point, table.radius, radii, table.faces,
        table.first_face,
    )  # fmt: skip


@with_loops("wholebody.geometry.continuous.swept_depth_kernel")
def compiled_kernel(swept_depth_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a clip."""
    places, none, index = np.zeros((0, 4, 3)), np.zeros(0), np.zeros(0, dtype=np.intp)
    pairs, rows, one = np.zeros((0, 2), dtype=np.intp), np.zeros((0, 4)), np.zeros(1, dtype=np.intp)
    lines = np.zeros((0, 3))
    shapes = swept_depth_kernel.Shapes(pairs, index, none, lines, one, none, lines, rows, one)
    speeds = swept_depth_kernel.Speeds(none, np.zeros((0, 0)), np.zeros((0, 0), dtype=bool))
    swept_depth_kernel.screen(places, (pairs, none, lines), none, none, none, lines, index)
    parts = swept_depth_kernel.Parts(index, index, index, rows, rows, none, none)
    swept_depth_kernel.lower_bounds(parts, np.zeros((0, 0, 4, 3)), shapes, speeds, 1.0, 0.0, none)
    sliding = swept_depth_kernel.Sliding(index, rows, none, places, np.zeros((0, 6)))
    swept_depth_kernel.keep_apart(sliding, shapes, speeds, none)
