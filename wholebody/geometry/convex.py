"""Convex pieces: hulls that coal can be trusted with, and meshes split into them.

coal's own ``ConvexBase.convexHull`` crashes the process on flat or collinear points and takes NaN without a word, so
hulls are computed by qhull through scipy and everything is checked before coal sees it.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wholebody.errors import InputError, MissingPackageError
from wholebody.geometry.components import Component, split_components
from wholebody.geometry.outer_hull import outer_hull
from wholebody.geometry.pieces import LARGEST, SMALLEST, Array, Piece

CONVEX_VOLUME = 1e-4
"""A closed part is taken as convex when its hull adds at most this share of its volume: float32 files round by less."""

DECOMPOSED_AT_MOST = 64
"""Decompositions kept in memory: the same chair ten times in a scene is decomposed once."""


class ConvexPieces(NamedTuple):
    """A mesh as a union of convex pieces.

    Attributes:
        pieces: at least one.
        added_volume: volume of all pieces over the volume of the mesh, minus one; parts that are not closed do not
            count, since they have no volume of their own.
        notes: one sentence for each part that could not be kept as it is.
    """

    pieces: tuple[Piece, ...]
    added_volume: float
    notes: tuple[str, ...]


def hull_piece(points: ArrayLike, what: str = "hull") -> Piece:
    """Convex hull of points, with its origin at the centre of the smallest sphere around it.

    Args:
        points: (n, 3), metres, n >= 4; duplicates and inner points are dropped.
        what: what the points are, for the error's sentence.

    Raises:
        InputError: not (n, 3), not finite, fewer than four different points, or thinner than `SMALLEST` in some
            direction (flat and collinear points too).
    """
    cloud = check_points(points, what)
    hull = _solid_hull(cloud, what)
    used = hull.vertices
    corners = cloud[used]
    centre, _ = enclosing_ball(corners)
    corners = corners - centre
    number = np.full(len(cloud), -1)
    number[used] = np.arange(len(used))
    faces = number[hull.simplices]
    normals = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return Piece(_coal_convex(corners, faces), pin.SE3(np.eye(3), centre), float(hull.volume))


def _coal_convex(corners: Array, faces: NDArray[np.int_]) -> Any:
    import coal

    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(corners))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*map(int, face)) for face in faces])
    return coal.Convex(vertices, triangles)


def check_points(points: ArrayLike, what: str) -> Array:
    """Return points as a float array (n, 3) without duplicates.

    Raises:
        InputError: another shape, not finite, or farther than `LARGEST` from the origin.
    """
    try:
        cloud = np.asarray(points, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what}: the points are not numbers; give an array of shape (n, 3)") from None
    if cloud.ndim != 2 or cloud.shape[1:] != (3,):
        raise InputError(f"{what}: the points have shape {cloud.shape}; give an array of shape (n, 3)")
    bad = np.flatnonzero(~np.isfinite(cloud).all(axis=1))
    if len(bad):
        raise InputError(f"{what}: point {bad[0]} is {cloud[bad[0]].tolist()}; give finite numbers")
    if len(cloud) and np.abs(cloud).max() > LARGEST:
        raise InputError(
            f"{what}: a point lies {np.abs(cloud).max():.4g} m from the origin; give metres, at most {LARGEST:g}"
        )
    return np.unique(cloud, axis=0)


def _solid_hull(cloud: Array, what: str) -> Any:
    """Hull of a cloud that is solid, by qhull: a thin one never reaches qhull, nor coal."""
    from scipy.spatial import ConvexHull, QhullError

    if len(cloud) < 4:
        raise InputError(
            f"{what}: {len(cloud)} different points enclose no volume; give at least four that are not in a plane"
        )
    spread = np.ptp(
        (cloud - cloud.mean(axis=0)) @ np.linalg.svd(cloud - cloud.mean(axis=0), full_matrices=False)[2].T, axis=0
    )
    if spread.min() < SMALLEST:
        shape = "in one place" if spread[0] < SMALLEST else "on a line" if spread[1] < SMALLEST else "in a plane"
        raise InputError(f"{what}: all points lie {shape} to {SMALLEST} m; give points that enclose a volume")
    try:
        hull = ConvexHull(cloud)
    except QhullError as error:
        raise InputError(
            f"{what}: qhull finds no volume in the points ({str(error).splitlines()[0]}); give solid points"
        ) from None
    width = -(cloud @ hull.equations[:, :3].T + hull.equations[:, 3]).min(axis=0)
    if width.min() < SMALLEST:
        raise InputError(f"{what}: the points are {width.min():.2g} m thick; give at least {SMALLEST} m")
    return hull


def enclosing_ball(points: Array) -> tuple[Array, float]:
    """Smallest ball that holds points (n, 3): centre (3,) and radius.

    An exchange of bases: the ball of at most four points on its surface is enlarged by the farthest point outside until
    there is none. The radius grows with each exchange, so it ends (Welzl 1991 has the theory; this is a pivoting form).
    """
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
    """Of all balls through one to four of at most five points, the smallest that holds the five."""
    best: tuple[list[int], Array, float] | None = None
    for size in range(1, min(4, len(candidates)) + 1):
        for chosen in combinations(candidates, size):
            corners = points[list(chosen)]
            edges = corners[1:] - corners[0]
            offset = np.linalg.lstsq(2 * edges, (edges**2).sum(axis=1), rcond=None)[0] if size > 1 else np.zeros(3)
            centre, radius = corners[0] + offset, float(np.linalg.norm(offset))
            inside = np.linalg.norm(points[candidates] - centre, axis=1).max() <= radius + 1e-10 * scale
            if inside and (best is None or radius < best[2]):
                best = (list(chosen), centre, radius)
    if best is None:  # rounding among nearly concyclic points: any ball that holds them will do
        centre = points[candidates].mean(axis=0)
        best = (candidates[-4:], centre, float(np.linalg.norm(points[candidates] - centre, axis=1).max()))
    return best


def convex_pieces(
    vertices: ArrayLike, faces: ArrayLike, max_vertices: int = 32, threshold: float = 0.05, what: str = "mesh"
) -> ConvexPieces:
    """Split a triangle mesh into convex pieces.

    Parts that hang together are found first. A convex part is kept as it is, with all its vertices; another closed part
    is decomposed by CoACD (Wei et al. 2022, "Approximate convex decomposition for 3D meshes with collision-aware
    concavity and tree search"), and its pieces are simplified outwards, so that none of the surface is left
    uncovered; a part with holes in its surface has no inside, so its hull is taken; and a flat part is thickened to
    twice `SMALLEST`. `notes` says which.

    Args:
        vertices: (n, 3), metres.
        faces: (m, 3) vertex indices.
        max_vertices: most vertices of a piece that comes out of a decomposition, 8 to 256.
        threshold: concavity left in the pieces, as a share of the part's size, 0.01 to 1: CoACD's own measure.
        what: what the mesh is, for the error's sentence.

    Raises:
        InputError: bad arrays or options, or nothing solid in the mesh.
        MissingPackageError: a part needs decomposing and coacd is not installed.
    """
    cloud, triangles = check_mesh(vertices, faces, what)
    if not isinstance(max_vertices, (int, np.integer)) or not 8 <= max_vertices <= 256:
        raise InputError(f"{what}: max_vertices is {max_vertices!r}; give a whole number between 8 and 256")
    if not isinstance(threshold, (int, float, np.floating)) or not 0.01 <= threshold <= 1.0:
        raise InputError(f"{what}: threshold is {threshold!r}; give a number between 0.01 and 1")
    kept = _decomposed(cloud.tobytes(), triangles.tobytes(), int(max_vertices), float(threshold), what)
    return kept._replace(pieces=tuple(piece._replace(placement=pin.SE3(piece.placement)) for piece in kept.pieces))


def check_mesh(vertices: ArrayLike, faces: ArrayLike, what: str) -> tuple[Array, NDArray[np.int64]]:
    """Return the arrays of a mesh: (n, 3) float and (m, 3) int64.

    Raises:
        InputError: wrong shapes, no faces, indices out of range, values that are not finite.
    """
    try:
        cloud = np.ascontiguousarray(vertices, dtype=float)
        triangles = np.asarray(faces)
        whole = triangles.astype(np.int64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: vertices and faces are not arrays of numbers; give (n, 3) and (m, 3)") from None
    if cloud.ndim != 2 or cloud.shape[1:] != (3,) or triangles.ndim != 2 or triangles.shape[1:] != (3,):
        raise InputError(
            f"{what}: vertices and faces have shapes {cloud.shape} and {triangles.shape}; give (n, 3) and (m, 3)"
        )
    if not len(triangles) or not len(cloud):
        raise InputError(f"{what}: there are no triangles in it")
    bad = np.flatnonzero(~np.isfinite(cloud).all(axis=1))
    if len(bad):
        raise InputError(f"{what}: vertex {bad[0]} is {cloud[bad[0]].tolist()}; give finite numbers")
    if np.abs(cloud).max() > LARGEST:
        raise InputError(f"{what}: a vertex lies {np.abs(cloud).max():.4g} m from the origin; is the scale right?")
    if (whole != triangles).any() or whole.min() < 0 or whole.max() >= len(cloud):
        raise InputError(f"{what}: face indices must be whole numbers from 0 to {len(cloud) - 1}")
    return cloud, np.ascontiguousarray(whole)


@lru_cache(maxsize=DECOMPOSED_AT_MOST)
def _decomposed(vertices: bytes, faces: bytes, max_vertices: int, threshold: float, what: str) -> ConvexPieces:
    cloud = np.frombuffer(vertices).reshape(-1, 3)
    triangles = np.frombuffer(faces, dtype=np.int64).reshape(-1, 3)
    pieces: list[Piece] = []
    notes: list[str] = []
    before = after = 0.0
    for number, part in enumerate(split_components(cloud, triangles)):
        name = f"{what}, part {number}"
        made = _part_pieces(part, max_vertices, threshold, name, notes)
        pieces += made
        if part.closed:
            before += part.volume
            after += sum(piece.volume for piece in made)
    if not pieces:
        raise InputError(f"{what}: nothing in it is larger than {SMALLEST} m; is the scale right?")
    return ConvexPieces(tuple(pieces), after / before - 1.0 if before > 0 else 0.0, tuple(notes))


def _part_pieces(part: Component, max_vertices: int, threshold: float, name: str, notes: list[str]) -> list[Piece]:
    try:
        whole = hull_piece(part.vertices, name)
    except InputError:
        return _thickened(part.vertices, name, notes)
    if not part.closed:
        notes.append(f"{name}: its surface is not closed ({len(part.faces)} triangles), so its convex hull is taken")
        return [whole]
    if whole.volume - part.volume <= CONVEX_VOLUME * part.volume:
        return [whole]
    pieces: list[Piece] = []
    for corners in _coacd(part, max_vertices, threshold):
        try:
            pieces.append(hull_piece(corners, name))
        except InputError:
            pieces += _thickened(corners, name, notes)
    return pieces


def _thickened(points: Array, name: str, notes: list[str]) -> list[Piece]:
    """A flat part as a plate of twice `SMALLEST`; a part that is thin in two directions is left out."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    if len(points) < 3 or np.ptp(centred @ axes[1]) < SMALLEST:
        notes.append(f"{name}: thinner than {SMALLEST} m in two directions, so it is left out")
        return []
    offset = SMALLEST * axes[2]
    notes.append(f"{name}: it is flat, so it is thickened by {SMALLEST} m to both sides")
    return [hull_piece(np.vstack([points + offset, points - offset]), name)]


def _coacd(part: Component, max_vertices: int, threshold: float) -> list[Array]:
    try:
        import coacd
    except ImportError:
        raise MissingPackageError("a mesh that is not convex needs coacd: pip install coacd") from None
    coacd.set_log_level("error")
    # CoACD's own cap on vertices (decimate) leaves parts of the surface outside; its re-meshing (preprocess) inflates
    # thin parts by half, and a closed manifold does not need it.
    parts = coacd.run_coacd(
        coacd.Mesh(part.vertices, part.faces.astype(np.int32)),
        threshold=threshold,
        preprocess_mode="off",
        seed=0,
    )
    return [outer_hull(np.asarray(corners, dtype=float), max_vertices) for corners, _ in parts]
