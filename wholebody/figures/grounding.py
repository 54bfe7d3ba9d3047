"""A posture moved vertically until the figure's lowest segments stand on what is below them."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.postures import support


def grounded(model: pin.Model, segments: tuple[str, ...], q: Array, scene: Any, height: int) -> Array:
    """Copy (nq,) of a posture with the root's `height` such that its `segments` stand; see `Figure.grounded`."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    own, around = set(segments), set(scene.objects)
    pieces = list(zip(scene.geometry.geometryObjects, scene.piece_owner, strict=True))
    placed = [(piece.geometry, data.oMi[piece.parentJoint] * piece.placement, owner) for piece, owner in pieces]
    body = [
        (shape, place, -support(shape, place, np.array((0.0, 0.0, -1.0))))
        for shape, place, owner in placed
        if owner in own
    ]
    things = [
        (shape, coal.Transform3s(place.rotation, place.translation))
        for (shape, place, owner), (piece, _) in zip(placed, pieces, strict=True)
        if owner in around and piece.parentJoint == 0
    ]
    if not things or not body:
        raise InputError("grounded: there is nothing to stand on; add wb.HalfSpace() to the scene")
    bottom = min(low for *_, low in body)
    # m: segments that reach as low as this above the lowest point are those that stand
    soles = [(shape, place) for shape, place, low in body if low <= bottom + 0.03]
    shift = 0.0
    # most steps; each goes down by the least distance, so none goes through anything
    for _ in range(2000):
        gap = _least(soles, things, shift)
        if abs(gap) <= 1e-7:  # m: gap that counts as standing
            break
        shift -= gap  # into what it overlaps the figure is no deeper than that, so it comes out after a few steps
        if abs(shift) > 10.0:
            raise InputError("grounded: nothing is below the figure within 10 m; add wb.HalfSpace()")
    result = np.array(q, dtype=float)
    result[height] += shift
    return result


def _least(soles: list[tuple[Any, pin.SE3]], things: list[tuple[Any, Any]], shift: float) -> float:
    """Least signed distance of the soles from the things when the figure is higher by `shift`."""
    up, least = np.array((0.0, 0.0, shift)), np.inf
    for shape, place in soles:
        at = coal.Transform3s(place.rotation, place.translation + up)
        for thing, where in things:
            gap = coal.distance(shape, at, thing, where, coal.DistanceRequest(), coal.DistanceResult())
            least = min(least, float(gap))
    return least
