"""What a problem set gives: a problem, the posture that proves it possible, and where its goals move to, if they do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.files import packaged_toml
from wholebody.problem import Problem
from wholebody.tasks.base import Goal


@dataclass(frozen=True)
class Case:
    """One problem of a set, of which methods see `problem` and nothing else.

    `witness` (nq,) meets the goals and keeps everything that must hold. Of a set whose goals move: the goals of each
    following frame, a posture for each, and seconds between frames.
    """

    set: str
    number: int
    problem: Problem
    witness: Array
    frames: tuple[tuple[Goal, ...], ...] = ()
    path: tuple[Array, ...] = ()
    dt: float = 1.0 / 60.0


Posed = tuple[Problem, Array] | tuple[Problem, Array, tuple[tuple[Goal, ...], ...], tuple[Array, ...]]
"""What a set poses: the first fields of a `Case` after its number."""

Pose = Callable[[int, np.random.Generator], Posed]


@dataclass(frozen=True)
class ProblemSet:
    """A family of problems: its title over a chart, one sentence about it, and whether its goals move."""

    name: str
    title: str
    about: str
    pose: Pose
    moving: bool = False

    def make(self, number: int, seed: int) -> Case:
        """A case from its number and the seed of the set; the same ones make the same case."""
        return Case(self.name, number, *self.pose(number, generator(self.name, number, seed)))


@cache
def numbers(name: str) -> Any:
    """What `sets.toml` says of a set, as attributes."""
    return _attributes(packaged_toml(Path(__file__).with_name("sets.toml"))[name])


def _attributes(value: Any) -> Any:
    if isinstance(value, dict):
        return SimpleNamespace(**{name: _attributes(each) for name, each in value.items()})
    return [_attributes(each) for each in value] if isinstance(value, list) else value


def generator(name: str, number: int, seed: int) -> np.random.Generator:
    """Random numbers of one case, independent of those of all others."""
    return np.random.default_rng([seed, number, *name.encode()])
