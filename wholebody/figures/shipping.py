"""Writing the URDFs that come with the package."""

from __future__ import annotations

import os
from pathlib import Path

from wholebody.figures import hulls
from wholebody.figures.anthropometry import Body
from wholebody.figures.avatar import avatar_blueprint, avatar_figure
from wholebody.figures.blueprint import urdf_text
from wholebody.figures.hand import MESH, hand_blueprint, hand_figure
from wholebody.figures.human import blueprint
from wholebody.figures.human_figure import figure_of, human_figure
from wholebody.figures.urdf_extension import extension_text
from wholebody.files import make_folder, write


def write_human(path: str | os.PathLike[str], person: Body) -> None:
    """Write the URDF of a person, pieces as capsules and boxes."""
    plan = blueprint(person)
    _write(Path(path), urdf_text(plan, extension_text(figure_of(plan, "capsules"))))


def shipped_files() -> dict[str, str]:
    """Return the text of every shipped file below ``urdf/``: the median man, his avatar and his right hand."""
    return {
        "human.urdf": urdf_text(blueprint(), extension_text(human_figure())),
        "avatar.urdf": urdf_text(avatar_blueprint(), extension_text(avatar_figure())),
        "hand.urdf": urdf_text(hand_blueprint(), extension_text(hand_figure())),
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
