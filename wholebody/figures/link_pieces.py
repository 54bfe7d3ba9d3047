"""A robot's links: the convex pieces that contacts are measured with, and what its file wants drawn."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import known, shown
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.fields import Range
from wholebody.figures.figure import Figure
from wholebody.geometry.convex import HULL_VERTICES, coacd_version, convex_pieces, mesh_hull
from wholebody.geometry.flesh import is_flesh
from wholebody.geometry.hull import cylinder_pieces
from wholebody.geometry.mesh_cache import ConvexPieces, cached, cached_entry
from wholebody.geometry.meshes import EmptyMeshError, read_mesh, read_parts
from wholebody.geometry.pieces import LARGEST, SMALLEST

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


CONCAVITY = Range(0.01, 1.0)  # concavity of the pieces, as a share of a mesh's size, from close pieces to hulls


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
    if shape.kind in ("mesh", "triangles"):
        share = concavity.get(shape.link) if isinstance(concavity, Mapping) else concavity
        try:
            split = _of_file(shape, share) if shape.file is not None else _of_triangles(shape, share)
        except EmptyMeshError as error:
            return [], (f"{error}, so it is left out",)
        return [(piece.geometry, piece.placement) for piece in split.pieces], split.notes
    size, notes = tuple(max(length, SMALLEST) for length in shape.size), tuple[str, ...]()
    if (least := min(shape.size)) < SMALLEST:  # coal is not reliable for less
        notes = (f"its {shape.kind} is {least:.2g} m thin, so it is made {SMALLEST} m thick",)
    if shape.kind != "cylinder":
        return [(getattr(coal, shape.kind.capitalize())(*size), pin.SE3.Identity())], notes
    # its corners protrude by 0.5 % of the radius
    return [(piece.geometry, piece.placement) for piece in cylinder_pieces(size[0], size[1], sides=32)], notes


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
    note = f"{what}: its convex pieces ({len(split.pieces)}) have {split.added_volume:.0%} more volume"
    return with_values(split, notes=(*split.notes, note))


MANY = 4000
"""Triangles of one mesh from which what is finer than `FINE` is left out: robots' meshes have up to a million."""

FINE = 0.002  # m


Color: TypeAlias = tuple[float, float, float, float]  # red, green, blue, alpha


class Drawn(NamedTuple):
    """One object of a link: (4, 4) relative to a joint, coal's shape or vertices (n, 3) and faces (m, 3)."""

    link: str
    joint: str
    placement: Array
    shape: Any
    color: Color


def drawn_of(figure: Figure) -> list[Drawn]:
    """What is drawn of a figure's links; nothing of a link with a mesh that cannot be read: its pieces are drawn."""
    names, frames = figure.model.names, figure.model.frames
    made: list[Drawn] = []
    broken = set()
    for visual in figure.visual.geometryObjects if figure.visual is not figure.geometry else ():
        link, joint = str(frames[visual.parentFrame].name), str(names[visual.parentJoint])
        red, green, blue, alpha = visual.meshColor.tolist()
        given: Color = (red, green, blue, alpha)
        place = np.array(visual.placement.homogeneous)
        if not visual.meshPath or is_flesh(visual):
            solid = visual.geometry
            drawn = triangles_of(solid) if isinstance(solid, coal.BVHModelBase) else solid
            made.append(Drawn(link, joint, place, drawn, given))
            continue
        try:
            parts = mesh_parts(visual.meshPath, tuple(visual.meshScale.tolist()))
        except WholebodyError as error:
            _log.info("link %s: its pieces are drawn, as %s", link, error)
            broken.add(link)
            continue
        for vertices, faces, own in parts:
            color = given if own is None or visual.overrideMaterial else own
            made.append(Drawn(link, joint, place, (vertices, faces), color))
    return [one for one in made if one.link not in broken]


MeshParts = tuple[tuple[Array, NDArray[np.int64], Color | None], ...]


@lru_cache(maxsize=256)
def mesh_parts(path: str, scale: tuple[float, ...]) -> MeshParts:
    """The parts of a mesh file by colour: vertices (n, 3), faces (m, 3), and red, green, blue, alpha if it has any."""
    place = Path(path)

    def make() -> MeshParts:
        turn = slice(None, None, -1 if np.prod(scale) < 0.0 else 1)  # a mirrored face keeps its outer side
        parts = [(vertices * scale, faces[:, turn], color) for vertices, faces, color in read_parts(place)]
        fine = sum(len(faces) for _, faces, _ in parts) <= MANY
        return tuple(part if fine else (*thinned(part[0], part[1]), part[2]) for part in parts)

    try:
        content = place.read_bytes()
    except OSError:
        return make()
    # The 3 is another one whenever what is kept changes.
    key = hashlib.sha256(f"visual 3 {MANY} {FINE} {scale!r} {place.suffix}".encode() + content).hexdigest()
    kept: MeshParts = cached_entry(key, make)
    return kept


def thinned(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (k, 3) and faces (l, 3) of a mesh without what is finer than `FINE`."""
    from wholebody.figures.surface.nets import clustered  # who draws nothing does not load how surfaces are made

    kept = clustered(vertices, faces, np.floor(vertices / FINE).astype(np.int64))
    used, local = np.unique(kept, return_inverse=True)
    return vertices[used], local.reshape(-1, 3)
