"""The convex collision pieces of a robot's links: exact shapes, and meshes as hulls or decomposed."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import known, shown
from wholebody.base.errors import InputError
from wholebody.base.fields import Range
from wholebody.geometry.convex import HULL_VERTICES, coacd_version, convex_pieces, mesh_hull
from wholebody.geometry.hull import hull_piece
from wholebody.geometry.mesh_cache import ConvexPieces, cached
from wholebody.geometry.meshes import EmptyMeshError, read_mesh
from wholebody.geometry.pieces import LARGEST, SMALLEST

CYLINDER_SIDES = 32
"""A cylinder becomes a prism around it with this many sides; its corners protrude by 0.5 % of the radius."""

_log = logging.getLogger(__name__)

Concavity = float | Mapping[str, float] | None
"""None: a hull for each mesh. A number: concavity of the pieces of every mesh. A mapping: the same for some links."""


class LinkShape(NamedTuple):
    """One collision shape of a link."""

    link: str  # name of the link
    placement: pin.SE3  # in the link's frame
    kind: str  # "box", "sphere", "cylinder", "capsule", "ellipsoid", "mesh" or "triangles"
    # box: three edges; sphere: radius; cylinder and capsule: radius, length; ellipsoid: three semi-axes; mesh: scale
    # along x, y, z; triangles: none
    size: tuple[float, ...]
    file: Path | None = None  # of a mesh
    triangles: tuple[Array, NDArray[np.int64]] | None = None  # vertices (n, 3) and faces (m, 3)
    name: str = ""  # of the shape in the file; empty without one


CONCAVITY = Range(0.01, 1.0)
"""Concavity of the pieces, as a share of a mesh's size, from close pieces to hulls."""


def check_concavity(concavity: object, links: Iterable[str]) -> Concavity:
    """Check the argument of `urdf_figure` and return it."""
    names = tuple(links)
    if concavity is None:
        return None
    if isinstance(concavity, Mapping):
        return {
            known(link, names, "link", "concavity"): CONCAVITY(value, f"concavity of link {shown(link)}")
            for link, value in concavity.items()
        }
    return CONCAVITY(concavity, "concavity")


def link_pieces(shape: LinkShape, concavity: Concavity) -> tuple[list[tuple[Any, pin.SE3]], tuple[str, ...]]:
    """Convex pieces of one shape, in its own frame, and one sentence on each change of the shape."""
    size, here = shape.size, pin.SE3.Identity()
    if shape.kind in ("mesh", "triangles"):
        share = concavity.get(shape.link) if isinstance(concavity, Mapping) else concavity
        try:
            split = _of_file(shape, share) if shape.file is not None else _of_triangles(shape, share)
        except EmptyMeshError as error:
            return [], (f"{error}, so it is left out",)
        return [(piece.geometry, piece.placement) for piece in split.pieces], split.notes
    size, notes = _solid(size, shape.kind)
    if shape.kind == "box":
        return [(coal.Box(*size), here)], notes
    if shape.kind == "sphere":
        return [(coal.Sphere(size[0]), here)], notes
    if shape.kind == "ellipsoid":
        return [(coal.Ellipsoid(*size), here)], notes
    if shape.kind == "capsule":
        return [(coal.Capsule(size[0], size[1]), here)], notes
    piece = hull_piece(_prism(size[0], size[1]), "cylinder")
    return [(piece.geometry, piece.placement)], notes


def drawn_pieces(visual: pin.GeometryObject, link: str) -> list[tuple[Any, pin.SE3]]:
    """Convex pieces of what is drawn of a link, in the frame of its joint."""
    solid: Any = visual.geometry
    kind = type(solid).__name__.lower()
    if visual.meshPath:
        shape = LinkShape(link, visual.placement, "mesh", tuple(visual.meshScale), Path(visual.meshPath))
    elif isinstance(solid, coal.BVHModelBase):
        shape = LinkShape(link, visual.placement, "triangles", (), triangles=triangles_of(solid))
    elif kind in ("capsule", "cylinder"):
        shape = LinkShape(link, visual.placement, kind, (float(solid.radius), 2.0 * float(solid.halfLength)))
    else:
        return [(solid, visual.placement)]
    return [(piece, shape.placement * placement) for piece, placement in link_pieces(shape, None)[0]]


def triangles_of(mesh: Any) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of coal's mesh."""
    faces = [[mesh.tri_indices(k)[corner] for corner in range(3)] for k in range(mesh.num_tris)]
    return np.array(mesh.vertices(), dtype=float), np.array(faces, dtype=np.int64)


def _solid(size: tuple[float, ...], kind: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Sizes for which coal is reliable, and notes on changes."""
    if min(size) >= SMALLEST:
        return size, ()
    note = f"its {kind} is {min(size):.2g} m thin, so it is made {SMALLEST} m thick"
    return tuple(max(length, SMALLEST) for length in size), (note,)


def _of_file(shape: LinkShape, share: float | None) -> ConvexPieces:
    assert shape.file is not None
    file, what = shape.file, f"mesh {shape.file.name}"
    scale = np.array(shape.size)

    def make() -> ConvexPieces:
        _log.info("link %s: making convex pieces of %s", shape.link, file)
        vertices, faces = read_mesh(file)
        return _pieces(vertices * scale, faces[:, ::-1] if np.prod(scale) < 0.0 else faces, share, what)

    # Kinds of mesh files whose triangles are all in the file itself, so that its content identifies them.
    if file.suffix.lower() not in (".obj", ".stl", ".ply", ".glb", ".dae"):
        return make()
    settings = f"link, closed {HULL_VERTICES} {share!r} {shape.size!r} {file.suffix.lower()} {coacd_version()}"
    return cached((file.read_bytes(),), settings, what, make)


def _of_triangles(shape: LinkShape, share: float | None) -> ConvexPieces:
    assert shape.triangles is not None
    vertices, faces = shape.triangles
    settings = f"link, closed {HULL_VERTICES} {share!r} {coacd_version()}"
    content = (np.ascontiguousarray(vertices).tobytes(), np.ascontiguousarray(faces).tobytes())
    return cached(content, settings, "mesh", lambda: _pieces(vertices, faces, share, "mesh"))


def _pieces(vertices: Array, faces: NDArray[np.int64], share: float | None, what: str) -> ConvexPieces:
    if len(vertices) and np.abs(vertices).max() > LARGEST:
        raise InputError(f"{what}: a vertex lies {np.abs(vertices).max():.4g} m from its origin; is the scale right?")
    if share is None:
        return mesh_hull(vertices, faces, what=what)
    split = convex_pieces(vertices, faces, threshold=share, what=what)
    if split.added_volume <= 0.01:
        return split
    told = f"{what}: its convex pieces ({len(split.pieces)}) have {split.added_volume:.0%} more volume"
    return with_values(split, notes=(*split.notes, told))


def _prism(radius: float, length: float) -> Array:
    """Corners of the prism around a cylinder along z, shape (2 sides, 3)."""
    turn = 2.0 * np.pi * np.arange(CYLINDER_SIDES) / CYLINDER_SIDES
    outside = radius / np.cos(np.pi / CYLINDER_SIDES)
    ring = np.column_stack([outside * np.cos(turn), outside * np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(CYLINDER_SIDES, z)]) for z in (-0.5 * length, 0.5 * length)])
