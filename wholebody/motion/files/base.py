"""What formats share: what they write and read, and tables of numbers whose errors name the line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import TIME_STEP, TIME_STEP_ASKED
from wholebody.base.errors import FileFormatError, one_line
from wholebody.figures.figure import Figure
from wholebody.motion.clip import LARGEST, MOST_FRAMES

Motion: TypeAlias = Any
"""What is written, a `Clip`: `figure`, `q` (n, nq), `dt`, `name` and `things`; the module of clips imports this one."""


class Frames(NamedTuple):
    """What is read."""

    q: Array  # (n, nq) one posture for each frame
    dt: float  # seconds from frame to frame
    name: str  # name of the clip
    things: Mapping[str, Array] = {}  # placements (n, 7) of what moves beside the figure


def check_one(names: Iterable[str], figure: Figure, what: str) -> None:
    """Refuse names of a motion of several figures, such as "anna/left_elbow_flexion", where one figure is meant."""
    own = {*figure.frames, *figure.segments, *figure.joints}
    split = [each.rpartition("/") for each in names]
    several = dict.fromkeys(before.split()[-1] for before, _, name in split if before.strip() and name in own)
    if several and figure.root != "several" and not any(name in own for before, _, name in split if not before):
        listed = ", ".join(one_line(name, 20) for name in several)
        raise FileFormatError(
            f"{what} is of figures that are called {listed}; give the figure of their scene, scene.figure, or in a "
            "command its task file, --scene"
        )


LARGEST_FILE = 500_000_000  # bytes of a text file of motion: an hour of 75 joints at 120 frames a second


def number(word: str, where: str) -> float:
    """A finite number of a word; one that is none is refused with its place."""
    try:
        value = float(word)
    except ValueError:
        raise FileFormatError(f"{where}: {one_line(word, 20)!r} is no number") from None
    if not abs(value) <= LARGEST:
        raise FileFormatError(f"{where}: {one_line(word, 20)} is not finite or beyond {LARGEST:g}")
    return value


def seconds(word: str, where: str) -> float:
    """A time step; a word that is none is refused with its place."""
    dt = number(word, where)
    if not TIME_STEP[0] <= dt <= TIME_STEP[1]:
        raise FileFormatError(f"{where}: the time step is {dt:g} s; {TIME_STEP_ASKED}")
    return dt


def frame_count(word: str, where: str) -> int:
    """A number of frames, 1 to `MOST_FRAMES`; a word that is none is refused with its place."""
    if not re.fullmatch(r"\d{1,9}", word):
        raise FileFormatError(f"{where}: {one_line(word, 20)!r} is no number of frames")
    if not 1 <= int(word) <= MOST_FRAMES:
        raise FileFormatError(f"{where}: {int(word)} frames; give 1 to {MOST_FRAMES}")
    return int(word)


def table(name: str, rows: Sequence[tuple[int, Sequence[str]]], columns: Sequence[str]) -> Array:
    """The numbers of rows (n, columns), each with the number of its line; a wrong one is refused with this line."""
    found = np.empty((len(rows), len(columns)))
    for k, (line, words) in enumerate(rows):
        if len(words) != len(columns):
            raise FileFormatError(
                f"{name}, line {line}: {len(words)} values and not {len(columns)}; the line is cut off or wrong"
            )
        try:
            found[k] = [float(word) for word in words]
        except ValueError:
            found[k] = [number(word, f"{name}, line {line}") for word in words]
    broken = np.argwhere(~(np.abs(found) <= LARGEST))
    if len(broken):
        row, column = (int(place) for place in broken[0])
        said = f"{columns[column]} is {one_line(rows[row][1][column], 20)}"
        raise FileFormatError(
            f"{name}, line {rows[row][0]}: {said}; {len(broken)} values are not finite or beyond {LARGEST:g}; correct "
            "or cut those frames"
        )
    return found
