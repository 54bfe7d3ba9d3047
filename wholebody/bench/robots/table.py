"""Loading and reaching with every description of a folder, and the page about it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from wholebody.bench.report import render
from wholebody.bench.robots.reaching import Loaded, examine
from wholebody.errors import InputError
from wholebody.files import Scratch
from wholebody.geometry.mesh_cache import VARIABLE
from wholebody.runner import Child, EndedError

LONGEST = 300.0
"""Seconds after which a description is given up."""

REACHES = 12
"""Reaches of each robot."""


@dataclass(frozen=True)
class Robot:
    """One description.

    Attributes:
        name: its path below the folder.
        first: loaded with an empty cache.
        again: loaded once more, and reached with; None where the first was not loaded.
    """

    name: str
    first: Loaded
    again: Loaded | None

    @property
    def refusal(self) -> str:
        """The sentence with the file's path shortened to its name below the folder."""
        _, found, tail = self.first.refused.partition(self.name)
        return f"{self.name}{tail}" if found else self.first.refused


def descriptions(folder: Path) -> list[Path]:
    """Return the URDF and MJCF files below a folder.

    Raises:
        InputError: no folder, or no description in it.
    """
    if not os.path.isdir(folder):
        raise InputError(f"{folder}: there is no such folder; give one that holds robot descriptions")
    found = sorted(folder.rglob("*.urdf")) + sorted(path for path in folder.rglob("*.xml") if _is_mjcf(path))
    if not found:
        raise InputError(f"{folder}: there are no .urdf files and no MJCF files below it")
    return found


def _is_mjcf(path: Path) -> bool:
    try:
        _, outermost = next(iter(ElementTree.iterparse(path, events=["start"])))
        return bool(outermost.tag == "mujoco")
    except (ElementTree.ParseError, StopIteration, OSError, LookupError, ValueError):
        return False


def measure(folder: Path, reaches: int) -> Iterator[Robot]:
    """Load every description twice, each time in a process of its own, and reach with it.

    Args:
        folder: that holds the descriptions; it and its parents are looked up for packages.
        reaches: of each robot.
    """
    for path in descriptions(folder):
        with Scratch() as cache:
            first = _examined(path, 0, str(cache))
            again = _examined(path, reaches, str(cache)) if not first.refused else None
        yield Robot(str(path.relative_to(folder)), first, again)


def _examined(path: Path, reaches: int, cache: str) -> Loaded:
    child = Child({VARIABLE: cache, "OMP_NUM_THREADS": "1"})
    try:
        found: Loaded = child.call(examine, str(path), reaches, seconds=LONGEST)
    except EndedError as error:
        refused = f"it takes more than {LONGEST:g} s" if error.overtime else str(error)
        return Loaded(LONGEST if error.overtime else 0.0, refused=refused)
    finally:
        child.close()
    return found


def page(robots: list[Robot], facts: Mapping[str, str], reaches: int) -> str:
    """Return the page on robots as Markdown."""
    return render("robots.md", robots=robots, facts=facts, reaches=reaches) + "\n"
