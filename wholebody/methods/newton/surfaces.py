"""A point of one body on the surface of another: the paper's point on a surface, for round and square surfaces."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.geometry.shapes import Box, Capsule, Shape, Sphere
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import OTHER_PLACE, OTHER_TURN, PLACE, TURN, Batch

CENTRAL = 1e-9  # m: nearer to the axis of a surface than this, every direction leads outwards


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
        inside = _turned_back(a[:, TURN], way) - self.centers
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
        normal = np.where((length > CENTRAL)[:, None], out / np.maximum(length, CENTRAL)[:, None], 0.0)
        within = np.flatnonzero(length <= CENTRAL)
        normal[within, beyond[within].argmax(axis=1)] = 1.0
        normal = np.einsum("kij,kj->ki", self.turns, normal * sign)  # in the first body
        first, second = x[self.bodies[:, 0], TURN], x[self.bodies[:, 1], TURN]
        push = quat.rotate(first, normal)
        result = np.zeros((len(self), 1, 14))
        result[:, 0, PLACE], result[:, 0, OTHER_PLACE] = -push, push
        result[:, 0, TURN] = np.einsum("ki,kij->kj", way, quat.rotate_derivative(first, normal))
        result[:, 0, OTHER_TURN] = np.einsum("ki,kij->kj", push, quat.rotate_derivative(second, self.points))
        return result


def _turned_back(e: Array, vector: Array) -> Array:
    return quat.rotate(quat.conjugate(e), vector)


def surface(shape: Shape, where: str) -> tuple[Array, float]:
    """Half sizes (3,) and radius of a shape's surface as that of a rounded box, metres.

    Raises:
        InputError: a shape of another kind.
    """
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
