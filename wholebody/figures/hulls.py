"""Convex polyhedra of round bodies: ellipsoids and tapered capsules with about a hundred triangles."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.hull import hull_piece

RINGS = 5
AROUND = 10
"""Rings of vertices between the poles, and vertices on each: 52 vertices, 2 * 5 * 10 = 100 triangles."""


@lru_cache(maxsize=1)
def unit_sphere() -> Array:
    """Vertices (n, 3) on the unit sphere, mirror-symmetric in y; turned rings, so that no four lie in one plane."""
    points = [np.array([0.0, 0.0, 1.0])]
    for ring in range(1, RINGS + 1):
        polar = np.pi * ring / (RINGS + 1)
        for k in range(AROUND):
            turn = 2.0 * np.pi * (k + 0.5 * (ring % 2)) / AROUND
            points.append(np.array([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]))
    points.append(np.array([0.0, 0.0, -1.0]))
    return np.array(points)


def _convex(points: Array, what: str) -> tuple[Any, pin.SE3]:
    """The hull of points (n, 3) as coal's Convex about the centre of its bounding sphere, and that centre."""
    piece = hull_piece(points, what)
    return piece.geometry, piece.placement


def ellipsoid(radii: tuple[float, float, float], what: str) -> tuple[Any, pin.SE3]:
    """Convex polyhedron with its vertices on an ellipsoid, axes along x, y, z, centre at the origin."""
    return _convex(unit_sphere() * np.array(radii), what)


def tapered(radius_start: float, radius_end: float, length: float, what: str) -> tuple[Any, pin.SE3]:
    """Convex polyhedron of a tapered capsule along -z: vertices on a ball at the origin and on one at -length."""
    ball = unit_sphere()
    return _convex(np.vstack([ball * radius_start, ball * radius_end - [0.0, 0.0, length]]), what)


def box(size: tuple[float, float, float], what: str) -> tuple[Any, pin.SE3]:
    """Convex polyhedron of a box about the origin: eight vertices, twelve triangles."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return _convex(corners * np.array(size), what)
