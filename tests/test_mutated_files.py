"""Files with random faults: tasks, tracks, paths and results are read, or refused in one sentence."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody import tracking
from wholebody.cli.demo import packaged_tasks
from wholebody.taskfile import result
from wholebody.taskfile import task as task_module

ROUNDS = 120
NUMBERS = ("nan", "inf", "-inf", "1e999", "1e308", "1e-320", "-1", "0", "9" * 400, "9" * 5000, "0x" + "f" * 5000)
TEXTS = ("x", "x" * 300, "a\0b", "a\nb", "[/red]", "/dev/zero", "..", "\u202e", "x" * 140_000, "")
SHAPES = (
    "true",
    "null",
    "[]",
    "{}",
    "[[]]",
    "[{}]",
    "{a = 1}",
    "[nan, 0, 0]",
    "[1e300, 0, 0]",
    "[0, 0, 0, 0, 0, 0, 0]",
)
DEEP = ("[" * 3000 + "]" * 3000, "[" * 200_000, "{a = " * 3000, "a." * 1000 + "a", "1979-05-27")
SIGNS = (
    "\0",
    "\ufeff",
    "\r",
    "\t",
    "\n\n",
    "#",
    "=",
    ",",
    ";",
    ":",
    "[",
    "]",
    "{",
    "}",
    '"',
    "'",
    '"""',
    "é",
    "\u2028",
)
PIECES = (*NUMBERS, *(f'"{text}"' for text in TEXTS), *TEXTS, *SHAPES, *DEEP, *SIGNS)


def mutated(text: str, rng: random.Random) -> str:
    """A text with one to four faults."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        lines = text.split("\n")
        first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
        kind = rng.randrange(6)
        if kind == 0:
            lines.insert(first, lines[second])
        elif kind == 1:
            lines[first], lines[second] = lines[second], lines[first]
        elif kind == 2:
            del lines[first]
        if kind < 3:
            text = "\n".join(lines)
            continue
        pattern = (r"-?\d+\.?\d*", r"(?<== )[^\n]+", r"\w+")[kind - 3]
        found = list(re.finditer(pattern, text))
        place = rng.choice(found).span() if found and rng.random() < 0.8 else (rng.randrange(len(text) + 1),) * 2
        text = text[: place[0]] + rng.choice(PIECES) + text[place[1] :]
    return text[: rng.randrange(len(text) + 1)] if rng.random() < 0.1 else text


@pytest.fixture(scope="module")
def hand() -> wb.Figure:
    return wb.load("hand")


@pytest.fixture(scope="module")
def sources(hand: wb.Figure, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[list[str], str]]:
    """Right files of each kind, and the name that a faulty one has."""
    folder = tmp_path_factory.mktemp("right")
    track = tracking.Track.of(hand, np.array([hand.neutral] * 3), 1 / 60)
    (folder / "hand.toml").write_text('[figure]\nname = "hand"\n')
    task = wb.read_task(folder / "hand.toml")
    answer = result.as_json(result.describe(task, wb.solve(task.problem), folder))
    tasks = [path.read_text(encoding="utf-8") for path in packaged_tasks().values()]
    return {
        "task": (tasks, "task.toml"),
        "track": ([tracking.write_track(track, folder / "track.csv").read_text()], "track.csv"),
        "path": (["x y z\n0.1 0.2 0.3\n0.2,0.2,0.3 # there\n\n"], "path.txt"),
        "result": ([answer], "result.json"),
    }


@pytest.mark.parametrize("kind", ["task", "track", "path", "result"])
def test_faulty_files_are_read_or_refused_in_one_sentence(
    kind: str,
    sources: dict[str, tuple[list[str], str]],
    hand: wb.Figure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    readers: dict[str, Callable[[Path], Any]] = {
        "task": wb.read_task,
        "track": lambda path: tracking.read_track(path, hand),
        "path": tracking.read_path,
        "result": result.read_result,
    }
    known = cache(lambda spec, **options: wb.load(spec, **options))
    monkeypatch.setattr(task_module, "load", known)  # the same people again and again
    (tmp_path / "hand.toml").write_text('[figure]\nname = "hand"\n')
    texts, name = sources[kind]
    rng = random.Random(kind)
    said = []
    for number in range(ROUNDS):
        faulty = mutated(rng.choice(texts), rng)
        (tmp_path / name).write_bytes(faulty.encode("utf-8", "surrogatepass"))
        try:
            readers[kind](tmp_path / name)
        except wb.WholebodyError as error:
            said.append((number, str(error)))
    assert not [entry for entry in said if not entry[1].isprintable() or len(entry[1]) > 700]
    assert len(said) > ROUNDS // 4
