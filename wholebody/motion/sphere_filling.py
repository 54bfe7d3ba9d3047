"""Solids filled with spheres: equipment as a sphere-based self-collision test takes it.

Degenhardt's thesis (section 3.3.2) fills the mesh of equipment as it stands, or what its convex envelope encloses.
Here the best fit of n spheres is the one that leaves the least volume uncovered and puts the least volume outside. The
volume is sampled on a grid, the centres are those of n clusters of the solid's cells, and the radii descend in turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2
from scipy.spatial import cKDTree

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import array, flag, whole
from wholebody.base.errors import InputError
from wholebody.geometry.components import enclosed_volume, winds_around
from wholebody.geometry.pieces import Piece
from wholebody.geometry.shapes import Box, Hull, Mesh, Shape, Sphere

Faces = NDArray[np.int64]

UNCOVERED = 3.0  # weight of a volume that is uncovered against one that protrudes: a limb would get into the former


@dataclass(frozen=True, eq=False)
class Spheres(Shape):
    """A union of balls: centers (n, 3) and radii (n,), metres; `InputError` for none, other shapes, or no lengths."""

    centers: Array
    radii: Array

    def __post_init__(self) -> None:
        centers = array(self.centers, "Spheres centers", "an array of shape (n, 3)").copy()
        radii = array(self.radii, "Spheres radii", "an array of shape (n,)").copy()
        if radii.ndim != 1 or not len(radii) or centers.shape != (len(radii), 3) or not np.isfinite(centers).all():
            raise InputError(
                f"Spheres: centers {centers.shape} and radii {radii.shape}; give finite (n, 3) and (n,), at least one"
            )
        for radius in radii.tolist():
            Sphere(radius)
        for name, values in (("centers", centers), ("radii", radii)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def pieces(self) -> tuple[Piece, ...]:
        """One coal Sphere each."""
        return tuple(
            Piece(coal.Sphere(radius), pin.SE3(np.eye(3), center), 4.0 / 3.0 * np.pi * radius**3)
            for center, radius in zip(self.centers, self.radii.tolist(), strict=True)
        )


@dataclass(frozen=True, eq=False)
class SphereFilling:
    """Spheres that fill a solid, and how well they do.

    Attributes:
        shape: the spheres, in the axes of the solid.
        envelope: whether the convex envelope was filled instead of the solid as it stands.
        volume: of what was filled, cubic metres, by the grid.
        uncovered: share of that volume that is in no sphere.
        uncovered_depth: largest distance of a point of it from the spheres, metres: so far may something get into the
            solid without touching a sphere; by the grid and the corners.
        outside: volume of the spheres outside of what was filled, as a share of its volume.
        protrusion: largest distance by which a sphere may stand out of the surface, metres; an upper bound.
    """

    shape: Spheres
    envelope: bool
    volume: float
    uncovered: float
    uncovered_depth: float
    outside: float
    protrusion: float

    def __str__(self) -> str:
        what = "the convex envelope" if self.envelope else "the solid"
        count = len(self.shape.radii)
        return (
            f"{count} sphere{'s' * (count > 1)}: {100 * self.uncovered:.1f} % of {what} uncovered, at most "
            f"{1e3 * self.uncovered_depth:.1f} mm deep; protrusion {1e3 * self.protrusion:.1f} mm"
        )


def fill_with_spheres(shape: Shape, count: int, *, envelope: bool = False) -> SphereFilling:
    """Fill a solid with spheres.

    Args:
        shape: a `Mesh`, `Hull`, `Box` or `Sphere`.
        count: number of spheres.
        envelope: whether to fill the convex envelope, which closes holes and hollows, instead of the solid as it
            stands.

    Returns:
        The spheres, with the volume that they leave uncovered and how far they stand out.

    Raises:
        InputError: another shape or count, or a mesh that is not closed and is to be filled as it stands.
    """
    count = whole(count, "fill_with_spheres: count", 1, 500)
    vertices, faces = triangles_of(shape)
    if flag(envelope, "fill_with_spheres: envelope"):
        vertices, faces = _envelope(vertices)
    elif enclosed_volume(vertices, faces) is None:
        raise InputError(
            "fill_with_spheres: the mesh is not closed, so it has no inside; close it, or fill its envelope=True"
        )
    grid = _Grid(vertices, faces, count)
    if not len(grid.inside):
        raise InputError("fill_with_spheres: the mesh encloses no volume; turn its faces outwards, or thicken it")
    fits = (_fitted(grid, count, seed) for seed in range(3))  # seeded clusterings, of which the best is kept
    centers, radii, uncovered, outside = min(fits, key=lambda fit: UNCOVERED * fit[2] + fit[3])
    corners = np.vstack([grid.inside, vertices])
    parts = np.array_split(corners, max(1, len(corners) // 4000))  # all at once would take memory
    beyond = max((np.linalg.norm(part[:, None] - centers, axis=2) - radii).min(axis=1).max() for part in parts)
    depth = _signed_depth(centers, vertices, faces)
    return SphereFilling(
        Spheres(centers, radii),
        envelope,
        len(grid.inside) * grid.cell**3,
        uncovered / len(grid.inside),
        max(0.0, float(beyond)),
        outside / len(grid.inside),
        max(0.0, float((radii - depth).max())),
    )


def triangles_of(shape: Shape) -> tuple[Array, Faces]:
    """Vertices (n, 3) and triangles (m, 3) of the surface of a solid, metres; `InputError` for a shape without any."""
    import trimesh

    if isinstance(shape, Mesh):
        return np.array(shape.vertices), np.array(shape.faces)
    if isinstance(shape, Hull):
        return _envelope(shape.points)
    if isinstance(shape, Box):
        made = trimesh.creation.box(shape.size)
    elif isinstance(shape, Sphere):
        made = trimesh.creation.uv_sphere(shape.radius, (32, 32))
    else:
        raise InputError(f"a {type(shape).__name__} cannot be filled with spheres; give a Mesh, Hull, Box or Sphere")
    return np.array(made.vertices, dtype=float), np.array(made.faces, dtype=np.int64)


class _Grid:
    def __init__(self, vertices: Array, faces: Faces, count: int) -> None:
        corners = vertices[faces]
        volume = abs(float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        # A sphere that covers its share of the solid stands out no farther than this.
        margin = min(0.5 * float(np.linalg.norm(high - low)), 1.5 * float(np.prod(high - low) / count) ** (1.0 / 3.0))
        room = float(np.prod(high - low + 2.0 * margin))
        # 6,000 cells inside the solid, but 150,000 in all, which limits those of thin solids
        self.cell = max(volume / 6_000, room / 150_000) ** (1.0 / 3.0)
        axes = [
            np.arange(a - margin + self.cell * share, b + margin, self.cell)
            for a, b, share in zip(low, high, (0.5, 0.4937, 0.4979), strict=True)  # off the planes of the mesh
        ]
        within = _winding(corners, *axes) > 0.5
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        self.inside, self.around = points[within.ravel()], points[~within.ravel()]


def _winding(corners: Array, xs: Array, ys: Array, zs: Array) -> Array:
    """How often the surface of triangles (m, 3, 3) winds about the points of a grid, (x, y, z), by rays upwards."""
    crossed = np.zeros((len(xs), len(ys), len(zs) + 1))
    for a, b, c in corners:
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        i, j = (slice(*np.searchsorted(v, (low[k], high[k])).tolist()) for k, v in ((0, xs), (1, ys)))
        if i.start == i.stop or j.start == j.stop:
            continue
        x, y = xs[i, None], ys[None, j]
        u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        if hit.any():
            z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])
            below = np.searchsorted(zs, z[hit])  # the points of the column below the face
            rows, columns = np.nonzero(hit)
            np.add.at(crossed, (rows + i.start, columns + j.start, below), np.sign(area))
    return np.asarray(np.cumsum(crossed[:, :, ::-1], axis=2)[:, :, ::-1][:, :, 1:])


def _fitted(grid: _Grid, count: int, seed: int) -> tuple[Array, Array, int, int]:
    """Centres, radii, and how many cells are uncovered inside and covered outside."""
    count = min(count, len(grid.inside))
    centers, label = kmeans2(grid.inside, count, iter=30, minit="++", seed=np.random.default_rng(seed))
    farthest = np.array(
        [np.linalg.norm(grid.inside[label == k] - center, axis=1).max(initial=0.0) for k, center in enumerate(centers)]
    )
    near_in, inner = _near(grid.inside, centers, 1.2 * farthest + grid.cell)
    near_out, outer = _near(grid.around, centers, 1.2 * farthest + grid.cell)
    radii = np.maximum(farthest, grid.cell)
    covers_in, covers_out = np.zeros(len(grid.inside), dtype=int), np.zeros(len(grid.around), dtype=int)

    def count_in(k: int, times: int) -> None:
        covers_in[near_in[k][inner[k] <= radii[k]]] += times
        covers_out[near_out[k][outer[k] <= radii[k]]] += times

    for k in range(len(radii)):
        count_in(k, 1)
    for _ in range(4):  # over all radii, one after the other; later ones change less than a cell
        for k in range(len(radii)):
            count_in(k, -1)
            radii[k] = _best_radius(inner[k][covers_in[near_in[k]] == 0], outer[k][covers_out[near_out[k]] == 0], grid)
            count_in(k, 1)
    return centers, radii, int((covers_in == 0).sum()), int((covers_out > 0).sum())


def _near(points: Array, centers: Array, within: Array) -> tuple[list[Indices], list[Array]]:
    """For each centre the points within its distance (n,), and how far they are."""
    found = (
        cKDTree(points).query_ball_point(centers, within, return_sorted=True) if len(points) else [[]] * len(centers)
    )
    near = [np.array(each, dtype=np.intp) for each in found]
    return near, [np.linalg.norm(points[k] - center, axis=1) for k, center in zip(near, centers, strict=True)]


def _best_radius(inside: Array, outside: Array, grid: _Grid) -> float:
    """The radius that covers most of the cells inside, at these distances, for the fewest outside."""
    distance = np.concatenate([inside, outside])
    worth = np.concatenate([np.full(len(inside), UNCOVERED), np.full(len(outside), -1.0)])
    order = np.argsort(distance, kind="stable")
    gained = np.cumsum(worth[order])
    least = 0.5 * float(grid.cell)
    if not len(gained) or gained.max() <= 0.0:
        return least
    return max(float(distance[order[int(np.argmax(gained))]]), least)


def _signed_depth(points: Array, vertices: Array, faces: Faces) -> Array:
    """(k,) distance of points from the surface, positive inside."""
    import trimesh

    corners = vertices[faces]
    depth = np.empty(len(points))
    for k, point in enumerate(points):
        nearest = trimesh.triangles.closest_point(corners, np.broadcast_to(point, (len(corners), 3)))
        away = float(np.linalg.norm(nearest - point, axis=1).min())
        depth[k] = away if winds_around(corners, point) else -away
    return depth


def _envelope(points: Array) -> tuple[Array, Faces]:
    """Vertices and outward triangles of the convex hull of points."""
    import trimesh

    hull = trimesh.convex.convex_hull(points)
    return np.array(hull.vertices, dtype=float), np.array(hull.faces, dtype=np.int64)
