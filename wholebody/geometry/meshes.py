"""Mesh files: OBJ, STL, glTF, GLB and COLLADA, read through trimesh."""

from __future__ import annotations

import logging
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.errors import FileFormatError, InputError, MissingPackageError, one_line
from wholebody.files import check_file
from wholebody.geometry.convex import check_mesh

SUFFIXES = (".obj", ".stl", ".gltf", ".glb", ".dae")

Y_UP: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation for files whose y points up (glTF by its standard, and most modelling programs): a quarter turn about x."""


class EmptyMeshError(FileFormatError):
    """A mesh file that is sound, but has no triangles in it."""


def read_mesh(path: str | Path) -> tuple[Array, NDArray[np.int64]]:
    """Read all triangles of a file, every object at its placement.

    Args:
        path: an OBJ, STL, glTF, GLB or COLLADA (.dae) file; polygons are cut into triangles.

    Returns:
        vertices (n, 3) in the file's units and axes, faces (m, 3). A COLLADA file that names its unit is converted to
        metres, and its up axis is ignored, as in the tools of ROS.

    Raises:
        FileFormatError: missing, empty, of another kind, damaged, without triangles, or not finite.
        MissingPackageError: trimesh, or for a COLLADA file pycollada, is not installed.
    """
    try:
        import trimesh
    except ImportError:
        raise MissingPackageError("reading meshes needs trimesh: pip install trimesh") from None
    path = Path(path)
    check_file(path, "mesh")
    if path.suffix.lower() not in SUFFIXES:
        raise FileFormatError(
            f"mesh {path}: {path.suffix or 'no suffix'} is not among {', '.join(SUFFIXES)}; convert the file"
        )
    if path.stat().st_size == 0:
        raise FileFormatError(f"mesh {path}: the file is empty")
    if path.suffix.lower() == ".dae" and find_spec("collada") is None:
        raise MissingPackageError(f"mesh {path}: reading COLLADA files needs pycollada: pip install pycollada")
    quiet = logging.getLogger("trimesh")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)
    try:
        scene = trimesh.load_scene(path, process=False)
        mesh = scene.to_mesh()
        vertices, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
        if path.suffix.lower() == ".dae":
            vertices *= _metres(scene.units)
    except Exception as error:  # trimesh's readers raise many kinds of errors
        raise FileFormatError(
            f"mesh {path}: it cannot be read ({type(error).__name__}: {one_line(str(error))}); export it again"
        ) from error
    finally:
        quiet.setLevel(level)
    if not len(faces):
        raise EmptyMeshError(f"mesh {path}: there are no triangles in it")
    try:
        return check_mesh(vertices, faces, f"mesh {path}")
    except InputError as error:
        raise FileFormatError(str(error)) from error


def _metres(unit: str | None) -> float:
    """Metres of a unit as trimesh writes it for COLLADA files: "meters", or "0.0254 * meters"."""
    number = (unit or "").partition("*")[0]
    try:
        return float(number)
    except ValueError:
        return 1.0
