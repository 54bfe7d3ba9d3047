"""Whether a triangle mesh is the surface of its convex hull, and whether it passes through itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Mask
from wholebody.geometry.broad_phase import box_pairs

FLAT = 1e-6  # share of a mesh's size: triangles nearer to the hull's surface are on it; float32 rounds by 1e-7


def is_convex(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether the triangles lie on the surface of their convex hull, and cover it.

    Order, orientation and repetition of vertices and triangles do not matter. False where the mesh is flat, or so large
    that this is not found quickly.

    Args:
        vertices: (n, 3), metres.
        faces: (m, 3).
    """
    from scipy.spatial import ConvexHull, QhullError

    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = float(np.ptp(corners, axis=(0, 1)).max())
    middle = corners[area > (FLAT * size) ** 2].mean(axis=1)
    if len(middle) < 4:
        return False
    try:
        hull = ConvexHull(vertices[np.unique(faces)])
    except QhullError:
        return False
    # triangles times faces of the hull; larger meshes are not asked, as that takes seconds
    if len(middle) * len(hull.equations) > 20_000_000:
        return False
    # triangles, which show of almost all meshes that they are not convex
    for some in (middle[:: max(1, len(middle) // 64)], middle):
        if not (_below(hull.equations, some) <= FLAT * size).all():
            return False
    # share of the hull's area that rounding may leave uncovered
    return _covered(corners, area) >= (1.0 - 1e-3) * float(hull.area)


def _below(equations: Array, points: Array) -> Array:
    """How far points (k, 3) are below the surface of a hull of faces (f, 4), metres."""
    return -np.asarray((points @ equations[:, :3].T + equations[:, 3]).max(axis=1))


def _covered(corners: Array, area: Array) -> float:
    """Area of triangles (m, 3, 3), repeated ones counted once."""
    size = float(np.ptp(corners, axis=(0, 1)).max()) or 1.0
    rounded = np.round(corners / (FLAT * size))
    order = np.lexsort(rounded.transpose(2, 0, 1)[::-1], axis=1)
    rounded = np.take_along_axis(rounded, order[:, :, None], axis=1)
    first = np.unique(rounded.reshape(-1, 9), axis=0, return_index=True)[1]
    return 0.5 * float(area[first].sum())


def passes_through_itself(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether an edge of some triangle goes through the inside of another one; common corners do not count.

    Args:
        vertices: (n, 3), metres.
        faces: (m, 3).
    """
    corners = vertices[faces]
    pairs = box_pairs(corners.min(axis=1), corners.max(axis=1))
    for one, other in ((pairs[:, 0], pairs[:, 1]), (pairs[:, 1], pairs[:, 0])):
        for start, end in ((0, 1), (1, 2), (2, 0)):
            ends = faces[one][:, [start, end]]
            apart = ~(ends[:, :, None] == faces[other][:, None, :]).any(axis=(1, 2))
            if _crossing(vertices[ends[apart]], corners[other[apart]]).any():
                return True
    return False


def _crossing(edges: Array, triangles: Array) -> Mask:
    """Whether edges (k, 2, 3) cross the inside of triangles (k, 3, 3); Moeller and Trumbore (1997)."""
    inside = 1e-9  # shares of edge and triangle within which a crossing is at their rim
    along = edges[:, 1] - edges[:, 0]
    u_side, v_side = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    across = np.cross(along, v_side)
    determinant = (u_side * across).sum(axis=1)
    scale = np.linalg.norm(along, axis=1) * np.linalg.norm(u_side, axis=1) * np.linalg.norm(v_side, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        from_corner = edges[:, 0] - triangles[:, 0]
        u = (from_corner * across).sum(axis=1) / determinant
        turned = np.cross(from_corner, u_side)
        v = (along * turned).sum(axis=1) / determinant
        share = (v_side * turned).sum(axis=1) / determinant
        rim = 1.0 - inside - u - v
    crossing = (u > inside) & (v > inside) & (rim > 0.0) & (share > inside) & (share < 1.0 - inside)
    return np.asarray(crossing & (np.abs(determinant) > 1e-12 * scale))
