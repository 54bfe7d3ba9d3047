"""What a problem set gives: a problem, the posture that proves it possible, and where its goals move to, if they do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wholebody.base.arrays import Array
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
        path: a posture (nq,) for each frame that proves it possible.
        dt: seconds between frames.
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


@dataclass(frozen=True)
class ProblemSet:
    """A family of problems.

    Attributes:
        name: as typed at the command line.
        title: as written over a chart.
        about: one sentence: what is asked, and what makes it hard.
        pose: a problem, its witness, and the frames of a moving set, from a number and a generator of random numbers.
        moving: whether its goals move from frame to frame.
    """

    name: str
    title: str
    about: str
    pose: Callable[[int, np.random.Generator], Posed]
    moving: bool = False

    def make(self, number: int, seed: int) -> Case:
        """A case from its number and the seed of the set; the same ones make the same case."""
        return Case(self.name, number, *self.pose(number, generator(self.name, number, seed)))


def generator(name: str, number: int, seed: int) -> np.random.Generator:
    """Random numbers of one case, independent of those of all others."""
    return np.random.default_rng([seed, number, *name.encode()])
