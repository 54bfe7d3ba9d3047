"""Directions of bodies: towards a point in the world, and inside a reach cone."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import OTHER_TURN, PLACE, TURN, Batch

OPPOSITE = 1e-6  # least value of 1 + cosine: nearer to the opposite direction the error is constant
TOUCHING = 1e-6  # m: nearer to the point than this every direction counts as right
CONJUGATE = np.array((-1.0, -1.0, -1.0, 1.0))


class Toward(Batch):
    """An axis of a body points to a point: x and y of u sqrt(2 / (1 + z)), u the unit vector to it, the axis being z.

    Their norm is 2 sin(angle / 2), to first order the angle [rad]. It is largest at the opposite direction, which is no
    solution: Lambert's azimuthal equal-area projection (Snyder 1987, "Map Projections: A Working Manual", chapter 24).
    """

    size = 2
    pattern = np.ones((2, 7), dtype=bool)

    def __init__(self, bodies: Indices, labels: list[str], axes: Array, points: Array, places: Array) -> None:
        """Take axes (k, 3, 3) as rows in the body, the third one points; points (k, 3) in the body; targets (k, 3)."""
        super().__init__(bodies, labels)
        self.axes, self.points, self.places = axes, points, places

    def _way(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Unit vectors (k, 3) to the targets in the axes, distances (k,), factors (k,), vectors (k, 3) in the world."""
        body = x[self.bodies[:, 0]]
        way = self.places - body[:, PLACE]
        local = quat.rotate(quat.conjugate(body[:, TURN]), way) - self.points
        distance = np.maximum(np.sqrt((local * local).sum(axis=1)), TOUCHING)
        unit = np.einsum("kij,kj->ki", self.axes, local) / distance[:, None]
        return unit, distance, np.sqrt(2.0 / np.maximum(1.0 + unit[:, 2], OPPOSITE)), way

    def residual(self, x: Array) -> Array:  # noqa: D102
        unit, _, factor, _ = self._way(x)
        result: Array = factor[:, None] * unit[:, :2]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        unit, distance, factor, way = self._way(x)
        turn = quat.conjugate(x[self.bodies[:, 0], TURN])
        local = np.empty((len(self), 3, 7))
        for column in range(3):
            local[:, :, column] = -quat.rotate(turn, np.broadcast_to(np.eye(3)[column], way.shape))
        local[:, :, TURN] = quat.rotate_derivative(turn, way) * CONJUGATE
        change = np.einsum("kij,kjl->kil", self.axes, local)
        change -= unit[:, :, None] * np.einsum("ki,kil->kl", unit, change)[:, None, :]
        change /= distance[:, None, None]
        fall = -0.5 * factor / np.maximum(1.0 + unit[:, 2], OPPOSITE)
        result: Array = factor[:, None, None] * change[:, :2]
        result += (fall[:, None] * unit[:, :2])[:, :, None] * change[:, 2:]
        return result


class Cone(Batch):
    """A direction of one body inside a spherical polygon fixed to another: the angle to its nearest edge [rad]."""

    size = 1
    pattern = np.array([([False] * 3 + [True] * 4) * 2])

    def __init__(self, bodies: Indices, labels: list[str], cones: list[Any], turns: Array, axes: Array) -> None:
        """Take cones (`signed_angle`), their orientations (k, 3, 3) in the first body, axes (k, 3) in the second."""
        super().__init__(bodies, labels)
        self.cones, self.turns, self.axes = cones, turns, axes

    def _directions(self, x: Array) -> tuple[Array, Array]:
        """(k, 3) the axes in the world and in the polygons' frames."""
        first, second = x[self.bodies[:, 0], TURN], x[self.bodies[:, 1], TURN]
        world = quat.rotate(second, self.axes)
        return world, np.einsum("kji,kj->ki", self.turns, quat.rotate(quat.conjugate(first), world))

    def residual(self, x: Array) -> Array:  # noqa: D102
        _, local = self._directions(x)
        angles = [cone.signed_angle(_unit(axis))[0] for cone, axis in zip(self.cones, local, strict=True)]
        return np.array(angles)[:, None]

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        first, second = quat.conjugate(x[self.bodies[:, 0], TURN]), x[self.bodies[:, 1], TURN]
        world, local = self._directions(x)
        slopes = np.empty((len(self), 3))
        for k, (cone, axis) in enumerate(zip(self.cones, local, strict=True)):
            unit = _unit(axis)
            slope = np.asarray(cone.signed_angle(unit)[1])
            slopes[k] = (slope - (slope @ unit) * unit) / np.sqrt(axis @ axis)
        slopes = np.einsum("kij,kj->ki", self.turns, slopes)  # by the axis in the first body
        result = np.zeros((len(self), 1, 14))
        result[:, 0, TURN] = np.einsum("ki,kij->kj", slopes, quat.rotate_derivative(first, world)) * CONJUGATE
        back = quat.rotate(x[self.bodies[:, 0], TURN], slopes)
        result[:, 0, OTHER_TURN] = np.einsum("ki,kij->kj", back, quat.rotate_derivative(second, self.axes))
        return result


def _unit(vector: Array) -> Array:
    result: Array = vector / np.sqrt(vector @ vector)
    return result
