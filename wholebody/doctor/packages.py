"""Installed packages, conflicts between them, and packages that are hidden by others of the same name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from importlib import metadata
from typing import NamedTuple

MODULES = {
    "pin": "pinocchio",
    "coal": "coal",
    "numba": "numba",
    "numpy": "numpy",
    "scipy": "scipy",
    "qpsolvers": "qpsolvers",
    "osqp": "osqp",
    "daqp": "daqp",
    "meshcat": "meshcat",
    "matplotlib": "matplotlib",
    "joblib": "joblib",
    "cloudpickle": "cloudpickle",
    "pillow": "PIL",
    "trimesh": "trimesh",
    "coacd": "coacd",
    "pycollada": "collada",
    "platformdirs": "platformdirs",
    "rich": "rich",
    "jinja2": "jinja2",
    "markdown-it-py": "markdown_it",
}
"""Required packages: distribution -> its module."""

EXTRAS = {
    "placo": "placo",
    "quadprog": "solvers",
    "proxsuite": "solvers",
    "piqp": "solvers",
    "distributed": "cluster",
    "viser": "drag",
    "shtab": "completion",
    "mujoco-core": "mjcf",
    "pin-pink": "compare",
    "mink": "compare",
    "mujoco": "compare",
    "rapier3d": "compare",
    "drake": "drake",
    "optik-py": "optik",
    "embodik": "embodik",
}
"""Optional packages: distribution -> the extra that installs it."""

_EXACT = re.compile(r"^\s*(?P<name>[\w.-]+)\s*==\s*(?P<version>[\w.+!-]+)\s*$")


class Distribution(NamedTuple):
    """An installed distribution.

    Attributes:
        version: its version.
        requires: its requirements, as its metadata states them.
        files: absolute paths of its files; empty if its metadata does not list them.
    """

    version: str
    requires: tuple[str, ...] = ()
    files: frozenset[str] = frozenset()


class Conflict(NamedTuple):
    """Two incompatible packages.

    Attributes:
        who: the one with the requirement.
        needs: its requirement, such as ``pin==3.8.0``.
        found: the installed version; None if there is none.
    """

    who: str
    needs: str
    found: str | None

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
    """Exact versions that an installed package requires and that are not installed.

    Those are the binary interfaces of Pinocchio, coal and placo, which are built against each other.

    Args:
        have: the result of `installed`.
    """
    found = []
    for who, distribution in sorted(have.items()):
        for name, version in exact_needs(distribution):
            other = have.get(name)
            if other is None or other.version != version:
                found.append(Conflict(who, f"{name}=={version}", other.version if other else None))
    return found


def shadow(distribution: Distribution, file: str) -> str | None:
    """Folder from which another package of the same name was imported, or None if the right one was imported.

    Args:
        distribution: the installed distribution.
        file: the file of the imported module.
    """
    if not distribution.files or os.path.realpath(file) in distribution.files:
        return None
    return os.path.dirname(os.path.dirname(file))
