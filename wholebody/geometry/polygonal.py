"""Cylinders and rings as convex pieces: prisms around them, whose hulls are found once."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.hull import hull_piece
from wholebody.geometry.pieces import Piece

SIDES = 64
"""Sides of the prism that stands for a cylinder: 64 are 0.12 % of the radius too far out; fewer are coarser."""

SECTORS, TUBE_SIDES = 24, 12
"""Pieces of a ring, and sides of its tube: 24 and 12 are 1 % of the radius and 4 % of the tube too far out."""


@lru_cache(maxsize=1)
def _unit_cylinder() -> tuple[Piece, Any]:
    """The cylinder of radius 1 and length 1, and the triangles of its hull, which take longest to find."""
    ring = around(1.0, SIDES)
    piece = hull_piece(np.vstack([np.column_stack([ring, np.full(SIDES, z)]) for z in (-0.5, 0.5)]), "Cylinder")
    return piece, _triangles(piece.geometry)


@lru_cache(maxsize=1024)  # scenes have many things of one size, which share what coal and others compute of them
def cylinder_pieces(radius: float, length: float) -> tuple[Piece, ...]:
    """The prism around a cylinder along z, centred at its origin."""
    return (_stretched(*_unit_cylinder(), np.array((radius, radius, length))),)


@lru_cache(maxsize=64)
def torus_pieces(radius: float, tube: float) -> tuple[Piece, ...]:
    """A piece for each sector of a ring about z: the hull of the polygons around its tube at both ends."""
    across = around(tube, TUBE_SIDES)
    outwards = 1.0 / math.cos(math.pi / SECTORS)
    circles = []
    for angle in np.linspace(0.0, 2.0 * math.pi, SECTORS + 1):
        reach = (radius + across[:, 0]) * outwards
        circles.append(np.column_stack([reach * math.cos(angle), reach * math.sin(angle), across[:, 1]]))
    return tuple(hull_piece(np.vstack(pair), "Torus") for pair in pairwise(circles))


def around(radius: float, sides: int) -> Array:
    """Corners (sides, 2) of the regular polygon around a circle."""
    angles = 2.0 * math.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angles), np.sin(angles)]) * (radius / math.cos(math.pi / sides))


def _stretched(piece: Piece, triangles: Any, scale: Array) -> Piece:
    """A piece about its origin, a Convex with these triangles, stretched along the axes by a scale (3,)."""
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(np.array(piece.geometry.points()) * scale))
    return Piece(coal.Convex(vertices, triangles), pin.SE3.Identity(), piece.volume * float(np.prod(scale)))


def _triangles(convex: Any) -> Any:
    """The triangles of a Convex as coal takes them."""
    triangles = coal.StdVec_Triangle()
    triangles.extend([convex.polygons(k) for k in range(convex.num_polygons)])
    return triangles
