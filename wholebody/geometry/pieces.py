"""Convex pieces, between which coal computes distances, and the sizes for which coal is reliable."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array

SMALLEST = 1e-4
"""Least extent of a piece, metres: below 1e-5 m coal reads gaps as zero, and at 1e-6 m it loses the depth."""

COAL_ACCURACY = 1e-6  # m: of coal's distances

ENDLESS = 1e9  # m: what counts for the reach of a half-space, and half the size of its box

LARGEST = 1e4
"""Greatest extent of a piece, metres: coal's distances are still right to micrometres there."""


class Piece(NamedTuple):
    """One convex piece of a shape.

    Attributes:
        geometry: coal's Box, Sphere, Capsule, Ellipsoid, Convex or Halfspace; its origin is the centre of
            its bounding sphere.
        placement: of the geometry's origin in the shape.
        volume: cubic metres; infinite for a half-space.
    """

    geometry: Any
    placement: pin.SE3
    volume: float


def box_corners(geometry: Any) -> Array:
    """Corners (8, 3) of the axis-aligned box around a coal shape in its own axes, metres; endless for a half-space.

    coal writes the box into the shape. So it is computed of a copy: the shape is part of a scene, whose pickles would
    change, and an endless box cannot be read from one.
    """
    own = geometry.clone()
    own.computeLocalAABB()
    sides = np.array([own.aabb_local.min_, own.aabb_local.max_])
    return np.array([[sides[x, 0], sides[y, 1], sides[z, 2]] for x, y, z in np.ndindex(2, 2, 2)])
