"""Writing the URDFs that come with the package."""

from __future__ import annotations

import os
from pathlib import Path

from wholebody.figures import hulls
from wholebody.figures.anthropometry import Body
from wholebody.figures.avatar import avatar_blueprint
from wholebody.figures.blueprint import urdf_text
from wholebody.figures.hand import MESH, hand_blueprint
from wholebody.figures.human import blueprint
from wholebody.files import make_folder, write


def write_human(path: str | os.PathLike[str], person: Body) -> None:
    """Write the URDF of a person, pieces as capsules and boxes."""
    _write(Path(path), urdf_text(blueprint(person)))


def shipped_files() -> dict[str, str]:
    """Return the text of every shipped file below ``urdf/``: the median man, his avatar and his right hand."""
    return {
        "human.urdf": urdf_text(blueprint()),
        "avatar.urdf": urdf_text(avatar_blueprint()),
        "hand.urdf": urdf_text(hand_blueprint()),
        MESH: ellipsoid_stl(),
    }


def write_shipped(folder: str | os.PathLike[str]) -> None:
    """Write every shipped file below a folder."""
    for name, text in shipped_files().items():
        _write(Path(folder) / name, text)


def ellipsoid_stl() -> str:
    """Return the unit polyhedron of the hand's parts as an ASCII STL."""
    vertices, triangles = hulls.unit_sphere()
    lines = ["solid ellipsoid"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {' '.join(f'{value + 0.0:.12g}' for value in vertices[k].round(15))}" for k in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid ellipsoid"]) + "\n"


def _write(path: Path, text: str) -> None:
    make_folder(path.parent)
    write(path, text)
