"""Installed packages, conflicts between them, Python's version, and search paths that hide packages and libraries."""

from __future__ import annotations

import csv
import os
import re
import sys
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

with Path(__file__).with_name("packages.csv").open(encoding="utf-8", newline="") as _file:
    _ROWS = list(csv.DictReader(_file))

MODULES = {row["name"]: row["module"] for row in _ROWS if row["module"]}
"""Required packages: distribution -> its module."""

EXTRAS = {row["name"]: row["extra"] for row in _ROWS if row["extra"]}
"""Optional packages: distribution -> the extra that installs it."""

LIBRARIES = ("libpinocchio", "libcoal", "libhpp-fcl", "libeigenpy", "libboost_python", "liburdfdom", "libassimp")
"""Shared libraries of which other versions break those of the wheels."""

_EXACT = re.compile(r"^\s*(?P<name>[\w.-]+)\s*==\s*(?P<version>[\w.+!-]+)\s*$")


class Distribution(NamedTuple):
    """An installed distribution."""

    version: str  # its version
    requires: tuple[str, ...] = ()  # its requirements, as its metadata states them
    files: frozenset[str] = frozenset()  # absolute paths of its files; empty if its metadata does not list them


class Conflict(NamedTuple):
    """Two incompatible packages."""

    who: str  # the one with the requirement
    needs: str  # its requirement, such as ``pin==3.8.0``
    found: str | None  # the installed version; None if there is none

    @property
    def repair(self) -> str:
        """The command that repairs it."""
        return f"pip install '{self.needs}'" if self.who == "wholebody" else f"pip install '{self.who}' '{self.needs}'"

    def __str__(self) -> str:
        """Return one sentence."""
        found = f"{self.found} is installed" if self.found else "it is not installed"
        return f"{self.who} needs {self.needs}, and {found}"


def normal(name: str) -> str:
    """Spell a distribution's name as indexes do (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(names: Iterable[str]) -> dict[str, Distribution]:
    """The installed ones of the named distributions, and the distributions that they require in an exact version."""
    found: dict[str, Distribution] = {}
    left = [normal(name) for name in names]
    seen = set(left)
    while left:
        name = left.pop()
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        files = frozenset(os.path.realpath(str(file.locate())) for file in distribution.files or ())
        found[name] = Distribution(distribution.version, tuple(distribution.requires or ()), files)
        needed = {other for other, _ in exact_needs(found[name])} - seen
        seen |= needed
        left += needed
    return found


def exact_needs(distribution: Distribution) -> list[tuple[str, str]]:
    """Requirements of the form ``name==version`` without a condition: (name, version)."""
    matches = (_EXACT.match(requirement) for requirement in distribution.requires)
    return [(normal(match["name"]), match["version"]) for match in matches if match]


def conflicts(have: Mapping[str, Distribution]) -> list[Conflict]:
    """Exact versions that an installed package requires and that are not installed: pin, coal, placo are so built."""
    found = []
    for who, distribution in sorted(have.items()):
        for name, version in exact_needs(distribution):
            other = have.get(name)
            if other is None or other.version != version:
                found.append(Conflict(who, f"{name}=={version}", other.version if other else None))
    return found


def shadow(distribution: Distribution, file: str) -> str | None:
    """Folder from which another package of the same name was imported, or None if the right one was imported."""
    if not distribution.files or os.path.realpath(file) in distribution.files:
        return None
    return os.path.dirname(os.path.dirname(file))


def python_fault(version: tuple[int, int] = sys.version_info[:2]) -> str | None:
    """Say what is wrong with the interpreter's version, if anything."""
    if (3, 10) <= version <= (3, 14):
        return None
    return f"Python {version[0]}.{version[1]} is not one of 3.10 to 3.14, for which the required packages exist"


def shadowing_folders(environ: Mapping[str, str], modules: Iterable[str]) -> dict[str, list[str]]:
    """Folders of PYTHONPATH, as after sourcing a workspace of ROS, with modules of these names: folder -> modules."""
    found: dict[str, list[str]] = {}
    for folder in _folders(environ, "PYTHONPATH"):
        hidden = sorted({name for name in modules if (folder / name).is_dir() or (folder / f"{name}.py").is_file()})
        if hidden:
            found[str(folder)] = hidden
    return found


def loader_folders(environ: Mapping[str, str]) -> dict[str, list[str]]:
    """Folders of LD_LIBRARY_PATH with libraries that would replace the wheels' own: folder -> libraries."""
    found: dict[str, list[str]] = {}
    for folder in _folders(environ, "LD_LIBRARY_PATH"):
        hidden = [name for name in LIBRARIES if any(folder.glob(f"{name}*.so*"))]
        if hidden:
            found[str(folder)] = hidden
    return found


def _folders(environ: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(entry) for entry in environ.get(variable, "").split(os.pathsep) if entry and os.path.isdir(entry)]
