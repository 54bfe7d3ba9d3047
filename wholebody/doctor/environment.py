"""Faults of the environment: Python's version, and search paths that hide packages and libraries."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

OLDEST, NEWEST = (3, 10), (3, 13)
LIBRARIES = ("libpinocchio", "libcoal", "libhpp-fcl", "libeigenpy", "libboost_python", "liburdfdom", "libassimp")
"""Shared libraries of which other versions break those of the wheels."""


def python_fault(version: tuple[int, int] = sys.version_info[:2]) -> str | None:
    """Say what is wrong with the interpreter's version, if anything."""
    if OLDEST <= version <= NEWEST:
        return None
    return f"Python {version[0]}.{version[1]} is not one of 3.10 to 3.13, for which all packages exist"


def shadowing_folders(environ: Mapping[str, str], modules: Iterable[str]) -> dict[str, list[str]]:
    """Folders of PYTHONPATH with modules of these names, for example after sourcing ROS or another workspace.

    Returns:
        Folder -> the modules in it.
    """
    found: dict[str, list[str]] = {}
    for folder in _folders(environ, "PYTHONPATH"):
        hidden = sorted({name for name in modules if (folder / name).is_dir() or (folder / f"{name}.py").is_file()})
        if hidden:
            found[str(folder)] = hidden
    return found


def loader_folders(environ: Mapping[str, str]) -> dict[str, list[str]]:
    """Folders of LD_LIBRARY_PATH with libraries that would be loaded in place of the wheels' own.

    Returns:
        Folder -> the libraries in it.
    """
    found: dict[str, list[str]] = {}
    for folder in _folders(environ, "LD_LIBRARY_PATH"):
        hidden = [name for name in LIBRARIES if any(folder.glob(f"{name}*.so*"))]
        if hidden:
            found[str(folder)] = hidden
    return found


def _folders(environ: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(entry) for entry in environ.get(variable, "").split(os.pathsep) if entry and os.path.isdir(entry)]
