"""Meshes as unions of convex pieces: one hull for a whole mesh, or a decomposition that keeps concavities."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError, MissingPackageError
from wholebody.base.fields import Range
from wholebody.geometry.components import (
    Component,
    closed_up,
    enclosed_volume,
    is_convex,
    passes_through_itself,
    split_components,
)
from wholebody.geometry.hull import check_points, hull_piece, thickened
from wholebody.geometry.mesh_cache import ConvexPieces, cached
from wholebody.geometry.pieces import SMALLEST, Piece, with_own_places

if TYPE_CHECKING:
    from wholebody.base.runner import Child


HULL_VERTICES = (64, 48)
"""A hull of a whole mesh with more vertices than the first number gets as many as the second. With 32 the hulls of real
robots have 11 % more volume than with all their vertices, with 48 they have 6 %, and with 64 they have 4 %. Contacts
have more rows with more vertices."""

VERTICES, CONCAVITY = Range(8, 256, whole=True), Range(0.01, 1.0)

_log = logging.getLogger(__name__)


def convex_pieces(
    vertices: ArrayLike, faces: ArrayLike, max_vertices: int = 32, threshold: float = 0.05, what: str = "mesh"
) -> ConvexPieces:
    """Split a triangle mesh into convex pieces.

    A mesh whose triangles cover its convex hull, in whatever order and orientation and however often, is that hull.
    Another one is split into connected parts. A convex part is kept as it is, with all its vertices. CoACD decomposes
    another closed part (Wei et al. 2022, "Approximate convex decomposition for 3D meshes with collision-aware concavity
    and tree search"), and its pieces are simplified outwards, so that they cover the whole surface. A part that lacks
    faces is closed first; of a shell, which encloses nothing, every triangle is thickened (see `components`). A flat
    part is thickened to twice `SMALLEST`. `notes` reports this.

    Args:
        vertices: (n, 3), metres.
        faces: (m, 3) vertex indices.
        max_vertices: most vertices of a piece that comes out of a decomposition, within `VERTICES`.
        threshold: concavity of the pieces, as a share of the part's size, within `CONCAVITY`: CoACD's own measure.
        what: name of the mesh, for messages.

    Raises:
        InputError: invalid arrays or options, or nothing solid in the mesh.
        MissingPackageError: a part needs decomposing and coacd is not installed.
    """
    cloud, triangles = check_mesh(vertices, faces, what)
    settings = int(VERTICES(max_vertices, f"{what}: max_vertices")), CONCAVITY(threshold, f"{what}: threshold")
    found = _decomposed(cloud.tobytes(), triangles.tobytes(), *settings, what)
    return with_values(found, pieces=with_own_places(found.pieces))


def mesh_hull(vertices: ArrayLike, faces: ArrayLike, what: str = "mesh") -> ConvexPieces:
    """The convex hull of a triangle mesh as one piece, with fewer vertices than `HULL_VERTICES`, thickened if thin."""
    cloud, triangles = check_mesh(vertices, faces, what)
    points = cloud[np.unique(triangles)]
    notes: list[str] = []
    try:
        piece = hull_piece(points, what, HULL_VERTICES)
    except InputError:
        piece = hull_piece(thickened(points), what, HULL_VERTICES)
        notes.append(f"{what}: it is thinner than {SMALLEST} m, so its hull is thickened by {SMALLEST} m to all sides")
    solid = enclosed_volume(cloud, triangles)
    if solid is None:
        parts = [part if part.closed else _closed(part, what, notes) for part in split_components(cloud, triangles)]
        solid = sum(part.volume for part in parts)
        if not (solid > 0.0 and all(part.closed for part in parts)):
            notes.append(f"{what}: its surface is not closed, so what its convex hull adds is not known")
            return ConvexPieces((piece,), 0.0, tuple(notes))
    added = max(piece.volume / solid - 1.0, 0.0)
    if added > 0.01:  # Share of added volume from which a note reports it.
        notes.append(f"{what}: its convex hull has {added:.0%} more volume")
    return ConvexPieces((piece,), added, tuple(notes))


def check_mesh(vertices: ArrayLike, faces: ArrayLike, what: str) -> tuple[Array, NDArray[np.int64]]:
    """The arrays of a mesh, (n, 3) float and (m, 3) int64; an InputError if they are none, or not finite."""
    cloud = np.ascontiguousarray(check_points(vertices, what, "vertex", "vertices"))
    try:
        triangles = np.asarray(faces)
        whole = triangles.astype(np.int64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: the faces are not numbers; give an array of shape (m, 3)") from None
    if triangles.ndim != 2 or triangles.shape[1:] != (3,):
        raise InputError(f"{what}: the faces have shape {triangles.shape}; give an array of shape (m, 3)")
    if not len(triangles) or not len(cloud):
        raise InputError(f"{what}: it has no triangles")
    if (whole != triangles).any() or whole.min() < 0 or whole.max() >= len(cloud):
        raise InputError(f"{what}: face indices must be whole numbers from 0 to {len(cloud) - 1}")
    return cloud, np.ascontiguousarray(whole)


@lru_cache(maxsize=64)  # Decompositions kept in memory: the same chair ten times in a scene is decomposed once.
def _decomposed(vertices: bytes, faces: bytes, max_vertices: int, threshold: float, what: str) -> ConvexPieces:
    settings = f"decomposed and closed {max_vertices} {threshold!r} {coacd_version()}"
    return cached((vertices, faces), settings, what, lambda: _decompose(vertices, faces, max_vertices, threshold, what))


def coacd_version() -> str:
    """The version of coacd that is installed, or "none"."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("coacd")
    except PackageNotFoundError:
        return "none"


def _decompose(vertices: bytes, faces: bytes, max_vertices: int, threshold: float, what: str) -> ConvexPieces:
    cloud = np.frombuffer(vertices).reshape(-1, 3)
    triangles = np.frombuffer(faces, dtype=np.int64).reshape(-1, 3)
    pieces: list[Piece] = []
    notes: list[str] = []
    before = after = 0.0
    from wholebody.base.runner import Child

    if is_convex(cloud, triangles):
        try:
            return ConvexPieces((hull_piece(cloud[np.unique(triangles)], what),), 0.0, ())
        except InputError:
            pass  # too thin for a hull: its parts are thickened
    child = Child()  # begins to run at the first part that needs it
    try:
        for number, part in enumerate(split_components(cloud, triangles)):
            name = f"{what}, part {number}"
            part = part if part.closed else _closed(part, name, notes)
            made = _part_pieces(part, max_vertices, threshold, name, notes, child)
            pieces += made
            if part.closed:
                before += part.volume
                after += sum(piece.volume for piece in made)
    finally:
        child.close()
    if not pieces:
        raise InputError(f"{what}: it has no part larger than {SMALLEST} m; is the scale right?")
    return ConvexPieces(tuple(pieces), after / before - 1.0 if before > 0 else 0.0, tuple(notes))


def _part_pieces(
    part: Component, max_vertices: int, threshold: float, name: str, notes: list[str], child: Child
) -> list[Piece]:
    try:
        whole = hull_piece(part.vertices, name)
    except InputError:
        return _thickened(part.vertices, name, notes)
    if not part.closed:
        return _shell(part, name, notes)
    # A closed part counts as convex if its hull adds at most this share of its volume; float32 rounding is smaller.
    if whole.volume - part.volume <= 1e-4 * part.volume:
        return [whole]
    pieces: list[Piece] = []
    for corners in _coacd(part, threshold, name, child):
        try:
            pieces.append(hull_piece(corners, name, (max_vertices, max_vertices)))
        except InputError:
            pieces += _thickened(corners, name, notes)
    return pieces


def _closed(part: Component, name: str, notes: list[str]) -> Component:
    """The part with what it lacks of its surface; the same if it is a shell."""
    found = closed_up(part)
    if found is None:
        return part
    if found.loops:
        notes.append(f"{name}: its surface is not closed: {found.loops} hole{'s' * (found.loops > 1)} closed")
    return found.part


def _shell(part: Component, name: str, notes: list[str]) -> list[Piece]:
    """Every triangle of a surface that encloses nothing, thickened; those without an area are left out."""
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    longest = np.linalg.norm(np.stack([b - a, c - b, a - c]), axis=2).max(axis=0)
    solid = np.flatnonzero(length >= SMALLEST * longest)
    corners = np.stack([a, b, c], axis=1)
    offsets = SMALLEST * across / np.maximum(length, 1e-300)[:, None]
    notes.append(f"{name}: its surface is not closed and encloses nothing, so its {len(solid)} triangles are thickened")
    return [hull_piece(np.vstack([corners[k] + offsets[k], corners[k] - offsets[k]]), name) for k in solid]


def _thickened(points: Array, name: str, notes: list[str]) -> list[Piece]:
    """A flat part as a plate; a part that is thin in two directions is left out."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    if len(points) < 3 or np.ptp(centred @ axes[1]) < SMALLEST:
        notes.append(f"{name}: thinner than {SMALLEST} m in two directions, so it is left out")
        return []
    notes.append(f"{name}: it is flat, so it is thickened by {SMALLEST} m to both sides")
    offset = SMALLEST * axes[2]
    try:
        return [hull_piece(np.vstack([points + offset, points - offset]), name)]
    except InputError:  # its thinnest direction is not across its main plane
        return [hull_piece(thickened(points), name)]


_MEND = "repair the mesh where it passes through itself, or place its hull with wb.Hull"
MOST_SECONDS = 40.0
"""Limit of CoACD for one part, seconds of the processor; the largest of real robots took a fraction of it."""


def _coacd(part: Component, threshold: float, name: str, child: Child) -> list[Array]:
    if find_spec("coacd") is None:
        raise MissingPackageError("a mesh that is not convex needs coacd: pip install coacd")
    from wholebody.base.runner import BY_THE_CLOCK, EndedError

    _log.info("decomposing %s (%d triangles) into convex pieces", name, len(part.faces))
    faces = part.faces.astype(np.int32)
    seconds = MOST_SECONDS
    if passes_through_itself(part.vertices, part.faces):
        # CoACD often finds no end of such a part: a second for each hundred triangles
        seconds = min(seconds, float(math.ceil(len(faces) / 100)))
    try:
        asked = (run_coacd, seconds, np.asarray(part.vertices), faces, threshold)
        parts = child.call(limited, *asked, seconds=BY_THE_CLOCK * seconds)
    except EndedError as error:
        if error.overtime:
            raise InputError(
                f"{name}: CoACD found no convex pieces of {len(faces)} triangles in {seconds:g} s of the processor; "
                f"give fewer triangles, {_MEND}"
            ) from None
        raise InputError(f"{name}: CoACD cannot cut it into convex pieces; {_MEND}") from None
    return [np.asarray(corners, dtype=float) for corners in parts]


def limited(function: Callable[..., list[Array]], seconds: float, *arguments: Any) -> list[Array]:
    """Call a function with a limit of the processor's time; for a child process."""
    from wholebody.base.runner import allow_processor

    allow_processor(seconds)
    return function(*arguments)


def run_coacd(vertices: Array, faces: NDArray[np.int32], threshold: float) -> list[Array]:
    """Corners of the convex parts that CoACD finds, each (k, 3); for a child process, as bad meshes make it crash."""
    # Its cap on vertices (decimate) leaves surface outside; its re-meshing (preprocess) inflates thin parts by half.
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=threshold, preprocess_mode="off", seed=0)
    return [corners for corners, _ in parts]
