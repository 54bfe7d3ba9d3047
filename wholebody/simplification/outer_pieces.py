"""Pieces with fewer corners, each of which holds the piece that it stands for."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.geometry.convex import hull_piece
from wholebody.geometry.outer_hull import outer_hull
from wholebody.geometry.proximity import COAL_ACCURACY

Array = NDArray[np.float64]

FEW = 16  # corners: pieces with no more are as quick as a box
CORNERS = (8, 12, 16, 24, 32, 48)  # tried in turn
PROBE = 1e-4  # m: radius of the ball that stands for a point in coal


def coarser(piece: pin.GeometryObject, growth: float) -> tuple[pin.GeometryObject, float] | None:
    """A piece with fewer corners around a hull.

    Args:
        piece: any piece.
        growth: how far out of the hull the new one may reach, metres.

    Returns:
        The piece and how far it reaches out at most; None where the piece has few corners, or needs them.
    """
    if not isinstance(piece.geometry, coal.Convex):
        return None
    points = np.array(piece.geometry.points())
    for corners in CORNERS:
        if len(points) <= max(FEW, corners):
            return None
        outer = outer_hull(points, corners)
        out = farthest(outer, piece.geometry)
        if out <= growth:
            made = hull_piece(outer, piece.name)
            coarse = pin.GeometryObject(
                piece.name, piece.parentJoint, piece.parentFrame, piece.placement * made.placement, made.geometry
            )
            coarse.meshColor[:] = piece.meshColor
            return coarse, out
    return None


def farthest(points: Array, hull: coal.Convex) -> float:
    """How far a polytope with these corners, (n, 3), reaches out of a hull: the distance is convex, so a corner's."""
    probe, here, request = coal.Sphere(PROBE), coal.Transform3s.Identity(), coal.DistanceRequest()
    out = 0.0
    for point in points:
        there = coal.Transform3s(np.eye(3), point)
        # a result of its own: coal keeps the least of all that one has seen
        out = max(out, float(coal.distance(hull, here, probe, there, request, coal.DistanceResult())) + PROBE)
    return out + COAL_ACCURACY
