"""Search for the meshes of a robot description, by path or in a package, by the rules of ROS."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from wholebody.checks import shown
from wholebody.errors import FileFormatError

SCHEMES = ("package://", "model://")


def find_mesh(
    name: str, place: str, path: Path, package_dirs: Sequence[Path], environ: Mapping[str, str] = os.environ
) -> Path:
    """Find a mesh.

    A path is looked up beside the file and in `package_dirs`; ``package://<package>/<path>`` in `package_dirs`, the
    file's parents, the folders of ROS_PACKAGE_PATH, and ``share`` below those of AMENT_PREFIX_PATH. A folder may hold
    packages or be one.

    Args:
        name: the mesh's name in the file.
        place: of the mesh in the file, for messages.
        path: of the file.
        package_dirs: the caller's folders.
        environ: the environment variables.

    Raises:
        FileFormatError: no name, or no such file.
    """
    if not name.strip():
        raise FileFormatError(f"{place} has a mesh without filename; add it")
    folder = Path(os.path.abspath(path)).parent
    if name.startswith(SCHEMES):
        parts = [part for part in name.split("://", 1)[1].split("/") if part not in ("", ".")]
        if not parts or ".." in parts[:1]:
            raise FileFormatError(f"{place}: the mesh {shown(name)} names no package; write package://<package>/<path>")
        bases = [*package_dirs, folder, *folder.parents, *_ros_folders(environ)]
        candidates = [base.joinpath(*tail) for base in bases for tail in (parts, parts[1:]) if tail]
    else:
        plain = Path(name.removeprefix("file://"))
        candidates = [plain if plain.is_absolute() else folder / plain, *(base / plain for base in package_dirs)]
    for candidate in candidates:
        if _is_file(candidate):
            return candidate
    raise FileFormatError(
        f"{place}: the mesh {shown(name)} is not found; put it in place, or name the folder of its package in "
        "package_dirs or ROS_PACKAGE_PATH"
    )


def _ros_folders(environ: Mapping[str, str]) -> list[Path]:
    folders = [Path(entry) for entry in environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
    return folders + [
        Path(entry) / "share" for entry in environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry
    ]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, or with a zero byte
        return False
