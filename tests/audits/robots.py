"""Every robot description of a folder, in a process each: whether it loads, how fast, and whether its tips reach."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, WholebodyError
from wholebody.base.files import Scratch
from wholebody.base.runner import Child, EndedError
from wholebody.bench.rows import Figure, Row, measured_ms, only, report
from wholebody.geometry.mesh_cache import VARIABLE

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure as Body
    from wholebody.scene.scene import Scene


def examine(path: str, reaches: int) -> dict[str, Figure]:
    """Load a description, and make some reaches (0 loads only); "refused" alone where it is refused."""
    import wholebody as wb
    from wholebody.figures.self_pairs import UNPARTED
    from wholebody.geometry import convex, meshes

    _ = convex, meshes
    wb.load("hand")  # what every load needs is imported
    try:
        spent, _, figure = measured_ms(lambda: wb.load(path))
    except WholebodyError as error:
        return {"refused": str(error)}
    scene = wb.Scene(figure)
    pairs = len(figure.geometry.collisionPairs)
    distance = scene.contacts(figure.neutral, within=100.0).distance if pairs else np.zeros(0)
    found: dict[str, Figure] = {
        "s": 1e-3 * spent,
        "freedoms": figure.model.nv,
        "pieces": figure.geometry.ngeoms,
        "pairs": pairs,
        "notes": len(figure.notes),
        "left out": sum(pair.reason == UNPARTED for pair in figure.excluded_pairs),
        "free mm": 1e3 * float(distance.min(initial=np.inf)),
    }
    if not reaches or not figure.chains:
        return found
    targets = tip_targets(figure, scene, reaches)
    wb.solve(wb.Problem(scene, goals=[wb.Point(*targets[0])]))  # numba's loops are compiled or read back
    problems = [wb.Problem(scene, goals=[wb.Point(tip, target)]) for tip, target in targets]
    solves = [measured_ms(lambda: wb.solve(problem)) for problem in problems]  # noqa: B023
    spent_each = [each[0] for each in solves]
    return found | {
        "solved": sum(each[2].solved for each in solves),
        "reaches": reaches,
        "median ms": float(np.median(spent_each)),
        "p95 ms": float(np.quantile(spent_each, 0.95)),
    }


def tip_targets(figure: Body, scene: Scene, count: int) -> list[tuple[str, Array]]:
    """Tips, the longest chain's first, and where each is in a random posture that is free of contact."""
    chains = sorted(figure.chains.values(), key=lambda chain: -len(chain.joints))
    tips = [chains[number % len(chains)].tip for number in range(count)]
    postures = (_free_posture(figure, scene, count, number) for number in range(count))
    return [(tip, figure.placement(q, tip).translation) for tip, q in zip(tips, postures, strict=True)]


def _free_posture(figure: Body, scene: Scene, count: int, number: int) -> Array:
    """The posture (nq,) of a target: on the way to the first random posture that has a free one there."""
    from wholebody.figures.self_pairs import random_postures

    for draw in range(100):
        other = random_postures(figure.model, count, 7 + draw)[number]
        # How far from the default posture towards a random one a target's posture is: the first that is free of
        # contact.
        for share in (1.0, 0.75, 0.5, 0.25, 0.125, 0.0625):
            q = np.asarray(pin.interpolate(figure.model, figure.neutral, other, share))
            if not len(scene.contacts(q, within=0.0).number):
                return q
    return figure.neutral


def descriptions(folder: Path) -> list[Path]:
    """Return the URDF and MJCF files below a folder; InputError where there is none."""
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


def measure(folder: Path, reaches: int) -> Iterator[Row]:
    """Load every description of a folder twice, and reach with it the second time."""
    for path in descriptions(folder):
        name = str(path.relative_to(folder))
        with Scratch() as cache:
            first = _examined(path, 0, str(cache))
            if "refused" in first:
                _, found, tail = str(first["refused"]).partition(name)
                yield Row(f"`{name}`", "refused", {"refused": f"{name}{tail}" if found else first["refused"]})
                continue
            again = _examined(path, reaches, str(cache))
        kind = "MJCF" if path.suffix == ".xml" else "URDF"
        yield Row(f"`{name}`", kind, {"first s": first["s"], "again s": again.pop("s", float("nan")), **again})


def _examined(path: Path, reaches: int, cache: str) -> dict[str, Figure]:
    longest = 300.0  # s: after which a description is given up
    child = Child({VARIABLE: cache, "OMP_NUM_THREADS": "1"})
    try:
        found: dict[str, Figure] = child.call(examine, str(path), reaches, seconds=longest)
    except EndedError as error:
        return {"refused": f"it takes more than {longest:g} s" if error.overtime else str(error)}
    finally:
        child.close()
    return found


def robots_report(rows: Sequence[Row], facts: Mapping[str, str], reaches: int) -> str:
    """Return what was found as Markdown."""
    loaded = [row for row in rows if row.tool != "refused"]
    whole = sum(row.figures.get("solved") == reaches for row in loaded)
    about = (
        "Robot descriptions by other people, loaded without changes.\n\n"
        f"{len(loaded)} of {len(rows)} descriptions load; {whole} robots solve all of their {reaches} "
        "reaches. A reach moves the tip of a chain to where a random posture free of contact has it; it begins at the "
        "default posture, and the robot may not touch itself. The chains take turns, the longest first. First is the "
        "CPU time of loading with an empty cache, again that of loading once more; free is the least distance of any "
        "pair in the default posture; the rest is the CPU time of a reach."
    )  # fmt: skip
    refused = [f"refused: {row['refused']}" for row in rows if row.tool == "refused"]
    shown = only(loaded, "first s", "again s", "freedoms", "pairs", "free mm", "solved", "median ms", "p95 ms")
    return report(about, {"": shown}, facts, refused)
