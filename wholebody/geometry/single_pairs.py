"""Distances of single pairs, without the data that Pinocchio keeps for each pair of a model.

These are 4.5 kB a pair: for a person among 20,000 things 3.6 GB for each run, of which hardly any are ever read.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

from wholebody.arrays import Array, Indices
from wholebody.geometry.memory_views import RESULT_FIELDS, read_result

KEPT = 30_000  # pairs up to which Pinocchio keeps data for each, 135 MB then; with them a distance takes a fifth


def pair_data(geometry: pin.GeometryModel, pairs: int) -> pin.GeometryData:
    """Pinocchio's data of a model with so many pairs; of more than `KEPT`, for the placements alone."""
    if pairs <= KEPT:
        return pin.GeometryData(geometry)
    pieces = geometry.copy()
    pieces.removeAllCollisionPairs()
    return pin.GeometryData(pieces)


def measured(geometry: pin.GeometryModel, placements: Array, pairs: Indices) -> Array:
    """Distance, normal, and nearest points on both pieces (k, 10) of pairs (k, 2), from coal's own first guess.

    Args:
        geometry: all pieces.
        placements: (n, 4, 3) where they are; see `Contacts.placements`.
        pairs: (k, 2).
    """
    found = np.empty((len(pairs), RESULT_FIELDS))
    pieces = {k: geometry.geometryObjects[k].geometry for k in np.unique(pairs).tolist()}
    places = {k: coal.Transform3s(placements[k, :3].T, placements[k, 3]) for k in pieces}
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for row, (first, second) in enumerate(pairs.tolist()):
        result.clear()
        coal.distance(pieces[first], places[first], pieces[second], places[second], request, result)
        found[row] = read_result(result)
    return found
