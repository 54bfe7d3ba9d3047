"""What a robot's file wants drawn: the visuals of its links, in place of the pieces that contacts are measured with."""

from __future__ import annotations

import hashlib
import io
import logging
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import coal
import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.figures.figure import Figure
from wholebody.figures.link_pieces import triangles_of
from wholebody.figures.surface.nets import clustered
from wholebody.geometry.mesh_cache import cached_entry
from wholebody.geometry.meshes import read_parts

MANY = 4000
"""Triangles of one mesh from which what is finer than `FINE` is left out: robots' meshes have up to a million."""

FINE = 0.002  # m

_log = logging.getLogger(__name__)

Color: TypeAlias = tuple[float, float, float, float]
"""Red, green, blue, alpha."""


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
    for shown in figure.visual.geometryObjects if figure.visual is not figure.geometry else ():
        link, joint = str(frames[shown.parentFrame].name), str(names[shown.parentJoint])
        red, green, blue, alpha = (float(part) for part in shown.meshColor)
        given: Color = (red, green, blue, alpha)
        place = np.array(shown.placement.homogeneous)
        if not shown.meshPath:
            solid = shown.geometry
            drawn = triangles_of(solid) if isinstance(solid, coal.BVHModelBase) else solid
            made.append(Drawn(link, joint, place, drawn, given))
            continue
        try:
            parts = mesh_parts(shown.meshPath, tuple(float(part) for part in shown.meshScale))
        except WholebodyError as error:
            _log.info("link %s: its pieces are drawn, as %s", link, error)
            broken.add(link)
            continue
        for vertices, faces, own in parts:
            color = given if own is None or shown.overrideMaterial else own
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
    # The 2 is another one whenever what is kept changes.
    key = hashlib.sha256(f"visual 2 {MANY} {FINE} {scale!r} {place.suffix}".encode() + content).hexdigest()
    return cached_entry(key, make, _packed, _unpacked)


def thinned(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (k, 3) and faces (l, 3) of a mesh without what is finer than `FINE`."""
    kept = clustered(vertices, faces, np.floor(vertices / FINE).astype(np.int64))
    used, local = np.unique(kept, return_inverse=True)
    return vertices[used], local.reshape(-1, 3)


def _packed(parts: MeshParts) -> bytes:
    arrays: dict[str, Any] = {}
    for number, (vertices, faces, color) in enumerate(parts):
        arrays[f"vertices{number}"], arrays[f"faces{number}"] = vertices.astype(np.float32), faces.astype(np.uint32)
        arrays[f"color{number}"] = np.array(() if color is None else color)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _unpacked(data: bytes) -> MeshParts:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        found = []
        for number in range(len(arrays.files) // 3):
            color = [float(part) for part in arrays[f"color{number}"]]
            paint = (color[0], color[1], color[2], color[3]) if color else None
            vertices, faces = arrays[f"vertices{number}"].astype(float), arrays[f"faces{number}"].astype(np.int64)
            found.append((vertices, faces, paint))
        return tuple(found)
