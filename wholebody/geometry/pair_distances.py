"""coal's distances of the pairs of a geometry model."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.geometry.flesh import Flesh, flesh_of, spread
from wholebody.geometry.memory_views import (
    RESULT_FIELDS,
    fields,
    guess_view,
    placement_view,
    read_result,
    result_view,
)

KEPT = 30_000
"""Pairs up to which Pinocchio keeps data for each, 4.5 kB; with them a distance takes a fifth. For a person among
20,000 things they would take 3.6 GB, of which hardly any is ever read."""

ROOM = 64  # results that are read at once
FIRST_GUESS = np.array([1.0, 0.0, 0.0, 0.0])  # coal's own for a pair it has not seen: a direction, two vertices zero


class PairDistances:
    """Asks coal for pairs of a geometry model; used by one run at a time.

    For each pair coal keeps the end of its last search for the nearest points. A search that begins there is a fifth
    faster. It ends within 1e-6 m of the result of any other search, but not at exactly the same number: code that must
    be repeatable calls `reset` first.

    Attributes:
        geometry: the model.
        pairs: (p, 2) the pieces of its pairs.
        data: Pinocchio's; of more than `KEPT` pairs for the placements alone.
        kept: whether it has results of the pairs.
        placed: (n, 4, 3) where the pieces are: columns of the rotation, then the translation; a view where possible.
        results: (p, 20) view of these results, see `memory_views.fields`; None if they are read in another way.
    """

    def __init__(self, geometry: pin.GeometryModel, pairs: Indices) -> None:
        """Lay views over results that nothing else uses."""
        self.geometry, self.pairs, self.kept = geometry, pairs, len(pairs) <= KEPT
        pieces = geometry
        if not self.kept:
            pieces = geometry.copy()
            pieces.removeAllCollisionPairs()
        self.data = data = pin.GeometryData(pieces)
        view = placement_view(data.oMg)
        self._viewed = view is not None
        self.placed: Array = self._copied() if view is None else view
        self.results = result_view(data.distanceResults)
        self._guesses = guess_view(data.distanceRequests)
        self._single = SinglePairs(geometry)
        self._flesh: tuple[Flesh, ...] | None = None
        self._flat: Any = None  # memoryview of the numbers of `placed`

    def _copied(self) -> Array:
        return np.array([[*at.rotation.T, at.translation] for at in self.data.oMg], dtype=float).reshape(-1, 4, 3)

    def reset(self) -> None:
        """Reset the guess of every pair to coal's initial guess."""
        if self._guesses is not None:
            self._guesses[:] = FIRST_GUESS
            return
        for request in self.data.distanceRequests:
            request.cached_gjk_guess = FIRST_GUESS[:3]
            request.cached_support_func_guess = np.zeros(2, dtype=np.int32)

    def place(self, model: pin.Model, data: Any) -> None:
        """Move the pieces to where the joints are in Pinocchio's data."""
        pin.updateGeometryPlacements(model, data, self.geometry, self.data)
        if not self._viewed:
            self.placed = self._copied()
        self.place_flesh()

    def place_flesh(self) -> None:
        """Move flesh to where its limb has it, from where a bent one has it."""
        flesh = self._flesh
        if flesh is None:
            flesh = self._flesh = flesh_of(self.geometry)
        if flesh:
            if not self._viewed or self._flat is None:
                self._flat = self.placed.data.cast("B").cast("d")
            spread(flesh, self.placed, self._flat)
            for piece, *_ in () if self._viewed else flesh:
                self.data.oMg[piece] = pin.SE3(self.placed[piece, :3].T, self.placed[piece, 3])

    def put(self, placements: Array) -> None:
        """Put the pieces to placements (n, 4, 3)."""
        self.placed[:] = placements
        for k, rows in () if self._viewed else enumerate(placements):
            self.data.oMg[k] = pin.SE3(rows[:3].T, rows[3])

    def measured(self, numbers: Indices) -> Array:
        """Distance, normal, and nearest points on both pieces (k, 10) of the pairs with these numbers (k,)."""
        if not self.kept:
            return self._single.measured(self.placed, self.pairs[numbers])
        compute, geometry, data = pin.computeDistance, self.geometry, self.data
        for number in numbers.tolist():
            compute(geometry, data, number)
        return self.read(numbers)

    def one(self, number: int) -> float:
        """The distance of the pair with this number."""
        if not self.kept:
            return float(self.measured(np.array([number]))[0, 0])
        return float(pin.computeDistance(self.geometry, self.data, number).min_distance)

    def all_measured(self) -> Array:
        """The same of all pairs, in an array that the next question may overwrite."""
        if not self.kept:
            return self._single.measured(self.placed, self.pairs)
        pin.computeDistances(self.geometry, self.data)
        return fields(self.results) if self.results is not None else self.read(np.arange(len(self.pairs)))

    def read(self, numbers: Indices) -> Array:
        """What was measured last of pairs (k,), see `measured`."""
        if self.results is not None:
            return fields(self.results)[numbers]
        found = [read_result(self.data.distanceResults[number]) for number in numbers.tolist()]
        return np.reshape(found, (-1, RESULT_FIELDS))


class SinglePairs:
    """Asks coal for one pair after the other, without data for each; used by one run at a time."""

    def __init__(self, geometry: pin.GeometryModel) -> None:
        self._geometry = geometry
        self._pieces, self._places = dict[int, Any](), dict[int, Any]()  # of those asked for: shape, placement
        self._at = np.full((geometry.ngeoms, 4, 3), np.nan)  # where `_places` have them
        self._vector = coal.StdVec_DistanceResult()
        self._results: list[Any] = []
        self._view: Array | None = None

    def measured(self, placements: Array, pairs: Indices) -> Array:
        """As `PairDistances.measured`, of pairs (k, 2) of any pieces at placements (n, 4, 3), from coal's own guess."""
        if len(pairs) and not self._results:
            self._vector.extend([coal.DistanceResult() for _ in range(ROOM)])
            self._results, self._view = list(self._vector), result_view(self._vector)
        found = np.empty((len(pairs), RESULT_FIELDS))
        pieces, places, asked = self._pieces, self._places, np.unique(pairs)
        moved = asked[(self._at[asked] != placements[asked]).any(axis=(1, 2))]  # most are of things that stand
        for k in moved.tolist():
            if k not in pieces:
                pieces[k] = self._geometry.geometryObjects[k].geometry
            places[k] = coal.Transform3s(placements[k, :3].T, placements[k, 3])
        self._at[moved] = placements[moved]
        request = coal.DistanceRequest()
        for begin in range(0, len(pairs), ROOM):
            some = pairs[begin : begin + ROOM].tolist()
            for result, (first, second) in zip(self._results, some, strict=False):
                result.clear()  # coal keeps the lesser of two distances
                coal.distance(pieces[first], places[first], pieces[second], places[second], request, result)
            if self._view is not None:
                found[begin : begin + len(some)] = fields(self._view)[: len(some)]
            else:
                found[begin : begin + len(some)] = [read_result(result) for result in self._results[: len(some)]]
        return found
