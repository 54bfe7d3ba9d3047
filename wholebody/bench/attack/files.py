"""Files that are not what they should be: mutated tasks, tracks, results, robots and meshes, and paths to nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.attack.case import CORPUS, Verdict
from wholebody.bench.attack.mutations import mutated
from wholebody.figures.packaged_urdf import task_paths, urdf_path
from wholebody.taskfile import read_task
from wholebody.taskfile.result import read
from wholebody.tracking.track_files import read_track

NO_FILES = (
    "/dev/zero", "/dev/null", "/", "no-such-file", "a" * 5000, "a/" * 3000 + "b", "nul\0l", "", ".", "/dev/full",
)  # fmt: skip
ROBOT = {"robot.urdf": "robot.urdf", "part.obj": "box.obj"}
"""Names of files that belong together, and where they are stored."""


class Reader(NamedTuple):
    """A way to read a file.

    Attributes:
        read: reads the file at a path, and what lies beside it.
        files: what it reads, by names; the first one is mutated, another one now and then.
    """

    read: Callable[[Path], Any]
    files: Mapping[str, bytes]


def case(rng: np.random.Generator, folder: Path) -> Verdict:
    """Read a mutated file, or seldom a path that leads to none."""
    reader = _reader(rng)
    contents = dict(reader.files)
    names = list(contents)
    chosen = names[0] if rng.random() < 0.85 else names[int(rng.integers(len(names)))]
    path = folder / names[0]
    if rng.random() < 0.01:
        path = Path(NO_FILES[int(rng.integers(len(NO_FILES)))])
    else:
        contents[chosen] = mutated(contents[chosen], rng)
    for name, text in contents.items():
        (folder / name).write_bytes(text)
    try:
        return sane(reader.read(path))
    except wb.WholebodyError as error:
        return refused(error)


def _reader(rng: np.random.Generator) -> Reader:
    kind = str(rng.choice(["task", "robot", "mesh", "track", "result"], p=[0.3, 0.3, 0.1, 0.15, 0.15]))
    task = {"task.toml": "everything.toml"} | ROBOT
    if kind == "mesh":
        name, stored = (("part.obj", "box.obj"), ("part.stl", "tetrahedron.stl"))[int(rng.integers(2))]
        return Reader(lambda path: wb.Mesh(path).pieces(), _stored({name: stored}))
    if kind == "track":
        files = _stored({"track.csv": "track.csv"} | ROBOT)
        return Reader(lambda path: read_track(path, wb.load(path.with_name("robot.urdf"))), files)
    if kind == "result":
        return Reader(read, _stored({"result.json": "result.json"} | task))
    packaged = rng.random() < 0.15
    if kind == "robot":
        return Reader(wb.load, {"hand.urdf": urdf_path("hand").read_bytes()} if packaged else _stored(ROBOT))
    if not packaged:
        return Reader(read_task, _stored(task))
    tasks = task_paths()
    name = sorted(tasks)[int(rng.integers(len(tasks)))]
    beside = {p.name: p.read_bytes() for p in tasks[name].parent.iterdir() if p.suffix in (".urdf", ".csv")}
    return Reader(read_task, {"task.toml": tasks[name].read_bytes(), **beside})


def _stored(names: Mapping[str, str]) -> dict[str, bytes]:
    """Files of the corpus, under other names."""
    return {name: (CORPUS / stored).read_bytes() for name, stored in names.items()}


def refused(error: Exception) -> Verdict:
    """Judge a refusal: one sentence that a person can read."""
    words = str(error)
    if len(words) > 1500:
        return Verdict("wrong", f"a refusal of {len(words)} characters: {words[:100]!r}...")
    if not words.strip() or "\n" in words.strip():
        return Verdict("wrong", f"a refusal of other than one line: {words[:100]!r}")
    return Verdict("refused", words[:200])


def sane(read: Any) -> Verdict:
    """Judge what was read: it has to be made of numbers that a body or a task can have."""
    if isinstance(read, wb.Figure):
        return _figure(read)
    if isinstance(read, wb.taskfile.Task):
        problem = read.problem
        verdict = _figure(problem.scene.figure)
        if verdict.outcome == "wrong":
            return verdict
        places = [thing.placement.homogeneous.ravel() for thing in problem.scene.objects.values()]
        return _finite(np.concatenate([problem.start, [problem.clearance], problem.clearances, *places]), "a task")
    if isinstance(read, tuple) and read and hasattr(read[0], "geometry"):
        places = [np.append(piece.placement.homogeneous.ravel(), piece.volume) for piece in read]
        return _finite(np.concatenate(places), "a mesh")
    if isinstance(read, tuple):
        return _finite(np.asarray(read[1], dtype=float), "a result")
    return _finite(np.append(np.ravel(read.q), read.dt), "a track")


def _finite(values: Any, what: str) -> Verdict:
    if not np.isfinite(values).all():
        return Verdict("wrong", f"{what} was taken that is not made of finite numbers")
    return Verdict("right", f"{what} was taken")


def _figure(figure: wb.Figure) -> Verdict:
    model = figure.model
    masses = np.array([inertia.mass for inertia in model.inertias])
    places = np.array([place.homogeneous for place in model.jointPlacements]).ravel()
    inner = np.array([inertia.inertia for inertia in model.inertias]).ravel()
    limits = np.concatenate([model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit])
    if not (np.isfinite(masses).all() and np.isfinite(places).all() and np.isfinite(inner).all()):
        return Verdict("wrong", "a robot was taken whose masses or places are not made of finite numbers")
    most = 1e9  # kg, m: greater numbers of a robot are slips
    if (masses < 0.0).any() or masses.max() > most or np.abs(places).max() > most:
        words = f"a robot was taken with a mass of {masses.min():g} to {masses.max():g} kg, or far apart"
        return Verdict("wrong", words)
    if np.isnan(limits).any() or (model.velocityLimit < 0.0).any():
        return Verdict("wrong", "a robot was taken with limits that are not numbers, or with negative velocities")
    for name in figure.postures:
        q = figure.posture(name)
        if not np.isfinite(q).all() or not pin.isNormalized(model, q, 1e-6):
            return Verdict("wrong", f"a robot was taken whose posture {name!r} is not made of numbers")
    return Verdict("right", "a robot was taken")
