"""What a hard case is: something to ask of a method, why it is hard, and which of the answers are acceptable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.problem import Problem

Kind = Literal["solved", "honest", "refusal", "wrong"]

FRAME = 1.0 / 60.0  # s: a frame of a screen


@dataclass(frozen=True)
class Posed:
    """A problem to solve once, with the most iterations (None: the method's own), or by a method that is `hindered`."""

    problem: Problem
    iterations: int | None = None
    hindered: bool = False


@dataclass(frozen=True)
class Frame:
    """One frame of a stream: where the goal is now (3,), and things that are elsewhere from now on."""

    target: tuple[float, float, float]
    moved: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Stream:
    """A goal to follow frame by frame with `wholebody.Drag`; every frame counts, and the way from one to the next.

    The first goal, a `Point`, is the one that moves; no joint may move faster than `speed` [rad/s].
    """

    problem: Problem
    frames: tuple[Frame, ...]
    dt: float = FRAME
    speed: float = np.inf


@dataclass(frozen=True)
class Nonsense:
    """Inputs that no method can make sense of, in words: each has to be refused."""

    attempts: Mapping[str, Callable[[Adapter], object]]


Question = Posed | Stream | Nonsense


@dataclass(frozen=True)
class HardCase:
    """One hard case: why it is hard, and which answers are acceptable.

    `question` makes the problem, a new one at each call: what a method does to it does not reach the judge. `expected`:
    the best verdict that there can be; `also`: others that are acceptable. `best`: goal error of the best possible
    answer [m, rad], None where only the best answer of all is known; an honest best effort may miss it by `near`. An
    answer counts as solved to `tolerance`; `can_hold`: whether all constraints can hold together.
    """

    name: str
    group: str
    title: str
    why: str
    acceptable: str
    question: Callable[[], Question]
    expected: Kind = "solved"
    also: tuple[Kind, ...] = ()
    best: float | None = 0.0
    near: float = 1e-3
    tolerance: float = 1e-4
    can_hold: bool = True

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Whether an answer is acceptable whose goal error is above that of the best known one by `miss` [m, rad]."""
        return kind in self.also or (kind == self.expected and (kind != "honest" or miss <= self.near))


@dataclass(frozen=True)
class Answer:
    """What a method did with one case.

    `postures` (k, nq): one, or one a frame, or none; `left` (k,): what it says is left to the goal; `failure`: an
    exception that is no WholebodyError, or how the process ended; `taken`: nonsense that it took without a word;
    `seconds` by the clock.
    """

    postures: Array
    status: str = ""
    left: tuple[float, ...] = ()
    refusal: str = ""
    failure: str = ""
    taken: tuple[str, ...] = ()
    seconds: float = 0.0
    message: str = ""


NOTHING = np.zeros((0, 0))
