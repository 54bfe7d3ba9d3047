"""Choice of the pairs of pieces that can touch, by adjacency and random postures, if a file does not give them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.figures.description import ExcludedPair

SELDOM = 0.02
"""Share of the sampled postures: pairs that are free in at most this share are left out, as nested shells."""

UNLIMITED = np.pi
"""Range in both directions for sampling joints without limits: radians, or metres for prismatic joints."""


def choose_pairs(model: pin.Model, geometry: pin.GeometryModel, samples: int) -> tuple[ExcludedPair, ...]:
    """Set the pairs of the geometry to those that can touch; return the pairs left out, with the reason."""
    # Pairs of one joint, of neighbours, and of nested shells, which nearly always overlap, are left out.
    geometry.removeAllCollisionPairs()
    joint = np.array([piece.parentJoint for piece in geometry.geometryObjects], dtype=np.intp)
    above = carriers_above(model, joint)
    first, second = np.triu_indices(geometry.ngeoms, 1)
    a, b = joint[first], joint[second]
    together, neighbours = a == b, (above[a] == b) | (above[b] == a)
    tested = np.flatnonzero(~together & ~neighbours)
    names = [piece.name for piece in geometry.geometryObjects]
    excluded = [
        ExcludedPair(names[first[k]], names[second[k]], "on one joint" if together[k] else "neighbours")
        for k in np.flatnonzero(together | neighbours)
    ]
    for i, j in zip(first[tested].tolist(), second[tested].tolist(), strict=True):
        geometry.addCollisionPair(pin.CollisionPair(i, j))
    postures = random_postures(model, samples, seed=0)
    touching = _seldom_free(model, geometry, postures)
    for number, seldom in touching.items():
        reason = "touch or overlap in every sampled posture"
        if seldom:
            reason = f"touch or overlap in all but {seldom} of {samples} sampled postures"
        pair = geometry.collisionPairs[number]
        excluded.append(ExcludedPair(names[pair.first], names[pair.second], reason))
    drop_pairs(geometry, touching, "")
    return tuple(excluded)


def drop_pairs(geometry: pin.GeometryModel, numbers: Iterable[int], reason: str) -> list[ExcludedPair]:
    """Remove pairs, given by their indices among the collision pairs, and return them with a reason."""
    gone = set(numbers)
    if not gone:
        return []
    # Read all pairs first: Pinocchio's list hands out references, which move when an entry is removed.
    pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    names = [piece.name for piece in geometry.geometryObjects]
    geometry.removeAllCollisionPairs()
    for number, (first, second) in enumerate(pairs):
        if number not in gone:
            geometry.addCollisionPair(pin.CollisionPair(first, second))
    return [ExcludedPair(names[pairs[number][0]], names[pairs[number][1]], reason) for number in sorted(gone)]


def random_postures(model: pin.Model, count: int, seed: int) -> Array:
    """Postures (count, nq) within the limits, the root at the origin."""
    rng = np.random.default_rng(seed)
    neutral = pin.neutral(model)
    postures = np.tile(neutral, (count, 1))
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            low = low if np.isfinite(low) else min(-UNLIMITED, high)
            high = high if np.isfinite(high) else max(UNLIMITED, low)
            postures[:, joint.idx_q] = rng.uniform(low, high, count)
        elif (joint.nq, joint.nv) == (2, 1):
            angle = rng.uniform(-UNLIMITED, UNLIMITED, count)
            postures[:, joint.idx_q], postures[:, joint.idx_q + 1] = np.cos(angle), np.sin(angle)
    return postures


def carriers_above(model: pin.Model, joint: Indices) -> Indices:
    """For every joint the nearest one towards the root that carries a piece; -1 if there is none."""
    carries = np.zeros(model.njoints, dtype=bool)
    carries[joint] = True
    above = np.full(model.njoints, -1, dtype=np.intp)
    for k in range(1, model.njoints):
        parent = int(model.parents[k])
        above[k] = parent if carries[parent] else above[parent]
    return above


def _seldom_free(model: pin.Model, geometry: pin.GeometryModel, postures: Array) -> dict[int, int]:
    """Pairs that touch in all but a share `SELDOM` of these postures -> number of postures without contact."""
    if not len(geometry.collisionPairs) or not len(postures):
        return {}
    data, results = model.createData(), pin.GeometryData(geometry)
    for request in results.collisionRequests:
        # metres: pieces nearer than this touch. The phalanges of some hands are never farther apart.
        request.security_margin = 2e-4
    free = dict.fromkeys(range(len(geometry.collisionPairs)), 0)
    most = int(SELDOM * len(postures))
    for q in postures:
        pin.updateGeometryPlacements(model, data, geometry, results, q)
        for k in [k for k in free if not pin.computeCollision(geometry, results, k)]:
            free[k] += 1
            if free[k] > most:
                del free[k]
        if not free:
            break
    return free
