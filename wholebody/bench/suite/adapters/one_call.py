"""Tools as methods: what all of them have, and those that find a posture by one call, with no step to repeat."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Any, ClassVar, Generic, TypeVar

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.methods.base import SolvesAnew, UnsupportedTermError, named_terms, refusal
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress
from wholebody.problem import Problem
from wholebody.solution import Solution, TraceEntry

Built = TypeVar("Built")


class Outside(SolvesAnew, ABC, Generic[Built]):
    """A tool as a method: refuses what it cannot express, and keeps what it builds while that is right.

    Attributes:
        name: as in reports.
        kinds: the terms that it can express.
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most iterations; None for the tool's own default.
    """

    name: ClassVar[str]
    kinds: ClassVar[tuple[type, ...]]

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        """Take a budget."""
        if not 1e-10 <= tolerance <= 0.1:
            raise InputError(f"tolerance is {tolerance}; give metres from 1e-10 to 0.1")
        self.tolerance, self.iterations = tolerance, iterations
        self._built: tuple[tuple[Any, ...], Built] | None = None

    @abstractmethod
    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """What `build` reads: what it made is used again while these are the same objects, or equal numbers."""

    @abstractmethod
    def build(self, problem: Problem) -> Built:
        """What the tool needs besides what may change.

        Raises:
            InputError: the tool has no joint or shape of a kind that is needed.
        """

    def unsupported(self, problem: Problem) -> list[str]:
        """Names of what the tool cannot express."""
        return [where for where, term in named_terms(problem) if not isinstance(term, self.kinds)]

    def accepts(self, problem: Problem) -> str | None:
        """None where the tool can express all terms; else the sentence that names those that it cannot."""
        return refusal(self.name, self.unsupported(problem))

    def prepare(self, problem: Problem) -> None:
        """Build what the tool needs, unless it has it.

        Raises:
            InputError: the tool cannot express the problem, or its scene changed after it was stated.
        """
        self.ready(problem)

    def ready(self, problem: Problem) -> Built:
        """The same, and return it."""
        problem.check_fresh()
        refused = self.unsupported(problem)
        if refused:
            raise UnsupportedTermError(self.name, refused)
        asked = self.depends_on(problem)
        if self._built is None or not all(map(_same, self._built[0], asked)):
            self._built = asked, self.build(problem)
        return self._built[1]


class OneCall(Outside[Built], ABC):
    """A tool that is called once.

    Attributes:
        way: how it finds a posture, as solutions say it.
        failure: why there is none, where it finds none.
    """

    way: ClassVar[str]
    failure: ClassVar[str]

    @abstractmethod
    def found(self, built: Built, problem: Problem) -> tuple[Array | None, bool]:
        """The tool's posture (nq,), None where it has none, and whether it says that the posture meets everything."""

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture.

        Raises:
            InputError: the tool cannot express the problem, or its scene changed after it was stated.
        """
        began = time.perf_counter()
        built, figure = self.ready(problem), problem.scene.figure
        entry = TraceEntry(0.0, 0.0, 0.0, 0.0)
        with problem.borrow(), Control(None, progress) as control:
            q, met = self.found(built, problem)
            q = figure.clamp(problem.start if q is None else q)
            control.tell(entry)
        ending = Ending(q, True, 1, (entry,), self.way, "time", "" if met else self.failure)
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control, began=began)


def _same(first: Any, second: Any) -> bool:
    return first is second or (isinstance(first, (int, bytes)) and first == second)
