"""Reach cones: the allowed directions of a limb, as a polygon on the sphere.

Wilhelms & Van Gelder, Fast and Easy Reach-Cone Joint Limits, Journal of Graphics Tools 6(2), 2001. The polygon is
star-shaped about a visible point V: the planes through V and each vertex P_i cut the sphere into wedges, and exactly
one wedge contains a direction L: ``S_i . L >= 0 > S_{i+1} . L`` with ``S_i = V x P_i``. L is inside iff ``B_i . L >=
0`` with the boundary normal ``B_i = P_i x P_{i+1}``. The polygon may be concave and larger than a hemisphere.
"""

from __future__ import annotations

from math import atan2, inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError

PARALLEL = 1e-12  # shorter than this a projection onto the plane of an edge has no direction
SHORTEST = 1e-9  # a vector shorter than this has no direction
TOUCHING = 1e-9  # rad: a direction nearer to an edge than this is on it


class ReachCone:
    """Directions inside a spherical polygon; unit vectors, alone (3,) or in rows (n, 3).

    Attributes:
        vertices: (k, 3) unit corners, counter-clockwise seen from outside the sphere.
        visible: (3,) unit direction inside, from which every edge is seen.
        planes: (5 k, 3) of the k edges, in this order: their boundary normals, the normals at their first and at their
            last corner, between which a direction is beside the edge, their first corners, and the normals S.
    """

    def __init__(self, vertices: Any, visible: Any) -> None:
        """Check the polygon and precompute its planes.

        Raises:
            InputError: fewer than three corners, a zero or non-finite direction, or an edge hidden from `visible`.
        """
        self.vertices, self.visible = _unit(vertices, "reach cone corner"), _unit(visible, "visible point")
        if self.vertices.ndim != 2 or len(self.vertices) < 3 or self.visible.shape != (3,):
            raise InputError(
                "a reach cone needs at least three corners, shape (k, 3), and one visible point, shape (3,)"
            )
        following = np.roll(self.vertices, -1, axis=0)
        normals = np.cross(self.vertices, following)
        if (normals @ self.visible < 0.0).all():
            self.vertices = self.vertices[::-1].copy()
            following = np.roll(self.vertices, -1, axis=0)
            normals = np.cross(self.vertices, following)
        lengths = np.linalg.norm(normals, axis=1)
        if lengths.min() < 1e-9 or (normals @ self.visible <= 0.0).any():
            raise InputError(
                "every edge of a reach cone must be seen from its visible point; move that point or the corners"
            )
        self.boundaries: Array = normals / lengths[:, None]
        self._slices = np.cross(self.visible, self.vertices)
        self._following = following
        across = (np.cross(self.boundaries, self.vertices), np.cross(following, self.boundaries))
        self.planes: Array = np.vstack([self.boundaries, *across, self.vertices, self._slices])

    def contains(self, direction: Any) -> Any:
        """Whether directions are inside, on the edge included: bool, or (n,) bools."""
        one, rows = _rows(direction)
        inside = self._inside(rows)
        return bool(inside[0]) if one else inside

    def project(self, direction: Any) -> Array:
        """Return the nearest directions of the cone, shape as given; a direction inside stays as it is."""
        one, rows = _rows(direction)
        nearest = np.where(self._inside(rows)[:, None], rows, self._nearest_on_edge(rows))
        return nearest[0] if one else nearest

    def signed_angle(self, direction: Any) -> tuple[Any, Array]:
        """Return the angle to the nearest edge, radians, positive inside, and its gradient on the sphere.

        A rotation of the direction by a small vector w, ``L + w x L``, changes the angle by ``gradient . (w x L)``; the
        gradient is tangent to the sphere and of length 1, except where the nearest edge changes.

        Returns:
            (angle, gradient): float and (3,), or (n,) and (n, 3).
        """
        if type(direction) is np.ndarray and direction.shape == (3,):
            length = sqrt(direction @ direction)
            if SHORTEST <= length < inf:
                return self._signed_angle_of_one(direction / length)
        one, rows = _rows(direction)
        if one:
            return self._signed_angle_of_one(rows[0])
        edge = self._nearest_on_edge(rows)
        inside = np.where(self._inside(rows), 1.0, -1.0)
        sine = np.linalg.norm(np.cross(rows, edge), axis=1)
        cosine = np.einsum("ij,ij->i", rows, edge)
        angle = inside * np.arctan2(sine, cosine)
        # Away from the nearest edge point, along the great circle; on the edge itself, into the cone.
        away = cosine[:, None] * rows - edge
        length = np.linalg.norm(away, axis=1)
        away = np.divide(
            inside[:, None] * away, length[:, None], out=np.zeros_like(rows), where=length[:, None] > TOUCHING
        )
        touching = length <= TOUCHING
        if touching.any():
            away[touching] = self._inward(rows[touching])
        return angle, away

    def _signed_angle_of_one(self, direction: Array) -> tuple[float, Array]:
        """The same for one direction in a tenth of the time: constraints evaluate one limb at a time."""
        height, before, after, corner, side = (self.planes @ direction).reshape(5, -1).tolist()
        edge, following, nearness, crossed = 0, 0, -inf, 0
        last = len(height) - 1
        for k in range(last, -1, -1):  # downwards: of edges that are equally near the first counts
            beyond = k + 1 if k < last else 0
            if before[k] >= 0.0 and after[k] >= 0.0:
                near = sqrt(max(1.0 - height[k] * height[k], 0.0))
            else:
                near = max(corner[k], corner[beyond])
            if near >= nearness:
                edge, following, nearness = k, beyond, near
            if side[k] >= 0.0 and side[beyond] < 0.0:
                crossed = k
        if before[edge] >= 0.0 and after[edge] >= 0.0 and nearness > PARALLEL:
            nearest = direction - height[edge] * self.boundaries[edge]
            nearest /= sqrt(nearest @ nearest)
        else:
            nearest = self.vertices[following if corner[following] > corner[edge] else edge]
        sign = 1.0 if height[crossed] >= 0.0 else -1.0
        cosine = float(direction @ nearest)
        away = cosine * direction - nearest
        sine = sqrt(away @ away)
        gradient = (sign / sine) * away if sine > TOUCHING else self._inward(direction[None])[0]
        return sign * atan2(sine, cosine), gradient

    def mirrored(self) -> ReachCone:
        """Return the cone of the other side of the body: y negated."""
        flip = np.array([1.0, -1.0, 1.0])
        return ReachCone(self.vertices[::-1] * flip, self.visible * flip)

    def _inside(self, rows: Array) -> NDArray[np.bool_]:
        side = rows @ self._slices.T
        wedge = (side >= 0.0) & (np.roll(side, -1, axis=1) < 0.0)
        # Around V and -V rounding may find no wedge; there every boundary gives the same answer, so the first one does.
        boundary = self.boundaries[np.argmax(wedge, axis=1)]
        return np.asarray(np.einsum("ij,ij->i", rows, boundary) >= 0.0)

    def _nearest_on_edge(self, rows: Array) -> Array:
        """Nearest point of the boundary, (n, 3)."""
        start, end, normal = self.vertices, self._following, self.boundaries
        height = rows @ normal.T
        on_circle = rows[:, None, :] - height[:, :, None] * normal
        length = np.linalg.norm(on_circle, axis=2, keepdims=True)
        on_circle = np.where(length > PARALLEL, on_circle / np.maximum(length, PARALLEL), start)
        within = (np.einsum("nki,ki->nk", on_circle, np.cross(normal, start)) >= 0.0) & (
            np.einsum("nki,ki->nk", on_circle, np.cross(end, normal)) >= 0.0
        )
        nearer_end = rows @ end.T > rows @ start.T
        ends = np.where(nearer_end[:, :, None], end, start)
        candidates = np.where(within[:, :, None], on_circle, ends)
        best = np.argmin(((candidates - rows[:, None, :]) ** 2).sum(axis=2), axis=1)
        return np.asarray(candidates[np.arange(len(rows)), best])

    def _inward(self, rows: Array) -> Array:
        nearest = np.argmin(np.abs(rows @ self.boundaries.T), axis=1)
        inward = self.boundaries[nearest] - np.einsum("ij,ij->i", rows, self.boundaries[nearest])[:, None] * rows
        return np.asarray(inward / np.linalg.norm(inward, axis=1)[:, None])


def _rows(direction: Any) -> tuple[bool, Array]:
    unit = _unit(direction, "direction")
    if unit.ndim not in (1, 2) or unit.shape[-1] != 3:
        raise InputError(f"a direction has shape (3,) or (n, 3), not {unit.shape}")
    return unit.ndim == 1, np.atleast_2d(unit)


def _unit(vectors: Any, what: str) -> Array:
    vectors = np.asarray(vectors, dtype=float)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not np.isfinite(length).all() or (length < SHORTEST).any():
        raise InputError(f"a {what} is zero or not finite; give directions other than zero")
    return np.asarray(vectors / length)
