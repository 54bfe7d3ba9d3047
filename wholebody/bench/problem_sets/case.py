"""What a problem set gives: a problem, the posture that proves it possible, and where its goals move to, if they do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wholebody.arrays import Array
from wholebody.problem import Problem
from wholebody.tasks.base import Goal


@dataclass(frozen=True)
class Case:
    """One problem of a set.

    Attributes:
        set: name of its set.
        number: within the set.
        problem: what is asked; methods see this and nothing else of the case.
        witness: (nq,) a posture that meets the goals and keeps everything that must hold.
        frames: goals of each following frame, for a set whose goals move; empty for one that is solved once.
        dt: seconds between frames.
    """

    set: str
    number: int
    problem: Problem
    witness: Array
    frames: tuple[tuple[Goal, ...], ...] = ()
    dt: float = 1.0 / 60.0


@dataclass(frozen=True)
class ProblemSet:
    """A family of problems.

    Attributes:
        name: as typed at the command line.
        title: as written over a chart.
        about: one sentence: what is asked, and what makes it hard.
        make: a case from its number and the seed of the set; the same ones make the same case.
        moving: whether its goals move from frame to frame.
    """

    name: str
    title: str
    about: str
    make: Callable[[int, int], Case]
    moving: bool = False


def generator(name: str, number: int, seed: int) -> np.random.Generator:
    """Random numbers of one case, independent of those of all others."""
    return np.random.default_rng([seed, number, *name.encode()])
