"""Convex pieces, between which coal computes distances: the sizes for which it is reliable, and their swept points.

Swept points are points plus a radius (a swept sphere), and the flat faces between them. A sphere is one point with a
radius, a capsule two points with a radius; a box is eight points and a hull its vertices, without a radius. They show
which parts of a piece can touch next when the posture changes; one witness point cannot show that (see
`wholebody.geometry.contact_rows`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, cross
from wholebody.base.errors import InputError

SMALLEST = 1e-4
"""Least extent of a piece, metres: below 1e-5 m coal reads gaps as zero, and at 1e-6 m it loses the depth."""

COAL_ACCURACY = 1e-6  # m: of coal's distances

ENDLESS = 1e9  # m: what counts for the reach of a half-space, and half the size of its box

LARGEST = 1e4  # greatest extent of a piece, metres: coal's distances are still right to micrometres there


class Piece(NamedTuple):
    """One convex piece of a shape."""

    # coal's Box, Sphere, Capsule, Ellipsoid, Convex or Halfspace; its origin is the centre of its bounding sphere
    geometry: Any
    placement: pin.SE3  # of the geometry's origin in the shape
    volume: float  # cubic metres; infinite for a half-space


_T = TypeVar("_T")
_MADE: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


def kept(shape: Any, make: Callable[[], _T]) -> _T:
    """What a shape is made into, made the first time and kept with it: scenes are built anew when a thing comes."""
    found: _T | None = _MADE.get(shape)
    if found is None:
        found = _MADE[shape] = make()
    return found


def with_own_places(pieces: Sequence[Piece]) -> tuple[Piece, ...]:
    """The same pieces at placements that the caller may change."""
    return tuple(Piece(piece.geometry, pin.SE3(piece.placement), piece.volume) for piece in pieces)


CORNERS = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0  # (8, 3) of a cube of side 2 about its centre


def box_corners(geometry: Any) -> Array:
    """Corners (8, 3) of the axis-aligned box around a coal shape in its own axes, metres; endless for a half-space."""
    # coal writes the box into the shape. A copy is used, because pickles of scenes would change otherwise.
    own = geometry.clone()
    own.computeLocalAABB()
    return np.where(CORNERS < 0.0, own.aabb_local.min_, own.aabb_local.max_)


class SweptPoints(NamedTuple):
    """One piece as swept points, in the piece's own frame."""

    points: Array  # (m, 3) swept points; empty if one witness point is sufficient (ellipsoid, half-space)
    radius: float  # radius around the points, metres
    faces: Array  # (f, 4) rows [n, b] with n . x <= b inside; for a capsule only the two caps' planes.
    reach: float  # radius about the piece's origin that contains the piece; inf for a half-space
    axis: Array  # unit direction of a capsule, zero for everything else
    width: float  # least distance between two parallel planes that enclose the piece; inf for a half-space
    half: Array  # (3,) half the size of a box about the piece's origin, along its axes, that contains it


_NONE = np.zeros((0, 3))
_NO_FACES = np.zeros((0, 4))
_NO_AXIS = np.zeros(3)
_CENTER = np.zeros((1, 3))
_ALONG = np.array([0.0, 0.0, 1.0])
_SIDES = np.hstack([np.concatenate([np.eye(3), -np.eye(3)]), np.zeros((6, 1))])


def swept_points(geometry: Any) -> SweptPoints:
    """Swept points of a Sphere, Capsule, Box, Ellipsoid, Halfspace or Convex of coal; an InputError for others."""
    if isinstance(geometry, coal.Sphere):
        radius = geometry.radius
        return SweptPoints(_CENTER, radius, _NO_FACES, radius, _NO_AXIS, 2.0 * radius, np.full(3, radius))
    if isinstance(geometry, coal.Capsule):
        half, radius = geometry.halfLength, geometry.radius
        points = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
        caps = np.array([[0.0, 0.0, 1.0, half], [0.0, 0.0, -1.0, half]])
        box = np.array([radius, radius, half + radius])
        return SweptPoints(points, radius, caps, half + radius, _ALONG, 2.0 * radius, box)
    if isinstance(geometry, coal.Box):
        return next(_of_boxes([geometry]))
    if isinstance(geometry, coal.Ellipsoid):
        radii = np.array(geometry.radii)
        return SweptPoints(_NONE, 0.0, _NO_FACES, float(radii.max()), _NO_AXIS, 2.0 * float(radii.min()), radii)
    if isinstance(geometry, coal.Halfspace):
        face = np.array([[*geometry.n, geometry.d]])
        return SweptPoints(_NONE, 0.0, face, np.inf, _NO_AXIS, np.inf, np.full(3, np.inf))
    if isinstance(geometry, coal.Convex):
        return _swept_hull(geometry)
    raise InputError(
        f"{type(geometry).__name__} is not a convex piece; use Box, Sphere, Capsule, Ellipsoid, HalfSpace, Hull or Mesh"
    )


def swept_points_of(geometries: Sequence[Any]) -> list[SweptPoints]:
    """Those of many geometries; boxes, of which there may be thousands, are made at once."""
    shapes = {id(shape): shape for shape in geometries}  # things of one size share them
    boxes = [shape for shape in shapes.values() if isinstance(shape, coal.Box)]
    known = dict(zip(map(id, boxes), _of_boxes(boxes), strict=True))
    known |= {key: swept_points(shape) for key, shape in shapes.items() if key not in known}
    return [known[id(shape)] for shape in geometries]


def _of_boxes(geometries: Sequence[Any]) -> Iterator[SweptPoints]:
    half = np.array([geometry.halfSide for geometry in geometries]).reshape(-1, 3)
    points, faces = CORNERS * half[:, None], np.tile(_SIDES, (len(half), 1, 1))
    faces[:, :3, 3] = faces[:, 3:, 3] = half
    for own, sides, box, lengths in zip(points, faces, half, half.tolist(), strict=True):
        yield SweptPoints(own, 0.0, sides, math.hypot(*lengths), _NO_AXIS, 2.0 * min(lengths), box)


_KNOWN: WeakKeyDictionary[Any, SweptPoints] = WeakKeyDictionary()
"""Those of hulls that are in use: scenes of one study share the hulls of things, and so does a scene built anew."""


def _swept_hull(geometry: Any) -> SweptPoints:
    known = _KNOWN.get(geometry)
    if known is None:
        points = np.array(geometry.points())
        known = _KNOWN[geometry] = _points_of_hull(points, _convex_faces(geometry, points))
    return known


def stretch(geometry: Any, unit: Any, factors: Array) -> None:
    """Know the swept points of a hull, which is a unit one stretched along its axes by factors (3,)."""
    points, _, faces, *_ = swept_points(unit)
    faces = faces / (*factors, 1.0)  # n . x <= b of the unit hull, in the coordinates of the other
    faces /= np.sqrt((faces[:, :3] ** 2).sum(axis=1))[:, None]
    _KNOWN[geometry] = _points_of_hull(points * factors, faces)


def _points_of_hull(points: Array, faces: Array) -> SweptPoints:
    width = float((faces[:, 3] - (points @ faces[:, :3].T).min(axis=0)).min())
    reach = float(np.linalg.norm(points, axis=1).max())
    return SweptPoints(points, 0.0, faces, reach, _NO_AXIS, width, np.abs(points).max(axis=0))


def normal_across(axis_a: Array, axis_b: Array) -> Array:
    """Unit vector (3,) across the axes of two pieces that meet exactly, where coal has no normal; axes may be zero."""
    normal = cross(axis_a, axis_b)
    if np.linalg.norm(normal) < 1e-9:
        along = axis_a if axis_a.any() else axis_b if axis_b.any() else np.array([1.0, 0.0, 0.0])
        normal = cross(along, np.eye(3)[np.argmin(np.abs(along))])
    return np.asarray(normal / np.linalg.norm(normal))


def hull_triangles(hull: Any) -> NDArray[np.int64]:
    """Triangles (m, 3) of a coal.Convex, indices of its points."""
    found = [(face[0], face[1], face[2]) for face in map(hull.polygons, range(hull.num_polygons))]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def _convex_faces(geometry: Any, points: Array) -> Array:
    """Outward planes of a coal.Convex, coplanar triangles merged."""
    triangles = hull_triangles(geometry)
    a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
    normals = cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    solid = length > 1e-14
    normals, a = normals[solid] / length[solid, None], a[solid]
    offsets = np.einsum("ij,ij->i", normals, a)
    inward = offsets < normals @ points.mean(axis=0)
    normals[inward] *= -1.0
    offsets[inward] *= -1.0
    planes = np.column_stack([normals, offsets])
    first: dict[tuple[float, ...], int] = {}
    for row, plane in enumerate(np.round(planes, 7).tolist()):
        first.setdefault(tuple(plane), row)
    return planes[list(first.values())]
