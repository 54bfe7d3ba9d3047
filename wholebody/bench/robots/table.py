"""Loading and reaching with every description of a folder, and the page about it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from wholebody.bench.machine import sentence
from wholebody.bench.robots.reaching import Loaded, examine
from wholebody.bench.tables import markdown
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
    loaded = [robot for robot in robots if robot.again is not None]
    refused = [robot for robot in robots if robot.again is None]
    reached = [robot.again for robot in loaded if robot.again is not None and robot.again.times]
    medians = [float(np.median(robot.times)) for robot in reached]
    whole = sum(robot.solved == len(robot.times) for robot in reached)
    free = sum(robot.first.free > 0.0 for robot in loaded)
    lines = [
        "# Robots",
        "",
        "Robot descriptions of others, loaded as they are. This page is written by "
        "`wholebody bench robots FOLDER --update-docs`.",
        "",
        f"- {len(loaded)} of {len(robots)} descriptions load; {_slowest(loaded)}.",
        f"- {free} of {len(loaded)} default postures are free of self-contact; "
        f"{sum(robot.first.left_out for robot in loaded)} pairs could not be parted and are left out.",
        f"- {whole} of {len(reached)} robots solve all of their {reaches} reaches; the median over the robots of the "
        f"median time of a reach is {_ms(float(np.median(medians)) if medians else 0.0)} ms.",
        "",
        "The columns: CPU time of loading with an empty cache and again; degrees of freedom; convex pieces; pairs "
        "that can touch; notes on what was changed about the geometry; least distance of any pair in the default "
        "posture, mm; reaches solved; CPU time of a reach, ms. A reach brings the tip of a chain from the default "
        "posture to where a random posture free of contact has it, without touching itself; the chains take turns, "
        "the longest first.",
        "",
        markdown(
            ("description", "first, s", "again, s", "freedoms", "pieces", "pairs", "notes", "free, mm", "solved",
             "median", "p95"),
            [_row(robot) for robot in loaded],
        ),
    ]  # fmt: skip
    if refused:
        lines += ["", "Refused:", ""]
        lines += [f"- `{robot.name}`: {_without_folder(robot.first.refused, robot.name)}" for robot in refused]
    return "\n".join([*lines, "", sentence(facts)]) + "\n"


def _slowest(loaded: list[Robot]) -> str:
    pairs = [(robot.first.seconds, robot.again.seconds) for robot in loaded if robot.again is not None]
    if not pairs:
        return "none was measured"
    first, again = (max(column) for column in zip(*pairs, strict=True))
    return f"the slowest takes {first:.1f} s the first time and {again:.2f} s again"


def _row(robot: Robot) -> list[str]:
    first, again = robot.first, robot.again
    assert again is not None
    times = again.times
    reach = ["-"] * 3
    if times:
        reach = [f"{again.solved} of {len(times)}", *(_ms(float(np.quantile(times, share))) for share in (0.5, 0.95))]
    distance = f"{1e3 * first.free:.1f}" if np.isfinite(first.free) else "-"
    counts = [str(count) for count in (first.nv, first.pieces, first.pairs, first.notes)]
    return [f"`{robot.name}`", f"{first.seconds:.2f}", f"{again.seconds:.2f}", *counts, distance, *reach]


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.0f}"


def _without_folder(text: str, name: str) -> str:
    """The sentence with the file's path shortened to its name below the folder."""
    head, found, tail = text.partition(name)
    return f"{name}{tail}" if found else head
