"""Equations that no joint has: the centre of mass, directions, reach cones, surfaces, and the motion of a root."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.geometry.shapes import Box, Capsule, Shape, Sphere
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import OTHER_PLACE, OTHER_TURN, PLACE, TURN, Batch


class MassCenter(Batch):
    """The centre of mass along directions: n . sum_j s_j (r_j + R_j c_j) - h = 0, with s_j the bodies' shares of mass.

    One group of equations of all bodies with mass. As an inequality it keeps the centre of mass above a polygon.
    """

    def __init__(
        self, bodies: Indices, labels: list[str], shares: Array, centers: Array, directions: Array, height: Array
    ) -> None:
        """Take bodies (1, b), shares (b,), centers (b, 3) in the bodies, directions (m, 3) and heights (m,) [m]."""
        super().__init__(bodies, labels)
        self.size = len(directions)
        self.shares, self.centers, self.directions, self.height = shares, centers, directions, height
        along = (directions != 0.0)[:, None, :].repeat(bodies.shape[1], axis=1)
        self.pattern = np.concatenate([along, np.ones((*along.shape[:2], 4), dtype=bool)], axis=2).reshape(
            self.size, -1
        )

    def residual(self, x: Array) -> Array:  # noqa: D102
        pair = x[self.bodies[0]]
        center = self.shares @ (pair[:, PLACE] + quat.rotate(pair[:, TURN], self.centers))
        result: Array = (self.directions @ center - self.height)[None]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        turns = x[self.bodies[0]][:, TURN]
        result = np.empty((1, self.size, len(turns), 7))
        result[0, :, :, PLACE] = self.directions[:, None, :] * self.shares[:, None]
        slopes = self.shares[:, None, None] * quat.rotate_derivative(turns, self.centers)  # (b, 3, 4)
        result[0, :, :, TURN] = np.einsum("mi,bij->mbj", self.directions, slopes)
        return result.reshape(1, self.size, -1)


class RootMotion(Batch):
    """Displacement of a free root from a posture, in its own axes there, less a target; linear in the body.

    Three rows are R_a' (r - r_a), three are 2 vec(conj(e_a) e). At r = r_a and e = e_a their derivative is that of
    Pinocchio's tangent displacement.
    """

    size = 6
    pattern = np.zeros((6, 7), dtype=bool)
    pattern[:3, PLACE] = pattern[3:, TURN] = True

    def __init__(self, body: int, label: str) -> None:
        """Take the number of the root's body; `anchor` says from where it moves."""
        super().__init__(np.array([[body]]), [label])
        self._place, self._target, self._slope = np.zeros(3), np.zeros(6), np.zeros((6, 7))

    def anchor(self, root: Array, target: Array) -> None:
        """Count from the root's placement (7,), position and quaternion x, y, z, w, towards a displacement (6,)."""
        a, b, c, w = root[3:].tolist()
        self._place, self._target = root[:3].copy(), target
        self._slope[:3, PLACE] = pin.Quaternion(root[3:]).toRotationMatrix().T
        self._slope[3:, TURN] = 2.0 * np.array(((w, c, -b, -a), (-c, w, a, -b), (b, -a, w, -c)))

    def residual(self, x: Array) -> Array:  # noqa: D102
        body = x[self.bodies[0, 0]]
        turned = self._slope[3:, TURN] @ body[TURN]
        moved = self._slope[:3, PLACE] @ (body[PLACE] - self._place)
        result: Array = np.concatenate([moved, turned])[None] - self._target
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result: Array = self._slope[None].copy()
        return result


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
        # within a micrometre of the point every direction counts as right
        distance = np.maximum(np.sqrt((local * local).sum(axis=1)), 1e-6)
        unit = np.einsum("kij,kj->ki", self.axes, local) / distance[:, None]
        # nearer to the opposite direction the error is constant
        return unit, distance, np.sqrt(2.0 / np.maximum(1.0 + unit[:, 2], 1e-6)), way

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
        local[:, :, TURN] = quat.rotate_derivative(turn, way) * quat.CONJUGATE
        change = np.einsum("kij,kjl->kil", self.axes, local)
        change -= unit[:, :, None] * np.einsum("ki,kil->kl", unit, change)[:, None, :]
        change /= distance[:, None, None]
        fall = -0.5 * factor / np.maximum(1.0 + unit[:, 2], 1e-6)
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

    def _angles(self, x: Array) -> tuple[Array, ...]:
        """Axes (k, 3) in the world and as units in the polygons' frames, lengths (k, 1) there; angles and slopes."""
        if self._seen is None or self._seen[0] is not x:
            first, second = x[self.bodies[:, 0], TURN], x[self.bodies[:, 1], TURN]
            world = quat.rotate(second, self.axes)
            local = np.einsum("kji,kj->ki", self.turns, quat.rotate(quat.conjugate(first), world))
            length = np.sqrt((local * local).sum(axis=1, keepdims=True))
            unit = local / length
            found = [cone.signed_angle(axis) for cone, axis in zip(self.cones, unit, strict=True)]
            angles, slopes = (np.array(part).reshape(len(self), -1) for part in zip(*found, strict=True))
            self._seen = x, world, unit, length, angles, slopes
        return self._seen[1:]

    def residual(self, x: Array) -> Array:  # noqa: D102
        return self._angles(x)[3]

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        first, second = quat.conjugate(x[self.bodies[:, 0], TURN]), x[self.bodies[:, 1], TURN]
        world, unit, length, _, slopes = self._angles(x)
        slopes = (slopes - (slopes * unit).sum(axis=1, keepdims=True) * unit) / length
        slopes = np.einsum("kij,kj->ki", self.turns, slopes)  # by the axis in the first body
        result = np.zeros((len(self), 1, 14))
        result[:, 0, TURN] = np.einsum("ki,kij->kj", slopes, quat.rotate_derivative(first, world)) * quat.CONJUGATE
        back = quat.rotate(x[self.bodies[:, 0], TURN], slopes)
        result[:, 0, OTHER_TURN] = np.einsum("ki,kij->kj", back, quat.rotate_derivative(second, self.axes))
        return result


class OnSurface(Batch):
    """The signed distance of a point of the second body to a rounded box that is fixed to the first body [m].

    A box of half sizes h, all points within the radius r of it: the distance of the local point p is
    |max(|p| - h, 0)| + min(max_i(|p_i| - h_i), 0) - r. With h = 0 it is a sphere, with h along z a capsule, with r = 0
    a box. Its derivative is the unit normal n of the nearest surface point.
    """

    size = 1
    pattern = np.ones((1, 14), dtype=bool)

    def __init__(
        self,
        bodies: Indices,
        labels: list[str],
        turns: Array,
        centers: Array,
        half: Array,
        radius: Array,
        points: Array,
    ) -> None:
        """Take surfaces by axes (k, 3, 3), centers (k, 3), half sizes (k, 3) and radii (k,); points (k, 3)."""
        super().__init__(bodies, labels)
        self.turns, self.centers, self.half, self.radius, self.points = turns, centers, half, radius, points

    def _local(self, x: Array) -> tuple[Array, Array]:
        """(k, 3) the points in the surfaces' axes, and from the first body's origin to them in the world."""
        a, b = x[self.bodies[:, 0]], x[self.bodies[:, 1]]
        way = b[:, PLACE] + quat.rotate(b[:, TURN], self.points) - a[:, PLACE]
        inside = quat.rotate(quat.conjugate(a[:, TURN]), way) - self.centers
        return np.einsum("kji,kj->ki", self.turns, inside), way

    def residual(self, x: Array) -> Array:  # noqa: D102
        local, _ = self._local(x)
        beyond = np.abs(local) - self.half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        result: Array = (outside + np.minimum(beyond.max(axis=1), 0.0) - self.radius)[:, None]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        local, way = self._local(x)
        beyond, sign = np.abs(local) - self.half, np.where(local < 0.0, -1.0, 1.0)
        out = np.maximum(beyond, 0.0)
        length = np.linalg.norm(out, axis=1)
        central = 1e-9  # m: nearer to the axis of a surface every direction leads outwards
        normal = np.where((length > central)[:, None], out / np.maximum(length, central)[:, None], 0.0)
        within = np.flatnonzero(length <= central)
        normal[within, beyond[within].argmax(axis=1)] = 1.0
        normal = np.einsum("kij,kj->ki", self.turns, normal * sign)  # in the first body
        first, second = x[self.bodies[:, 0], TURN], x[self.bodies[:, 1], TURN]
        push = quat.rotate(first, normal)
        result = np.zeros((len(self), 1, 14))
        result[:, 0, PLACE], result[:, 0, OTHER_PLACE] = -push, push
        result[:, 0, TURN] = np.einsum("ki,kij->kj", way, quat.rotate_derivative(first, normal))
        result[:, 0, OTHER_TURN] = np.einsum("ki,kij->kj", push, quat.rotate_derivative(second, self.points))
        return result


def surface(shape: Shape, where: str) -> tuple[Array, float]:
    """Half sizes (3,) and radius of a shape's surface as that of a rounded box, metres."""
    if isinstance(shape, Sphere):
        return np.zeros(3), shape.radius
    if isinstance(shape, Capsule):
        return np.array((0.0, 0.0, 0.5 * shape.length)), shape.radius
    if isinstance(shape, Box):
        return 0.5 * np.array(shape.size), 0.0
    raise InputError(
        f"{where}: a point stays on the surface of a box, a sphere or a capsule, not of a {type(shape).__name__}; "
        "use on_plane for one of its faces"
    )
