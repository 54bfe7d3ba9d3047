"""Files that are not what they should be: mutated ones of every kind, and paths to nothing."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.attack.judging import CORPUS, Verdict, chosen
from wholebody.figures.packaged_urdf import task_paths, urdf_path
from wholebody.taskfile import read_result, read_task

_VALUE = rb'"[^"\n]*"|\[[^\[\]\n]*\]|-?\d+\.?\d*'
_WORD = rb"[A-Za-z_]{2,}"


@cache
def _given(kind: str) -> list[Any]:
    """What a number or a value becomes, what is put in between, and paths that lead to no file."""
    lines = (CORPUS / "mutations.txt").read_text(encoding="utf-8").splitlines()
    return [eval(line.partition(" ")[2]) for line in lines if line.startswith(f"{kind} ")]


def mutated(text: bytes, rng: np.random.Generator) -> bytes:
    """Return a text with one to three mutations, seldom more."""
    spliced = [partial(_spliced, how) for how in ("flip", "delete", "delete", "repeat", "cut", "insert", "insert")]
    changes: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
        *(_number,) * 6, *(_value,) * 4, *(_word,) * 3, _misspelt, _misspelt, *spliced, _lines, _lines, _encoded,
        _nested, _bomb, partial(_spliced, "empty"),
    )  # fmt: skip
    count = int(rng.choice([1, 1, 1, 2, 3, 10]))
    for _ in range(count):
        text = changes[int(rng.integers(len(changes)))](text, rng)
    return text


def _spliced(how: str, text: bytes, rng: np.random.Generator) -> bytes:
    """A text of which bytes are others, fewer or more."""
    if how == "flip":
        found = bytearray(text or b"x")
        for _ in range(int(rng.integers(1, 4))):
            found[int(rng.integers(len(found)))] = int(rng.integers(256))
        return bytes(found)
    if how == "empty":
        return (b"", b"\n", b"\x00" * 100, text * 50)[int(rng.integers(4))]
    first = int(rng.integers(len(text) + 1))
    if how == "cut":
        return text[:first]
    if how == "insert":
        odd: bytes = chosen(rng, _given("odd"))
        return text[:first] + odd + text[first:]
    last = min(len(text), first + int(rng.integers(1, 60)))
    return text[:first] + text[last:] if how == "delete" else text[:last] + text[first:last] + text[last:]


def _replaced(text: bytes, pattern: bytes, by: Callable[[bytes], bytes], rng: np.random.Generator) -> bytes:
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    one = found[int(rng.integers(len(found)))]
    return text[: one.start()] + by(one.group()) + text[one.end() :]


def _number(text: bytes, rng: np.random.Generator) -> bytes:
    number = rb"(?<![A-Za-z_])-?\d+\.?\d*(?:[eE][-+]?\d+)?"
    return _replaced(text, number, lambda _: chosen(rng, _given("number")), rng)


def _value(text: bytes, rng: np.random.Generator) -> bytes:
    return _replaced(text, _VALUE, lambda _: chosen(rng, _given("value")), rng)


def _word(text: bytes, rng: np.random.Generator) -> bytes:
    words = re.findall(_WORD, text) or [b"x"]
    return _replaced(text, _WORD, lambda _: chosen(rng, words), rng)


def _misspelt(text: bytes, rng: np.random.Generator) -> bytes:
    def swapped(word: bytes) -> bytes:
        at = int(rng.integers(len(word) - 1))
        return word[:at] + word[at + 1 : at + 2] + word[at : at + 1] + word[at + 2 :]

    return _replaced(text, _WORD, swapped, rng)


def _lines(text: bytes, rng: np.random.Generator) -> bytes:
    lines = text.split(b"\n")
    a, b = int(rng.integers(len(lines))), int(rng.integers(len(lines)))
    what = int(rng.integers(3))
    if what == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif what == 1:
        lines.insert(b, lines[a])
    else:
        del lines[a]
    return b"\n".join(lines)


def _encoded(text: bytes, rng: np.random.Generator) -> bytes:
    what = int(rng.integers(6))
    if what == 0:
        return text.decode("utf-8", errors="replace").encode("utf-16")
    if what == 1:
        return b"\xef\xbb\xbf" + text
    if what == 2:
        return text.replace(b"\n", b"\r\n")
    if what == 3:
        return text.replace(b"\n", b"\r")
    name = (b"klingon", b"utf-16", b"us-ascii", b"latin-1")[int(rng.integers(4))]
    return text.replace(b'encoding="utf-8"', b'encoding="' + name + b'"')


def _nested(text: bytes, rng: np.random.Generator) -> bytes:
    depth = int(rng.choice((50, 3000, 200_000), p=[0.6, 0.3, 0.1]))
    opening, closing = ((b"[", b"]"), (b"{a=", b"}"), (b"<link>", b"</link>"), (b'{"a":', b"}"))[int(rng.integers(4))]
    return _replaced(text, _VALUE, lambda old: opening * depth + old + closing * depth, rng)


def _bomb(text: bytes, rng: np.random.Generator) -> bytes:
    bomb: bytes = _given("bomb")[0]
    return bomb + text.partition(b">")[2].partition(b">")[2] if rng.random() < 0.2 else _spliced("insert", text, rng)


ROBOT = {"robot.urdf": "robot.urdf", "part.obj": "box.obj"}
"""Names of files that belong together, and where they are stored."""


class Reader(NamedTuple):
    """What reads the file at a path, and the files that lie beside each other, of which mostly the first is mutated."""

    read: Callable[[Path], Any]
    files: Mapping[str, bytes]


def file(rng: np.random.Generator, folder: Path) -> Verdict:
    """Read a mutated file, or seldom a path that leads to none."""
    reader = _reader(rng)
    contents = dict(reader.files)
    names = list(contents)
    which = names[0] if rng.random() < 0.85 else names[int(rng.integers(len(names)))]
    path = folder / names[0]
    if rng.random() < 0.01:
        path = Path(chosen(rng, _given("no-file")))
    else:
        contents[which] = mutated(contents[which], rng)
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
        return Reader(lambda path: wb.read_clip(path, wb.load(path.parent / "robot.urdf")), files)
    if kind == "result":
        return Reader(read_result, _stored({"result.json": "result.json"} | task))
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
