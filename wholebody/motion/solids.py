"""Solids of many pieces: the nearest place on them, their distance to shapes, and what is below a place.

A box about each piece tells which pieces coal need not be asked for, so that a scan of thousands is as fast as a table.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.pieces import box_corners

Placed: TypeAlias = tuple[coal.CollisionGeometry, pin.SE3]  # a shape, and where it is


def least_distance(first: Sequence[Placed], second: Sequence[Placed]) -> float:
    """Signed distance of two sets of shapes, metres."""
    best, request = np.inf, coal.DistanceRequest()
    for one, at in first:
        for other, there in second:
            ours, theirs = (coal.Transform3s(place.rotation, place.translation) for place in (at, there))
            best = min(best, float(coal.distance(one, ours, other, theirs, request, coal.DistanceResult())))
    return best


class Solid:
    """Pieces in the axes of one thing, or of the world."""

    def __init__(self, placed: Iterable[Placed]) -> None:
        self.placed = list(placed)
        boxes = np.array([_box(*each) for each in self.placed]).reshape(-1, 2, 3)
        self._low, self._high = boxes[:, 0], boxes[:, 1]

    def nearest(self, point: Array, within: float = np.inf) -> tuple[float, Array, Array]:
        """Signed distance of a point (3,), the nearest place on the surface, and its normal outwards."""
        best = np.inf, point, np.array([0.0, 0.0, 1.0])
        ball, request, result = coal.Sphere(1e-6), coal.DistanceRequest(), coal.DistanceResult()
        # in the middle of a shape, as a tracked ball's in a hand, no side is nearest: beside it one is
        beside = [coal.Transform3s(np.eye(3), place) for place in (point, point + 1e-5)]
        far = self._far(point, point)
        for number in np.argsort(far, kind="stable").tolist():
            if far[number] > max(min(within, best[0]), 0.0):  # inside of one piece, it may be deeper in another
                break
            shape, at = self.placed[number]
            where = coal.Transform3s(at.rotation, at.translation)
            for center in beside:
                result.clear()
                gap = float(coal.distance(shape, where, ball, center, request, result))
                normal = np.array(result.normal)
                if np.isfinite(normal).all() and normal.any():
                    if gap < best[0]:
                        best = gap, np.array(result.getNearestPoint1()), normal
                    break
        return best

    def distance(self, others: Sequence[Placed]) -> float:
        """Signed distance to shapes in the same axes, metres."""
        best = np.inf
        for other in others:
            far = self._far(*_box(*other))
            for number in np.argsort(far, kind="stable").tolist():
                if far[number] > max(best, 0.0):
                    break
                best = min(best, least_distance([other], [self.placed[number]]))
        return best

    def below(self, place: Array, deep: float) -> list[Placed]:
        """Pieces that a vertical line from a place (3,) down to so many metres below may meet."""
        margin = 1e-4  # m: a place so near to a piece is on it
        ends = np.array([place - (margin, margin, deep), place + margin])
        return [self.placed[number] for number in np.flatnonzero(self._far(*ends) == 0.0).tolist()]

    def _far(self, low: Array, high: Array) -> Array:
        """(k,) distance of the box about each piece from the box between two corners (3,), metres."""
        apart = np.maximum(np.maximum(self._low - high, low - self._high), 0.0)
        return np.asarray(np.sqrt(np.einsum("ki,ki->k", apart, apart)))


def _box(shape: coal.CollisionGeometry, at: pin.SE3) -> tuple[Array, Array]:
    """Least and greatest corner (3,) of a box about a shape; without end for a half-space."""
    corners = box_corners(shape)
    if np.abs(corners).max() > 1e100:
        return np.full(3, -np.inf), np.full(3, np.inf)
    turned = corners @ at.rotation.T + at.translation
    return turned.min(axis=0), turned.max(axis=0)
