"""A simpler hull around a hull, with fewer vertices.

Dropping vertices would leave parts of the surface uncovered, and a posture could be free of contact and still inside.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.geometry.pieces import SMALLEST

SAME_NORMAL = 0.02
"""Radians: of faces whose normals differ by less, only one is tried."""


def simplified_hull(points: Array, max_vertices: int) -> Array:
    """Vertices of a convex polytope that contains points and has few vertices.

    The polytope begins as a box along the points' principal axes. Planes of the points' own hull then cut it: each time
    the plane that cuts most off the farthest protruding vertex, as long as the number of vertices allows.

    Args:
        points: (n, 3), enclosing a volume.
        max_vertices: most vertices, at least 8.

    Returns:
        (k, 3) vertices; those of the points' hull if they are few enough.
    """
    from scipy.spatial import ConvexHull, QhullError

    hull = ConvexHull(points)
    corners = points[hull.vertices]
    if len(corners) <= max_vertices:
        return np.asarray(corners)
    inside = corners.mean(axis=0)
    axes = np.linalg.svd(corners - inside, full_matrices=False)[2]
    box = np.vstack([axes, -axes])
    planes = np.column_stack([box, -(corners @ box.T).max(axis=0)])
    best = _vertices(planes, inside)
    faces = _apart(hull.equations)
    for _ in range(len(faces)):
        outside = best @ faces[:, :3].T + faces[:, 3]
        vertex, plane = np.unravel_index(int(outside.argmax()), outside.shape)
        if outside[vertex, plane] < SMALLEST:
            break
        planes = np.vstack([planes, faces[plane]])
        try:
            trial = _vertices(planes, inside)
        except QhullError:  # nearly coincident planes: the present polytope already contains the points
            break
        if len(trial) > max_vertices:
            break
        best = trial
    return np.asarray(best)


def _apart(equations: Array) -> Array:
    """Of thousands of faces, those whose normals differ: a rounded edge of a part in CAD has hundreds."""
    if len(equations) <= 1000:  # Number of faces above which only some are tried.
        return equations
    _, first = np.unique(np.round(equations[:, :3] / SAME_NORMAL), axis=0, return_index=True)
    return np.asarray(equations[np.sort(first)])


def _vertices(planes: Array, inside: Array) -> Array:
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    found = HalfspaceIntersection(planes, inside).intersections
    return np.asarray(found[ConvexHull(found).vertices])
