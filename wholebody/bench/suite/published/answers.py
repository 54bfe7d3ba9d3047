"""Answers to published problems, from whatever wrote them: read, and refused with one sentence that names the place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError, UnknownNameError
from wholebody.bench.suite.published.rebuilt import VERSION, Rebuilt, loaded, read_index

Seed = Literal["near", "far"]
SEEDS: tuple[Seed, ...] = ("near", "far")


@dataclass(frozen=True)
class Answer:
    """One answer: postures (frames, nq), one where goals do not move, None where it is `refused`; seconds, or NaN."""

    problem: str
    seed: Seed
    postures: Array | None
    seconds: float
    refused: str


@dataclass(frozen=True)
class Answers:
    """The content of a file of answers; texts are empty, and the kernel's time NaN, where the file has none."""

    method: str
    about: str
    machine: str
    kernel_seconds: float
    answers: tuple[Answer, ...]


def read_answers(path: Path, folder: Path) -> Answers:
    """Read a file of answers to an export; errors name the entry and how to correct it."""
    index = read_index(folder)
    known = {name for family in index["sets"].values() for name in family["problems"]}
    content = loaded(path, "file of answers")
    if not isinstance(content, dict):
        raise FileFormatError(f"{path}: holds {_kind(content)}, not an object with method and answers")
    keys = {"format", "version", "method", "about", "machine", "kernel_seconds", "answers"}
    _check_keys(content, keys, f"{path}")
    for key, wanted in (("format", "wholebody answers"), ("version", VERSION)):
        if content.get(key) != wanted:
            raise FileFormatError(f'{path}: {key} is {shown(content.get(key))}; write "{key}": "{wanted}"')
    listed = content.get("answers")
    if not isinstance(listed, list):
        raise FileFormatError(f"{path}: answers is {_kind(listed)}; give a list of objects, one a problem")
    if not listed:
        raise FileFormatError(f"{path}: answers is empty; give an object for each problem, or refuse it with a reason")
    texts = {key: _text(content, key, str(path)) for key in ("method", "about", "machine")}
    if not 0 < len(texts["method"].strip()) <= 200:
        raise FileFormatError(f"{path}: method has no name, or one of more than 200 letters; name your solver")
    read: dict[tuple[str, str], Answer] = {}
    for place, item in enumerate(listed):
        answer = _answer(item, where := f"{path}: answers[{place}]", folder, known)
        if (answer.problem, answer.seed) in read:
            message = f"answers {answer.problem} from the {answer.seed} seed a second time"
            raise FileFormatError(f"{where} {message}; keep one of them")
        read[answer.problem, answer.seed] = answer
    return Answers(
        **texts,
        kernel_seconds=_seconds(content, "kernel_seconds", str(path)),
        answers=tuple(read.values()),
    )


def _answer(item: Any, where: str, folder: Path, known: set[str]) -> Answer:
    if not isinstance(item, dict):
        raise FileFormatError(f"{where} is {_kind(item)}; give an object with problem and posture")
    _check_keys(item, {"problem", "seed", "posture", "postures", "seconds", "refused"}, where)
    name, seed = item.get("problem"), item.get("seed", "near")
    if not isinstance(name, str):
        raise FileFormatError(f"{where}.problem is {shown(name)}; give a name such as 'clutter/0007'")
    if name not in known:
        raise UnknownNameError("problem", name, known, where)
    if seed not in SEEDS:
        raise FileFormatError(f"{where}.seed is {shown(seed)}; give 'near' or 'far'")
    given = [key for key in ("posture", "postures", "refused") if item.get(key) is not None]
    if len(given) != 1:
        raise FileFormatError(f"{where} has {' and '.join(given) or 'no posture'}; give one of posture(s), refused")
    seconds = _seconds(item, "seconds", where)
    refused = _text(item, "refused", where)
    if given == ["refused"]:
        return Answer(name, cast(Seed, seed), None, seconds, refused.strip() or "without a reason")
    return Answer(name, cast(Seed, seed), _postures(folder, name, item, given[0], where), seconds, "")


def _postures(folder: Path, name: str, item: Mapping[str, Any], key: str, where: str) -> Array:
    problem = Rebuilt(folder, name)
    wanted = "postures" if problem.moving else "posture"
    if key != wanted:
        what = f"one for each of its {problem.frames} frames" if problem.moving else "one list of numbers"
        raise FileFormatError(f"{where} has {key}, and {name} takes {wanted}: {what}")
    rows = item[key] if problem.moving else [item[key]]
    if not isinstance(rows, list) or len(rows) != problem.frames:
        count = len(rows) if isinstance(rows, list) else 0
        raise FileFormatError(f"{where}.postures has {count} entries; {name} has {problem.frames} frames")
    places = [f"{where}.{key}[{number}]" if problem.moving else f"{where}.{key}" for number in range(len(rows))]
    return np.array([_posture(row, problem, place) for row, place in zip(rows, places, strict=True)])


def _posture(row: Any, problem: Rebuilt, where: str) -> Array:
    name, body, count = problem.content["name"], problem.content["body"], problem.model.nq
    if not isinstance(row, list):
        order = f"in the order of coordinates in {body}"
        raise FileFormatError(f"{where} is {_kind(row)}; give a list of {count} numbers, {order}")
    if len(row) != count:
        raise FileFormatError(f"{where} has {len(row)} numbers; {name} takes {count}, one a coordinate of {body}")
    for place, value in enumerate(row):
        # A number of more than 1e6 rad or m is a mistake.
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= 1e6:
            raise FileFormatError(f"{where}[{place}] is {shown(value)}; give finite radians and metres")
    q = np.array(row, dtype=float)
    for joint in problem.model.joints:
        first = joint.idx_q + 3
        length = float(np.linalg.norm(q[first : first + 4])) if joint.nq == 7 else 1.0
        if abs(length - 1.0) > 1e-6:
            numbers = f"numbers {first} to {first + 3}: x, y, z, w"
            raise FileFormatError(f"{where}: the root's quaternion ({numbers}) has length {length:.6g}; normalise it")
    return q


def _check_keys(item: Mapping[str, Any], known: set[str], where: str) -> None:
    for key in item:
        if key not in known:
            raise FileFormatError(str(UnknownNameError("entry", str(key), known, where)))


def _text(item: Mapping[str, Any], key: str, where: str) -> str:
    value = item.get(key)
    if value is None:
        return ""
    if not isinstance(value, str):
        raise FileFormatError(f"{where}.{key} is {_kind(value)}; give a text")
    return " ".join(value.split())


def _seconds(item: Mapping[str, Any], key: str, where: str) -> float:
    value = item.get(key)
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not (isfinite(value) and value >= 0.0):
        raise FileFormatError(f"{where}.{key} is {shown(value)}; give seconds, 0 or more")
    return float(value)


def _kind(value: Any) -> str:
    names: Sequence[tuple[type, str]] = (
        (dict, "an object"), (list, "a list"), (str, "a text"), (bool, "true or false"), (int, "a number"),
        (float, "a number"),
    )  # fmt: skip
    return next((name for kind, name in names if isinstance(value, kind)), "nothing")
