"""Convex hulls for which coal is reliable, simpler hulls around them, and prisms around cylinders and rings.

coal's own ``ConvexBase.convexHull`` crashes the process on flat or collinear points and accepts NaN silently. So qhull
computes the hulls through scipy, and everything is checked before coal gets it. A simpler hull contains the other:
dropping vertices would leave parts of the surface uncovered, and a posture could be free of contact and still inside.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import combinations, pairwise
from operator import add, mul, sub
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wholebody.base.arrays import Array, cross
from wholebody.base.errors import InputError
from wholebody.geometry.pieces import CORNERS, LARGEST, SMALLEST, Piece, hull_triangles, stretch

MOST_NEIGHBOURS = 255  # most edges at one vertex that coal can represent


def hull_piece(points: ArrayLike, what: str = "hull", vertices: tuple[int, int] | None = None) -> Piece:
    """Convex hull of points (n, 3), metres, with its origin at the centre of the smallest sphere around it.

    `vertices` (most, few): a hull with more than `most` vertices is replaced by one around it with at most `few`, 8 or
    more. Without it only a hull that coal cannot take, with more than `MOST_NEIGHBOURS` edges at a vertex, is replaced.
    InputError for fewer than four different points, or what is thinner than `SMALLEST` in some direction.
    """
    cloud = check_points(points, what)
    if len(cloud) < 1000:  # of more points qhull drops duplicates
        cloud = np.unique(cloud, axis=0)
    hull = _solid_hull(cloud, what)
    if vertices is not None and len(hull.vertices) > vertices[0]:
        hull = _solid_hull(simplified_hull(cloud[hull.vertices], vertices[1]), what)
    if np.bincount(hull.simplices.ravel()).max() > MOST_NEIGHBOURS:
        # Vertices of the hull that replaces one with too many edges at a vertex.
        hull = _solid_hull(simplified_hull(cloud[hull.vertices], 128), what)
    used = hull.vertices
    corners = hull.points[used]
    centre, _ = enclosing_ball(corners)
    corners = corners - centre
    number = np.full(len(hull.points), -1)
    number[used] = np.arange(len(used))
    faces = number[hull.simplices]
    normals = cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return Piece(coal_convex(corners, coal_triangles(faces)), pin.SE3(np.eye(3), centre), float(hull.volume))


def thickened(points: Array) -> Array:
    """Corners of a cube of twice `SMALLEST` about every point: a hull of them is solid, however thin the points are."""
    return np.asarray((points[:, None] + SMALLEST * CORNERS).reshape(-1, 3))


def coal_convex(corners: Array, triangles: Any) -> Any:
    """Convex of coal with corners (n, 3) and `coal_triangles`."""
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(corners))
    return coal.Convex(vertices, triangles)


def coal_triangles(faces: NDArray[np.int_]) -> Any:
    """Outward triangles (m, 3) as coal takes them."""
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*face) for face in faces.tolist()])
    return triangles


def check_points(points: ArrayLike, what: str, one: str = "point", many: str = "points") -> Array:
    """Points as a float array (n, 3); an InputError if they are none, or farther than `LARGEST`."""
    try:
        cloud = np.asarray(points, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what}: the {many} are not numbers; give an array of shape (n, 3)") from None
    if cloud.ndim != 2 or cloud.shape[1:] != (3,):
        raise InputError(f"{what}: the {many} have shape {cloud.shape}; give an array of shape (n, 3)")
    bad = np.flatnonzero(~np.isfinite(cloud).all(axis=1))
    if len(bad):
        raise InputError(f"{what}: {one} {bad[0]} is {cloud[bad[0]].tolist()}; give finite numbers")
    far = np.abs(cloud).max(initial=0.0)
    if far > LARGEST:
        raise InputError(
            f"{what}: a {one} lies {far:.4g} m from the origin; give metres, at most {LARGEST:g}; is the scale right?"
        )
    return cloud


def _solid_hull(cloud: Array, what: str) -> Any:
    """Hull of a solid cloud by qhull; a thin cloud is refused before."""
    from scipy.spatial import ConvexHull, QhullError

    if len(cloud) < 4:
        raise InputError(
            f"{what}: {len(cloud)} different points enclose no volume; give at least four that are not in a plane"
        )
    centred = cloud - cloud.mean(axis=0)
    spread = np.ptp(centred @ np.linalg.eigh(centred.T @ centred)[1][:, ::-1], axis=0)
    if spread.min() < SMALLEST:
        shape = "in one place" if spread[0] < SMALLEST else "on a line" if spread[1] < SMALLEST else "in a plane"
        raise InputError(f"{what}: all points lie {shape} to {SMALLEST} m; give points that enclose a volume")
    try:
        hull = ConvexHull(cloud)
    except QhullError as error:
        raise InputError(
            f"{what}: qhull finds no volume in the points ({str(error).splitlines()[0]}); give solid points"
        ) from None
    corners = cloud[hull.vertices]
    inside = -(hull.equations[:, :3] @ corners.mean(axis=0) + hull.equations[:, 3])
    if inside.min() < SMALLEST:  # no ball of that size is known to be inside: compute the width itself
        # Number of faces, those nearest to the middle, along whose normals the width of a hull is measured.
        thin = np.argsort(inside)[:1000]
        width = -(corners @ hull.equations[thin, :3].T + hull.equations[thin, 3]).min(axis=0)
        if width.min() < SMALLEST:
            raise InputError(f"{what}: the points are {width.min():.2g} m thick; give at least {SMALLEST} m")
    return hull


def enclosing_ball(points: Array) -> tuple[Array, float]:
    """Centre (3,) and radius of the smallest ball around points (n, 3): exchange of bases, after Welzl 1991."""
    scale = float(np.ptp(points, axis=0).max()) or 1.0
    basis = [int(((points - points.mean(axis=0)) ** 2).sum(axis=1).argmax())]
    centre, radius = points[basis[0]], 0.0
    for _ in range(10 * len(points)):
        distance = np.linalg.norm(points - centre, axis=1)
        far = int(distance.argmax())
        if distance[far] <= radius + 1e-12 * scale or far in basis:
            break
        basis, centre, radius = _smallest_basis(points, [*basis, far], scale)
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def _smallest_basis(points: Array, candidates: list[int], scale: float) -> tuple[list[int], Array, float]:
    """Of all balls through the last of two to five points and one to three others, the smallest that contains all."""
    best: tuple[float, list[int], tuple[float, ...]] | None = None
    places = dict(zip(candidates, map(tuple, points[candidates].tolist()), strict=True))
    *others, last = candidates
    for size in range(1, min(3, len(others)) + 1):
        for chosen in combinations(others, size):
            offset = _to_centre([tuple(map(sub, places[k], places[last])) for k in chosen])
            if offset is None:
                continue
            centre, radius = tuple(map(add, places[last], offset)), math.hypot(*offset)
            if best is None or radius < best[0]:
                inside = max(math.dist(place, centre) for place in places.values()) <= radius + 1e-10 * scale
                best = (radius, [*chosen, last], centre) if inside else best
    if best is not None:
        return best[1], np.array(best[2]), best[0]
    # rounding among nearly concyclic points: use any ball that contains them
    middle = points[candidates].mean(axis=0)
    return candidates[-4:], middle, float(np.linalg.norm(points[candidates] - middle, axis=1).max())


def _to_centre(edges: list[tuple[float, ...]]) -> tuple[float, ...] | None:
    """From a point to the centre of the smallest ball through it and one to three others, by the edges to these.

    None where the edges are dependent: a ball through fewer of the points is the same or smaller then.
    """
    squares = [sum(map(mul, edge, edge)) for edge in edges]
    if len(edges) == 1:
        return tuple(0.5 * x for x in edges[0])
    normal = _crossed(edges[0], edges[1])
    if len(edges) == 2:
        most, size = squares[0] * squares[1], sum(map(mul, normal, normal))
        if size <= 1e-24 * most:
            return None
        outward = tuple(squares[0] * y - squares[1] * x for x, y in zip(*edges, strict=True))
        return tuple(0.5 * x / size for x in _crossed(outward, normal))
    volume = sum(map(mul, normal, edges[2]))
    if abs(volume) <= 1e-12 * math.sqrt(squares[0] * squares[1] * squares[2]):
        return None
    sides = _crossed(edges[1], edges[2]), _crossed(edges[2], edges[0]), normal
    return tuple(0.5 * sum(map(mul, squares, parts)) / volume for parts in zip(*sides, strict=True))


def _crossed(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def simplified_hull(points: Array, max_vertices: int) -> Array:
    """Vertices (k, 3) of a convex polytope around points (n, 3) with at most `max_vertices`, 8 or more."""
    # The box along the axes, which soles and other flat sides of parts in CAD are parallel to, so that these stay flat;
    # each cut uses the hull's plane that removes most at the farthest vertex.
    from scipy.spatial import ConvexHull, QhullError

    hull = ConvexHull(points)
    corners = points[hull.vertices]
    if len(corners) <= max_vertices:
        return np.asarray(corners)
    inside = corners.mean(axis=0)
    box = np.vstack([np.eye(3), -np.eye(3)])
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
    # radians: of faces whose normals differ by less, only one is tried.
    _, first = np.unique(np.round(equations[:, :3] / 0.02), axis=0, return_index=True)
    return np.asarray(equations[np.sort(first)])


def _vertices(planes: Array, inside: Array) -> Array:
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    found = HalfspaceIntersection(planes, inside).intersections
    return np.asarray(found[ConvexHull(found).vertices])


SIDES = 64  # sides of the prism that stands for a cylinder: 64 are 0.12 % of the radius too far out; fewer are coarser

SECTORS, TUBE_SIDES = 24, 12
"""Pieces of a ring, and sides of its tube: 24 and 12 are 1 % of the radius and 4 % of the tube too far out."""


@lru_cache(maxsize=4)
def _unit_cylinder(sides: int) -> tuple[Piece, Any]:
    """The prism around a cylinder of size 1, and its triangles, which take longest to find."""
    ring = around(1.0, sides)
    piece = hull_piece(np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (-0.5, 0.5)]), "Cylinder")
    return piece, coal_triangles(hull_triangles(piece.geometry))


@lru_cache(maxsize=1024)  # scenes have many things of one size, which share what coal and others compute of them
def cylinder_pieces(radius: float, length: float, sides: int = SIDES) -> tuple[Piece, ...]:
    """The prism of so many sides around a cylinder along z, centred at its origin."""
    (unit, _, volume), triangles = _unit_cylinder(sides)
    size = np.array([radius, radius, length])
    geometry = coal_convex(np.array(unit.points()) * size, triangles)
    stretch(geometry, unit, size)
    return (Piece(geometry, pin.SE3.Identity(), volume * radius**2 * length),)


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
