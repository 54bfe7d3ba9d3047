"""Mesh files: OBJ, STL, PLY, glTF, GLB and COLLADA, read through trimesh."""

from __future__ import annotations

import logging
from codecs import BOM_UTF8
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.checks import is_number
from wholebody.base.errors import FileFormatError, InputError, MissingPackageError, WholebodyError, one_line
from wholebody.base.files import check_file
from wholebody.geometry.convex import check_mesh

SUFFIXES = (".obj", ".stl", ".ply", ".gltf", ".glb", ".dae")

Y_UP: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation for files whose y points up (glTF by its standard, and most modelling programs): a quarter turn about x."""


GLTF: Array = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation for glTF by its standard, y up and z to the front, into z up and x to the front, as `Viewer.save` has it."""


class EmptyMeshError(FileFormatError):
    """A mesh file that is sound, but has no triangles in it."""


def read_mesh(path: str | Path) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of an OBJ, STL, PLY, glTF, GLB or COLLADA (.dae) file, every object placed.

    They have the file's units and axes; a COLLADA file that names its unit is converted to metres, and its up axis is
    ignored, as in the tools of ROS. FileFormatError for a file without triangles, or damaged; MissingPackageError for
    COLLADA without pycollada.
    """
    path = Path(path)
    if (bent := _bent(path)) is not None:
        starts = np.cumsum([0, *(len(corners) for corners, *_ in bent)])
        every = [start + part for start, (_, part, _) in zip(starts, bent, strict=False)]
        return _checked(np.concatenate([corners for corners, *_ in bent]), np.concatenate(every), path)
    scene, unit = _read_scene(path)
    try:
        mesh = scene.to_mesh()
        vertices, faces = unit * np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
    except Exception as error:
        raise _unreadable(path, error) from error
    return _checked(vertices, faces, path)


def read_parts(path: str | Path) -> list[tuple[Array, NDArray[np.int64], tuple[float, float, float, float] | None]]:
    """Read a file as `read_mesh` does, each object alone: vertices, faces, and colour (a texture's mean) or None."""
    path = Path(path)
    if (bent := _bent(path)) is not None:
        return [(*_checked(vertices, faces, path), color) for vertices, faces, color in bent]
    scene, unit = _read_scene(path)
    found = []
    try:
        for node in sorted(scene.graph.nodes_geometry):  # trimesh keeps them in a set
            placed, name = scene.graph[node]
            mesh = scene.geometry[name].copy().apply_transform(placed)
            if len(getattr(mesh, "faces", ())):
                vertices, faces = unit * np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
                found.append((*_checked(vertices, faces, path), _color(mesh.visual)))
    except WholebodyError:
        raise
    except Exception as error:
        raise _unreadable(path, error) from error
    if not found:
        raise EmptyMeshError(f"mesh {path}: it has no triangles")
    return found


def _bent(path: Path) -> list[tuple[Array, NDArray[np.int64], tuple[float, float, float, float]]] | None:
    """The parts of a glTF file whose meshes bones bend, which trimesh leaves as they were bound; None of others."""
    if path.suffix.lower() not in (".gltf", ".glb"):
        return None
    from wholebody.geometry.gltf import GltfDocument

    check_file(path, "mesh")
    check_content(path)
    document = GltfDocument(path)
    found = document.meshes() if document.tree.get("skins") else None
    if found == []:
        raise EmptyMeshError(f"mesh {path}: there are no triangles in it")
    return found


def _color(visual: Any) -> tuple[float, float, float, float] | None:
    if not visual.defined:
        return None
    whole = visual.material.main_color if hasattr(visual, "material") else visual.main_color
    if getattr(getattr(visual, "material", None), "image", None) is not None:
        whole = np.append(np.asarray(visual.material.image.convert("RGB")).reshape(-1, 3).mean(axis=0), 255)
    red, green, blue, alpha = (float(part) / 255.0 for part in whole)
    return red, green, blue, alpha if alpha > 0.0 else 1.0  # exporters confuse opacity and transparency


def _read_scene(path: Path) -> tuple[Any, float]:
    """The file as trimesh reads it, and the metres of its unit."""
    import trimesh

    check_file(path, "mesh")
    if path.suffix.lower() not in SUFFIXES:
        raise FileFormatError(
            f"mesh {path}: {path.suffix or 'no suffix'} is not among {', '.join(SUFFIXES)}; convert the file"
        )
    check_content(path)
    if path.suffix.lower() == ".dae" and find_spec("collada") is None:
        raise MissingPackageError(f"mesh {path}: reading COLLADA files needs pycollada: pip install pycollada")
    quiet = logging.getLogger("trimesh")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)
    try:
        if (part := _part_of(path)) is None:
            scene = trimesh.load_scene(path, process=False)
        else:
            beside = trimesh.resolvers.FilePathResolver(path)
            scene = trimesh.load_scene(part, file_type=path.suffix[1:].lower(), resolver=beside, process=False)
        # trimesh writes the unit of a COLLADA file as "meters", or "0.0254 * meters"
        unit = (scene.units or "").partition("*")[0] if path.suffix.lower() == ".dae" else ""
        return scene, float(unit) if is_number(unit) else 1.0
    except Exception as error:  # trimesh's readers raise many kinds of errors
        raise _unreadable(path, error) from error
    finally:
        quiet.setLevel(level)


def check_content(path: Path) -> None:
    """Refuse what is no mesh whatever its name says: an empty file, a pointer of Git LFS, a web page, a cut STL."""
    size = path.stat().st_size
    if size == 0:
        raise FileFormatError(f"mesh {path}: the file is empty")
    with path.open("rb") as file:
        head = file.read(512)
    if head.startswith(b"version https://git-lfs"):
        raise FileFormatError(f"mesh {path}: the file is a pointer of Git LFS, not the mesh; run: git lfs pull")
    if head.lstrip()[:14].lower().startswith((b"<!doctype html", b"<html")):
        raise FileFormatError(f"mesh {path}: the file is a web page, not the mesh; download the file itself")
    wanted = _bytes_of_stl(path)
    if wanted is not None and size < wanted:
        raise FileFormatError(f"mesh {path}: the file has {size} bytes of {wanted}; it is truncated; fetch it again")


def _part_of(path: Path) -> BytesIO | None:
    """What trimesh is to read of a file whose first or last bytes it misreads; None for others."""
    wanted = _bytes_of_stl(path)
    if wanted is not None and wanted < path.stat().st_size:  # with more at its end it would be text
        return BytesIO(path.read_bytes()[:wanted])
    with path.open("rb") as file:
        marked = path.suffix.lower() == ".obj" and file.read(len(BOM_UTF8)) == BOM_UTF8  # its first line would be lost
        return BytesIO(file.read()) if marked else None


def _bytes_of_stl(path: Path) -> int | None:
    """How many bytes a binary STL has by its own count of triangles; None for other files."""
    with path.open("rb") as file:
        head = file.read(512)
    text = head.lstrip()[:5].lower() == b"solid" and b"\0" not in head  # some binary ones begin with "solid" too
    if path.suffix.lower() != ".stl" or len(head) < 84 or text:
        return None
    return 84 + 50 * int.from_bytes(head[80:84], "little")


def _unreadable(path: Path, error: Exception) -> FileFormatError:
    return FileFormatError(
        f"mesh {path}: it cannot be read ({type(error).__name__}: {one_line(str(error))}); export it again"
    )


def _checked(vertices: Array, faces: NDArray[np.int64], path: Path) -> tuple[Array, NDArray[np.int64]]:
    if not len(faces):
        raise EmptyMeshError(f"mesh {path}: it has no triangles")
    try:
        return check_mesh(vertices, faces, f"mesh {path}")
    except InputError as error:
        raise FileFormatError(str(error)) from error
