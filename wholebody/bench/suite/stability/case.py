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
    """A problem to solve once. Only the answer counts, not a way to it.

    Attributes:
        problem: to be solved.
        iterations: most iterations that the method gets; None for its own default.
        hindered: whether the method is asked as `Adapter.hindered` makes it.
    """

    problem: Problem
    iterations: int | None = None
    hindered: bool = False


@dataclass(frozen=True)
class Frame:
    """One frame of a stream.

    Attributes:
        target: (3,) where the goal is now.
        moved: things that are elsewhere from this frame on: name to place (3,).
    """

    target: tuple[float, float, float]
    moved: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Stream:
    """A goal to follow frame by frame with `wholebody.Drag`; every frame counts, and the way from one to the next.

    Attributes:
        problem: to be solved; its first goal, a `Point`, is the one that moves.
        frames: where the goal and the things are.
        dt: seconds a frame.
        speed: most that a joint may move [rad/s]; inf where nothing bounds it.
    """

    problem: Problem
    frames: tuple[Frame, ...]
    dt: float = FRAME
    speed: float = np.inf


@dataclass(frozen=True)
class Nonsense:
    """Inputs that no method can make sense of: each has to be refused.

    Attributes:
        attempts: what is given, in words, to a call that gives it to a method.
    """

    attempts: Mapping[str, Callable[[Adapter], object]]


Question = Posed | Stream | Nonsense


@dataclass(frozen=True)
class HardCase:
    """One hard case.

    Attributes:
        name: as typed at the command line.
        group: heading under which it stands.
        title: its heading.
        why: why it is hard.
        acceptable: what an acceptable answer is, in words.
        question: makes the problem, a new one at each call: what a method does to it does not reach the judge.
        expected: the best verdict that there can be.
        also: verdicts that are acceptable besides.
        best: goal error of the best possible answer [m, rad]; None where only the best answer of all is known.
        near: by how much an honest best effort may miss the best known answer and still be as good as it [m, rad].
        tolerance: to which an answer counts as solved [m, rad].
        can_hold: whether all constraints can hold together.
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
        """Whether an answer is acceptable.

        Args:
            kind: its verdict.
            miss: by how much its goal error is above that of the best known answer [m, rad].
        """
        return kind in self.also or (kind == self.expected and (kind != "honest" or miss <= self.near))


@dataclass(frozen=True)
class Answer:
    """What a method did with one case.

    Attributes:
        postures: (k, nq) its answer, or one posture a frame; empty where it gave none.
        status: what it says of its answer; "" for streams, which say only their residual.
        left: (k,) what it says is left to the goal, metres or radians; NaN where it does not say.
        refusal: what it says where it refuses.
        failure: an exception that is no WholebodyError, or how the process ended.
        taken: nonsense that it took without a word.
        seconds: wall time.
        message: its own sentence.
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
