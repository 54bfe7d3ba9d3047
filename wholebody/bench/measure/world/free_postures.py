"""Whether a posture near another is free: a search that shares nothing with the methods.

From the posture itself and from random ones around it, all pairs nearer than `WITHIN` are projected out of each other
one after the other (Kaczmarz), within the box of what joint speeds allow, again and again.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.geometry.proximity import Contacts

FREE = 1e-4  # m: depth up to which a posture is free
GAP = 3e-4  # m: to which pairs are parted
WITHIN = 0.02  # m: pairs that are looked at
ROUNDS, SWEEPS = 25, 30  # of looking, and over the rows of each
STARTS = 24


def free_posture(scene: wb.Scene, q: Array, most: Array, rng: np.random.Generator) -> Array | None:
    """A posture (nq,) that is free and within a box around another; None if the search finds none.

    Args:
        scene: with all things where they end.
        q: (nq,) the posture in the middle of the box.
        most: (nv,) tangent displacements at most, radians and metres.
        rng: of the random starts.
    """
    model, lower, upper = scene.model, scene.model.lowerPositionLimit, scene.model.upperPositionLimit
    data = model.createData()
    root = model.nq - model.nv  # 1 with a free root, whose rotation has four numbers
    low, high = -most.copy(), most.copy()
    free = 6 * root
    low[free:] = np.maximum(low[free:], lower[free + root :] - q[free + root :])
    high[free:] = np.minimum(high[free:], upper[free + root :] - q[free + root :])
    low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    for start in range(STARTS):
        way = np.zeros(model.nv)
        if start:
            way[:free] = rng.uniform(low[:free], high[:free])
            way[free:] = rng.uniform(0.0, 1.0) * rng.uniform(low[free:], high[free:])
        for _ in range(ROUNDS):
            at = pin.integrate(model, q, way)
            near = scene.contacts(at, WITHIN)
            if near.distance.min(initial=np.inf) >= -FREE:
                return np.asarray(at)
            rows, gaps = _rows(scene, data, at, near), near.distance
            step = np.zeros(model.nv)
            square = (rows**2).sum(axis=1)
            for _ in range(SWEEPS):
                for row in np.flatnonzero(square > 1e-9):
                    short = GAP - gaps[row] - rows[row] @ step
                    if short > 0.0:
                        step = np.clip(step + short / square[row] * rows[row], low - way, high - way)
            way = way + step
    return None


def _rows(scene: wb.Scene, data: pin.Data, q: Array, near: Contacts) -> Array:
    """Rates (k, nv) of the distances of pairs."""
    model, pieces = scene.model, scene.built.geometry.geometryObjects
    pin.computeJointJacobians(model, data, q)
    rows = np.zeros((len(near.distance), model.nv))
    for row, (pair, normal) in enumerate(zip(near.pair.tolist(), near.normal, strict=True)):
        for piece, point, sign in zip(pair, (near.point_a[row], near.point_b[row]), (-1.0, 1.0), strict=True):
            joint = pieces[piece].parentJoint
            if joint > 0:
                turning = pin.getJointJacobian(model, data, joint, pin.WORLD)
                rows[row] += sign * normal @ (turning[:3] - pin.skew(point) @ turning[3:])
    return rows
