"""What a hard case is: something to ask of a method, why it is hard, and what an acceptable answer is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from wholebody.bench.adapters.base import Adapter
from wholebody.problem import Problem

Kind = Literal["solved", "honest", "refusal", "adapter", "wrong"]

FRAME = 1.0 / 60.0  # s: a frame of a screen


@dataclass(frozen=True)
class Posed:
    """A problem to solve once. Only the answer counts, not a way to it.

    Attributes:
        problem: what is asked.
        iterations: most iterations that the method gets; None for its own default.
        adjust: what takes the method's place, from the method; None for itself.
    """

    problem: Problem
    iterations: int | None = None
    adjust: Callable[[Any], Any] | None = None


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
        problem: what is asked; its first goal, a `Point`, is the one that moves.
        frames: where the goal and the things are.
        dt: seconds a frame.
        speed: most that a joint may move [rad/s]; inf where nothing bounds it.
        shown: the frame to draw; negative numbers count from the end.
    """

    problem: Problem
    frames: tuple[Frame, ...]
    dt: float = FRAME
    speed: float = np.inf
    shown: int = -1


@dataclass(frozen=True)
class Nonsense:
    """Inputs that no method can make sense of: each has to be refused.

    Attributes:
        attempts: what is given, in words, to a call that gives it to a method.
        problem: the same with sense in it, for a picture.
    """

    attempts: Mapping[str, Callable[[Adapter], object]]
    problem: Problem


Question = Posed | Stream | Nonsense


class HardCase(ABC):
    """One hard case.

    Attributes:
        name: as typed at the command line.
        group: heading under which it stands.
        title: as written over its picture.
        why: why it is hard.
        acceptable: what an acceptable answer is, in words.
        expected: the best verdict that there can be.
        best: goal error of the best possible answer [m, rad]; None where only the best answer of all is known.
        tolerance: to which an answer counts as solved [m, rad].
        can_hold: whether all constraints can hold together.
        see_through: things that are drawn transparent because they would hide what is to be seen.
        eye: (3,) direction from which one looks at it.
        near: for an honest best effort: by how much it may miss the best known answer and still be as good as it
            [m, rad].
    """

    name: ClassVar[str]
    group: ClassVar[str]
    title: ClassVar[str]
    why: ClassVar[str]
    acceptable: ClassVar[str]
    expected: ClassVar[Kind] = "solved"
    best: ClassVar[float | None] = 0.0
    tolerance: ClassVar[float] = 1e-4
    can_hold: ClassVar[bool] = True
    near: ClassVar[float] = 1e-3
    see_through: ClassVar[tuple[str, ...]] = ()
    eye: ClassVar[tuple[float, float, float]] = (0.35, -1.0, 0.3)

    @abstractmethod
    def question(self) -> Question:
        """What is asked, made anew at each call: what a method does to it does not reach the judge."""

    def drawn(self) -> Question:
        """What is drawn with an answer's postures; another one only where it cannot be seen at its own size."""
        return self.question()

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Whether an answer is acceptable.

        Args:
            kind: its verdict.
            miss: by how much its goal error is above that of the best known answer [m, rad].
        """
        return kind == self.expected and (kind != "honest" or miss <= self.near)


def still(target: tuple[float, float, float], count: int) -> tuple[Frame, ...]:
    """As many frames in which nothing moves."""
    return (Frame(target),) * count
