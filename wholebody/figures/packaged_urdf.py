"""The URDF files and tasks in the package: their folders, and writing them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.base.errors import UnknownNameError, WholebodyError
from wholebody.base.files import checked_ending, make_folder, write

if TYPE_CHECKING:
    from wholebody.figures.anthropometry import Person


def urdf_folder() -> Path:
    """Return the folder of the packaged URDFs: inside an installed package, or at the top of a checkout.

    Raises:
        WholebodyError: the installation lacks it.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "urdf", package.parent / "urdf"):
        if (folder / "human.urdf").is_file():
            return folder
    raise WholebodyError(f"there is no urdf folder in or beside {package}; install wholebody again")


def urdf_path(name: str) -> Path:
    """Return the path of a packaged URDF: "human", "avatar" or "hand".

    Raises:
        UnknownNameError: there is no such file.
    """
    folder = urdf_folder()
    path = folder / f"{name}.urdf"
    if not path.is_file():
        raise UnknownNameError("packaged URDF", name, [file.stem for file in folder.glob("*.urdf")])
    return path


def task_paths() -> dict[str, Path]:
    """Return the packaged task files by name: inside an installed package, or among the examples of a checkout.

    Raises:
        WholebodyError: the installation lacks them.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "examples", package.parent / "examples" / "tasks"):
        if (folder / "shelf.toml").is_file():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    raise WholebodyError(f"there are no examples in or beside {package}; install wholebody again")


def write_human(path: str | os.PathLike[str], person: Person, hands: str = "rigid") -> None:
    """Write the URDF of a person, pieces as capsules and boxes; `hands` as for `human_spec`.

    Raises:
        InputError: the name does not end in .urdf, or the file cannot be written.
    """
    from wholebody.figures.body_spec import urdf_text
    from wholebody.figures.human.figure import figure_of
    from wholebody.figures.human.spec import human_spec
    from wholebody.figures.urdf.extension import extension_text

    target, spec = checked_ending(path, "write_human: path", "a person", (".urdf",)), human_spec(person, hands=hands)
    _write(target, urdf_text(spec, extension_text(figure_of(spec, "capsules", person.sex))))


def packaged_files() -> dict[str, str]:
    """Return the text of every packaged file below ``urdf/``: the median man, his avatar and his right hand."""
    from wholebody.figures.body_spec import urdf_text
    from wholebody.figures.hand import MESH, hand_figure, hand_spec
    from wholebody.figures.human.figure import avatar_figure, avatar_spec, human_figure
    from wholebody.figures.human.spec import human_spec
    from wholebody.figures.urdf.extension import extension_text

    return {
        "human.urdf": urdf_text(human_spec(), extension_text(human_figure())),
        "avatar.urdf": urdf_text(avatar_spec(), extension_text(avatar_figure())),
        "hand.urdf": urdf_text(hand_spec(), extension_text(hand_figure())),
        MESH: ellipsoid_obj(),
    }


def write_packaged(folder: str | os.PathLike[str]) -> None:
    """Write every packaged file below a folder."""
    for name, text in packaged_files().items():
        _write(Path(folder) / name, text)


def ellipsoid_obj() -> str:
    """Return the unit polyhedron of the hand's parts as an OBJ; of STL files MuJoCo reads binary ones only."""
    from wholebody.figures import hulls

    vertices, triangles = hulls.unit_sphere()
    lines = [f"v {' '.join(f'{value + 0.0:.12g}' for value in vertex)}" for vertex in vertices.round(15)]
    lines += [f"f {' '.join(str(k + 1) for k in triangle)}" for triangle in triangles.tolist()]
    return "\n".join(lines) + "\n"


def _write(path: Path, text: str) -> None:
    make_folder(path.parent)
    write(path, text)
