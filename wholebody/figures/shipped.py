"""Where the URDF files and tasks that come with the package are."""

from __future__ import annotations

from pathlib import Path

from wholebody.errors import UnknownNameError, WholebodyError


def urdf_folder() -> Path:
    """Return the folder of the shipped URDFs: inside an installed package, or at the top of a checkout.

    Raises:
        WholebodyError: the installation lacks it.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "urdf", package.parent / "urdf"):
        if (folder / "human.urdf").is_file():
            return folder
    raise WholebodyError(f"there is no urdf folder in or beside {package}; install wholebody again")


def urdf_path(name: str) -> Path:
    """Return the path of a shipped URDF: "human", "avatar" or "hand".

    Raises:
        UnknownNameError: there is no such file.
    """
    folder = urdf_folder()
    path = folder / f"{name}.urdf"
    if not path.is_file():
        raise UnknownNameError("shipped URDF", name, [file.stem for file in folder.glob("*.urdf")])
    return path


def task_paths() -> dict[str, Path]:
    """Return the shipped task files by name: inside an installed package, or among the examples of a checkout.

    Raises:
        WholebodyError: the installation lacks them.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "examples", package.parent / "examples" / "tasks"):
        if (folder / "shelf.toml").is_file():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    raise WholebodyError(f"there are no examples in or beside {package}; install wholebody again")
