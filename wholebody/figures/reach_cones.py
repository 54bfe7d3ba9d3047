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

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError

PARALLEL = 1e-12  # shorter than this a projection onto the plane of an edge has no direction
SHORTEST = 1e-9  # a vector shorter than this has no direction
TOUCHING = 1e-9  # rad: a direction nearer to an edge than this is on it


class ReachCone:
    """Directions inside a spherical polygon.

    Attributes:
        vertices: (k, 3) unit corners, counter-clockwise seen from outside the sphere.
        visible: (3,) unit direction inside, from which every edge is seen.
        boundaries: (k, 3) boundary normals of the edges.
        planes: (5 k, 3) of the k edges, in this order: their boundary normals, the normals at their first and at their
            last corner, between which a direction is beside the edge, their first corners, and the normals S.

    Examples:
        >>> cone = human.cones["left_shoulder"].cone
    """

    def __init__(self, vertices: Any, visible: Any) -> None:
        """Check the polygon (three visible corners or more) and precompute its planes."""
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
        across = (np.cross(self.boundaries, self.vertices), np.cross(following, self.boundaries))
        sides = np.cross(self.visible, self.vertices)
        self.planes: Array = np.vstack([self.boundaries, *across, self.vertices, sides])

    def __repr__(self) -> str:
        return f"ReachCone({len(self.vertices)} corners)"

    def contains(self, direction: Any) -> bool:
        """Whether a direction (3,) is inside, on the edge included."""
        return self.signed_angle(direction)[0] >= 0.0

    def signed_angle(self, direction: Any) -> tuple[float, Array]:
        """Angle of a direction (3,) to the nearest edge, radians, positive inside, and its gradient (3,), a tangent."""
        direction = _unit(direction, "direction")
        if direction.shape != (3,):
            raise InputError(f"a direction has shape (3,), not {direction.shape}")
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
        if sine > TOUCHING:
            return sign * atan2(sine, cosine), (sign / sine) * away
        inward = self.boundaries[edge] - height[edge] * direction  # on the edge itself
        return sign * atan2(sine, cosine), inward / sqrt(inward @ inward)

    def mirrored(self) -> ReachCone:
        """Return the cone of the other side of the body: y negated."""
        flip = np.array([1.0, -1.0, 1.0])
        return ReachCone(self.vertices[::-1] * flip, self.visible * flip)


def _unit(vectors: Any, what: str) -> Array:
    vectors = np.asarray(vectors, dtype=float)
    if vectors.shape == (3,):
        length = sqrt(vectors @ vectors)  # constraints ask for one direction at a time
        if SHORTEST <= length < inf:
            return np.asarray(vectors / length)
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not np.isfinite(lengths).all() or (lengths < SHORTEST).any():
        raise InputError(f"a {what} is zero or not finite; give directions other than zero")
    return np.asarray(vectors / lengths)
