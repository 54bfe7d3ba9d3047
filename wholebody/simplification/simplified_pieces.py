"""Pieces with fewer corners, each of which contains the original piece."""

from __future__ import annotations

from functools import lru_cache

import coal
import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.geometry.hull import hull_piece
from wholebody.geometry.pieces import Piece
from wholebody.geometry.proximity import COAL_ACCURACY
from wholebody.geometry.simplified_hull import simplified_hull

FEW = 64  # corners: simplifying pieces with at most as many saves no measurable time
CORNERS = (8, 16, 32, 48)  # tried in turn
PROBE = 1e-4  # m: radius of the ball that represents a point in coal


def simplified_piece(piece: pin.GeometryObject, growth: float) -> tuple[pin.GeometryObject, float] | None:
    """A piece with fewer corners around a hull.

    Args:
        piece: any piece.
        growth: how far the new piece may protrude from the hull, metres.

    Returns:
        The piece and how far it protrudes at most; None if the piece has few corners, or cannot be simplified.
    """
    if not isinstance(piece.geometry, coal.Convex):
        return None
    points = np.array(piece.geometry.points())
    if len(points) <= FEW:
        return None
    found = _around(points.tobytes(), growth)
    if found is None:
        return None
    made, out = found
    coarse = pin.GeometryObject(
        piece.name, piece.parentJoint, piece.parentFrame, piece.placement * made.placement, made.geometry
    )
    coarse.meshColor[:] = piece.meshColor
    return coarse, out


@lru_cache(maxsize=256)
def _around(corners: bytes, growth: float) -> tuple[Piece, float] | None:
    """The simplest hull around these corners that protrudes no farther, and how far it does."""
    points = np.frombuffer(corners).reshape(-1, 3)
    whole = hull_piece(points)
    for most in CORNERS:
        outer = simplified_hull(points, most)
        out = farthest(outer - whole.placement.translation, whole.geometry)
        if out <= growth:
            return hull_piece(outer), out
    return None


def farthest(points: Array, hull: coal.Convex) -> float:
    """How far a polytope with these corners, (n, 3), protrudes from a hull: the distance is convex, so a corner's."""
    probe, here, request = coal.Sphere(PROBE), coal.Transform3s.Identity(), coal.DistanceRequest()
    out = 0.0
    for point in points:
        there = coal.Transform3s(np.eye(3), point)
        # a new result for each query: coal keeps the least distance of all queries of one result
        out = max(out, float(coal.distance(hull, here, probe, there, request, coal.DistanceResult())) + PROBE)
    return out + COAL_ACCURACY
