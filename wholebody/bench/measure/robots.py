"""Every robot description of a folder: whether it loads, how fast, and whether its tips reach; and the page about it.

A description is examined in a process of its own: it is loaded, and its tips reach to where a free posture has them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import Scratch
from wholebody.base.runner import Child, EndedError
from wholebody.bench.report import render
from wholebody.geometry.mesh_cache import VARIABLE

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure
    from wholebody.scene.scene import Scene

LONGEST = 300.0  # s: after which a description is given up
REACHES = 12  # of each robot
SEED = 7  # of the postures whose tips are the targets
FAR = 100.0  # m: pairs farther apart in the default posture do not count
SHARES = (1.0, 0.75, 0.5, 0.25, 0.125, 0.0625)
"""How far from the default posture towards a random one a target's posture is: the first that is free of contact."""
DRAWS = 100  # of random postures for a target, towards which nothing may be free


@dataclass(frozen=True)
class Loaded:
    """What loading gave.

    Attributes:
        seconds: CPU time of `wholebody.load`, packages imported before.
        refused: the sentence it was refused with; empty where it was loaded.
        kind: "URDF" or "MJCF".
        nv, pieces, pairs: degrees of freedom, convex pieces, and pairs that can touch.
        notes: sentences on what was changed about the geometry.
        left_out: pairs that overlap at zero and could not be parted.
        free: least distance of any pair in the default posture, metres; inf without pairs.
        solved: reaches that ended `solved`.
        times, statuses: CPU seconds and status of each reach.
    """

    seconds: float
    refused: str = ""
    kind: str = "URDF"
    nv: int = 0
    pieces: int = 0
    pairs: int = 0
    notes: int = 0
    left_out: int = 0
    free: float = float("inf")
    solved: int = 0
    times: tuple[float, ...] = ()
    statuses: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether all reaches were solved."""
        return self.solved == len(self.times)

    @property
    def median(self) -> float:
        """Median of the reaches' times."""
        return float(np.median(self.times))


def examine(path: str, reaches: int) -> Loaded:
    """Load a description, and make some reaches; 0 loads only."""
    import wholebody as wb
    from wholebody.figures.rest_posture import UNPARTED
    from wholebody.geometry import convex, meshes

    _ = convex, meshes
    wb.load("hand")  # what every load needs is imported
    began = time.process_time()
    try:
        figure = wb.load(path)
    except WholebodyError as error:
        return Loaded(time.process_time() - began, refused=str(error))
    seconds = time.process_time() - began
    scene = wb.Scene(figure)
    contacts = scene.contacts(figure.neutral, within=FAR) if len(figure.geometry.collisionPairs) else None
    found = Loaded(
        seconds,
        kind="MJCF" if path.endswith(".xml") else "URDF",
        nv=figure.model.nv,
        pieces=figure.geometry.ngeoms,
        pairs=len(figure.geometry.collisionPairs),
        notes=len(figure.notes),
        left_out=sum(pair.reason == UNPARTED for pair in figure.excluded_pairs),
        free=float(contacts.distance.min(initial=FAR)) if contacts is not None else float("inf"),
    )
    if not reaches or not figure.chains:
        return found
    statuses: list[str] = []
    times: list[float] = []
    targets = tip_targets(figure, scene, reaches)
    wb.solve(wb.Problem(scene, goals=[wb.Point(*targets[0])]))  # numba's loops are compiled or read back
    for tip, target in targets:
        problem = wb.Problem(scene, goals=[wb.Point(tip, target)])
        began = time.process_time()
        statuses.append(wb.solve(problem).status)
        times.append(time.process_time() - began)
    return replace(found, solved=statuses.count("solved"), times=tuple(times), statuses=tuple(statuses))


def tip_targets(figure: Figure, scene: Scene, count: int) -> list[tuple[str, Array]]:
    """Tips, the longest chain's first, and where each is in a random posture that is free of contact."""
    chains = sorted(figure.chains.values(), key=lambda chain: -len(chain.joints))
    tips = [chains[number % len(chains)].tip for number in range(count)]
    postures = (_free_posture(figure, scene, count, number) for number in range(count))
    return [(tip, figure.placement(q, tip).translation) for tip, q in zip(tips, postures, strict=True)]


def _free_posture(figure: Figure, scene: Scene, count: int, number: int) -> Array:
    """The posture (nq,) of a target: on the way to the first random posture that has a free one there."""
    from wholebody.figures.self_pairs import random_postures

    for draw in range(DRAWS):
        other = random_postures(figure.model, count, SEED + draw)[number]
        for share in SHARES:
            q = np.asarray(pin.interpolate(figure.model, figure.neutral, other, share))
            if not len(scene.contacts(q, within=0.0).number):
                return q
    return figure.neutral


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
    """Load every description of a folder twice, each time in a process of its own, and reach with it the second time.

    The folder and its parents are looked up for packages.
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
