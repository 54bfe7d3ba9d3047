"""Mesh files: OBJ, STL, glTF and GLB, read through trimesh."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wholebody.errors import FileFormatError, InputError, MissingPackageError
from wholebody.files import check_file
from wholebody.geometry.convex import check_mesh
from wholebody.geometry.pieces import Array

SUFFIXES = (".obj", ".stl", ".gltf", ".glb")

Y_UP: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns a file whose y points up (glTF by its standard, and most modelling programs): a quarter turn about x."""


def read_mesh(path: str | Path) -> tuple[Array, NDArray[np.int64]]:
    """Read all triangles of a file, every object of it in its place.

    Args:
        path: an OBJ, STL, glTF or GLB file; polygons are cut into triangles.

    Returns:
        vertices (n, 3) in the file's units and axes, faces (m, 3).

    Raises:
        FileFormatError: missing, empty, of another kind, damaged, without triangles, or not finite.
        MissingPackageError: trimesh is not installed.
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
    quiet = logging.getLogger("trimesh")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)
    try:
        mesh = trimesh.load_scene(path, process=False).to_mesh()
        vertices, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
    except Exception as error:  # trimesh's readers raise whatever they stumble over
        raise FileFormatError(
            f"mesh {path}: it cannot be read ({type(error).__name__}: {error}); export it again"
        ) from error
    finally:
        quiet.setLevel(level)
    if not len(faces):
        raise FileFormatError(f"mesh {path}: there are no triangles in it")
    try:
        return check_mesh(vertices, faces, f"mesh {path}")
    except InputError as error:
        raise FileFormatError(str(error)) from error
