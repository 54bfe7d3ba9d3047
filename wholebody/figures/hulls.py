"""Convex polyhedra of round bodies: ellipsoids and tapered capsules with about a hundred triangles."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RINGS = 6
AROUND = 10
"""Rings of vertices between the poles, and vertices on each: 62 vertices, 2 * 6 * 10 = 120 triangles."""


def unit_sphere(rings: int = RINGS, around: int = AROUND) -> tuple[Array, NDArray[np.intp]]:
    """Return vertices (n, 3) on the unit sphere, mirror-symmetric in y, and triangles (m, 3) seen from outside.

    Every second ring is turned by half a step, so that no four vertices of the sides lie in one plane.
    """
    points = [np.array([0.0, 0.0, 1.0])]
    for ring in range(1, rings + 1):
        polar = np.pi * ring / (rings + 1)
        for k in range(around):
            turn = 2.0 * np.pi * (k + 0.5 * (ring % 2)) / around
            points.append(np.array([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]))
    points.append(np.array([0.0, 0.0, -1.0]))
    vertices = np.array(points)
    return vertices, _outward_triangles(vertices)


def convex(points: Array) -> Any:
    """Return coal's Convex of the hull of solid points (n, 3).

    The triangles come from scipy: coal's own hull ends the process on points in one plane.

    Raises:
        scipy.spatial.QhullError: the points lie in one plane.
    """
    triangles = _outward_triangles(points)
    used, renumbered = np.unique(triangles, return_inverse=True)
    vertices, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    vertices.extend(list(points[used]))
    faces.extend([coal.Triangle(*map(int, face)) for face in renumbered.reshape(-1, 3)])
    return coal.Convex(vertices, faces)


def ellipsoid(radii: tuple[float, float, float]) -> Any:
    """Convex polyhedron with its vertices on an ellipsoid, axes along x, y, z."""
    return convex(unit_sphere()[0] * np.array(radii))


def tapered(radius_start: float, radius_end: float, length: float) -> tuple[Any, float]:
    """Convex polyhedron of a tapered capsule along -z: a ball at the origin and one at -length, vertices on the balls.

    Returns:
        The polyhedron about the centre of its box, and the z of that centre.
    """
    ball = unit_sphere()[0]
    points = np.vstack([ball * radius_start, ball * radius_end - [0.0, 0.0, length]])
    middle = 0.5 * float(points[:, 2].max() + points[:, 2].min())
    return convex(points - [0.0, 0.0, middle]), middle


def box(size: tuple[float, float, float]) -> Any:
    """Convex polyhedron of a box: eight vertices, twelve triangles."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return convex(corners * np.array(size))


def _outward_triangles(points: Array) -> NDArray[np.intp]:
    """Triangles (m, 3) of the hull of points, counter-clockwise seen from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    triangles = np.array(hull.simplices, dtype=np.intp)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    return triangles
