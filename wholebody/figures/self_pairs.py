"""Which pieces of a figure can touch each other, where nobody has said so: adjacency, and random postures."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.figures.description import ExcludedPair

Array = NDArray[np.float64]

UNLIMITED = np.pi
"""Range, each way, in which joints without limits are sampled: radians, or metres for sliding joints."""


def choose_pairs(model: pin.Model, geometry: pin.GeometryModel, samples: int, seed: int) -> tuple[ExcludedPair, ...]:
    """Put the pairs that can touch into the geometry.

    Left out are pieces on one link or joint, pieces of neighbours (no piece on any joint between them), and pairs that
    overlap in every one of a number of random postures within the limits: shells in shells, which nothing could free.

    Args:
        model: Pinocchio's model.
        geometry: its pieces; the pairs are replaced.
        samples: number of random postures.
        seed: of those postures.

    Returns:
        The pairs left out, with the reason.
    """
    geometry.removeAllCollisionPairs()
    pieces, excluded = geometry.geometryObjects, []
    carriers = {piece.parentJoint for piece in pieces}
    above = {joint: _carrier_above(model, joint, carriers) for joint in carriers}
    for i, j in combinations(range(geometry.ngeoms), 2):
        a, b = pieces[i].parentJoint, pieces[j].parentJoint
        if a == b:
            excluded.append(ExcludedPair(pieces[i].name, pieces[j].name, "on one joint"))
        elif above[a] == b or above[b] == a:
            excluded.append(ExcludedPair(pieces[i].name, pieces[j].name, "neighbours"))
        else:
            geometry.addCollisionPair(pin.CollisionPair(i, j))
    return (*excluded, *_drop_always_overlapping(model, geometry, samples, seed))


def random_postures(model: pin.Model, count: int, seed: int) -> Array:
    """Postures (count, nq) within the limits, the root at the origin."""
    rng = np.random.default_rng(seed)
    neutral = pin.neutral(model)
    postures = np.tile(neutral, (count, 1))
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            low, high = (low if np.isfinite(low) else -UNLIMITED), (high if np.isfinite(high) else UNLIMITED)
            postures[:, joint.idx_q] = rng.uniform(low, high, count)
        elif (joint.nq, joint.nv) == (2, 1):
            angle = rng.uniform(-UNLIMITED, UNLIMITED, count)
            postures[:, joint.idx_q], postures[:, joint.idx_q + 1] = np.cos(angle), np.sin(angle)
    return postures


def _carrier_above(model: pin.Model, joint: int, carriers: set[int]) -> int:
    """Nearest joint towards the root that carries a piece; -1 if there is none."""
    while joint > 0:
        joint = model.parents[joint]
        if joint in carriers:
            return int(joint)
    return -1


def _drop_always_overlapping(
    model: pin.Model, geometry: pin.GeometryModel, samples: int, seed: int
) -> list[ExcludedPair]:
    if not len(geometry.collisionPairs) or not samples:
        return []
    data, geometry_data = model.createData(), pin.GeometryData(geometry)
    always = np.ones(len(geometry.collisionPairs), dtype=bool)
    for q in random_postures(model, samples, seed):
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, q)
        for k in np.flatnonzero(always):
            always[k] = pin.computeCollision(geometry, geometry_data, int(k))
        if not always.any():
            break
    dropped = []
    pieces = geometry.geometryObjects
    for pair in [geometry.collisionPairs[int(k)] for k in np.flatnonzero(always)]:
        dropped.append(
            ExcludedPair(pieces[pair.first].name, pieces[pair.second].name, "overlap in every sampled posture")
        )
    for entry in dropped:
        geometry.removeCollisionPair(
            pin.CollisionPair(geometry.getGeometryId(entry.a), geometry.getGeometryId(entry.b))
        )
    return dropped
