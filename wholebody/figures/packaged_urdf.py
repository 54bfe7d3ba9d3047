"""The URDF files, tasks and example scripts in the package: their folders, and writing them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from wholebody.base.errors import UnknownNameError, WholebodyError
from wholebody.base.files import checked_ending, make_folder, write

if TYPE_CHECKING:
    from wholebody.figures.anthropometry import Person


def urdf_folder() -> Path:
    """Return the folder of the packaged URDFs: inside an installed package, or at the top of a checkout."""
    return _folder("urdf", "human.urdf")


def urdf_path(name: str) -> Path:
    """Return the path of a packaged URDF: "human", "avatar" or "hand".

    Raises:
        UnknownNameError: there is no such file.

    Examples:
        >>> wb.figures.urdf_path("hand").name
        'hand.urdf'
    """
    path = urdf_folder() / f"{name}.urdf"
    if not path.is_file():
        raise UnknownNameError("packaged URDF", name, [file.stem for file in path.parent.glob("*.urdf")])
    return path


def task_paths() -> dict[str, Path]:
    """Return the packaged task files by name: inside an installed package, or among the examples of a checkout."""
    return _files("examples/tasks", "*.toml", "shelf.toml")


def script_paths() -> dict[str, Path]:
    """Return the packaged example scripts by name: inside an installed package, or among those of a checkout."""
    found = _files("examples", "*.py", "shelf.py")
    del found["presenting"]
    return found


def client_paths() -> dict[str, Path]:
    """Return the packaged clients of published problems by name, as `script_paths` does, and raises."""
    return _files("examples/clients", "*.py", "plain_pinocchio.py")


def _files(name: str, pattern: str, file: str) -> dict[str, Path]:
    return {path.stem: path for path in sorted(_folder(name, file).glob(pattern))}


def _folder(name: str, file: str) -> Path:
    """A folder that has a file: in the package, or beside it."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / name, package.parent / name):
        if (folder / file).is_file():
            return folder
    raise WholebodyError(f"there is no {name} folder in or beside {package}; install wholebody again")


def write_human(path: str | os.PathLike[str], person: Person, hands: str = "rigid") -> None:
    """Write the URDF of a person, pieces as capsules and boxes; `hands` as for `human_spec`."""
    from wholebody.figures.body_spec import urdf_text
    from wholebody.figures.human.figure import figure_of
    from wholebody.figures.human.spec import human_spec
    from wholebody.figures.urdf.extension import extension_text

    target, spec = checked_ending(path, "write_human: path", "a person", (".urdf",)), human_spec(person, hands=hands)
    make_folder(target.parent)
    write(target, urdf_text(spec, extension_text(figure_of(spec, "capsules", person.sex))))
