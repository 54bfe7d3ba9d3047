"""Distances of single pairs, without the data that Pinocchio keeps for each pair of a model.

These are 4.5 kB a pair: for a person among 20,000 things 3.6 GB for each run, of which hardly any are ever read.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.geometry.memory_views import RESULT_FIELDS, distance_view, read_result

KEPT = 30_000  # pairs up to which Pinocchio keeps data for each, 135 MB then; with them a distance takes a fifth

ROOM = 64  # results that are read at once; their memory is made at the first question, in 0.1 ms


def pair_data(geometry: pin.GeometryModel, pairs: int) -> pin.GeometryData:
    """Pinocchio's data of a model with so many pairs; of more than `KEPT`, for the placements alone."""
    if pairs <= KEPT:
        return pin.GeometryData(geometry)
    pieces = geometry.copy()
    pieces.removeAllCollisionPairs()
    return pin.GeometryData(pieces)


class SinglePairs:
    """Asks coal for one pair after the other; used by one run at a time."""

    def __init__(self, geometry: pin.GeometryModel) -> None:
        """Take the pieces from a geometry model."""
        self._geometry = geometry
        self._vector = coal.StdVec_DistanceResult()
        self._results: list[Any] = []
        self._view: Array | None = None

    def measured(self, placements: Array, pairs: Indices) -> Array:
        """Distance, normal, and nearest points on both pieces (k, 10) of pairs (k, 2), from coal's own first guess.

        Args:
            placements: (n, 4, 3) where all pieces are; see `Contacts.placements`.
            pairs: (k, 2).
        """
        if len(pairs) and not self._results:
            self._vector.extend([coal.DistanceResult() for _ in range(ROOM)])
            self._results, self._view = list(self._vector), distance_view(self._vector)
        found = np.empty((len(pairs), RESULT_FIELDS))
        pieces = {k: self._geometry.geometryObjects[k].geometry for k in np.unique(pairs).tolist()}
        places = {k: coal.Transform3s(placements[k, :3].T, placements[k, 3]) for k in pieces}
        request = coal.DistanceRequest()
        for begin in range(0, len(pairs), ROOM):
            some = pairs[begin : begin + ROOM].tolist()
            for result, (first, second) in zip(self._results, some, strict=False):
                result.clear()  # coal keeps the lesser of two distances
                coal.distance(pieces[first], places[first], pieces[second], places[second], request, result)
            if self._view is not None:
                found[begin : begin + len(some)] = self._view[: len(some)]
            else:
                found[begin : begin + len(some)] = [read_result(result) for result in self._results[: len(some)]]
        return found
