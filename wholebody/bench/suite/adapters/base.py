"""What comparisons ask of an adapter: a method that solves, and a tool that follows a reach step by step.

`Outside` is a tool as a method; `OneCall` one that finds a posture by one call, with no step to repeat.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError
from wholebody.methods.base import Method, SolvesAnew, UnsupportedTermError, named_terms, refusal, unseen
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress
from wholebody.problem import Problem
from wholebody.solution import Solution, TraceEntry

Budget = tuple[float, "int | None"]
"""Tolerance [m, rad], and the most iterations, or None for the method's own default, or FEASIBILITY_ONLY."""

FEASIBILITY_ONLY = -1  # in place of a count of iterations: the first feasible posture, whatever its measures are

LADDER: tuple[Budget, ...] = tuple((tol, None) for tol in (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8))
"""Tolerances from cheap to exact; each adapter begins and ends where it makes sense for it."""


@dataclass(frozen=True)
class Adapter:
    """A method as it takes part in comparisons.

    `make`: a fresh method from a tolerance and the most iterations; `loose`: budgets from cheap to exact, those of
    feasibility only before the others; `prepare`: builds what a solve needs, untimed, or raises InputError where the
    method cannot express a problem; `setup` and `differences`: sentences for reports.
    """

    name: str
    make: Callable[[float, int | None], Method]
    loose: tuple[Budget, ...]
    prepare: Callable[[Any, Problem], None] = lambda method, problem: None
    setup: str = ""
    differences: tuple[str, ...] = ()


def made(kind: Callable[..., Method], fewer: Mapping[str, Any], tolerance: float, iterations: int | None) -> Method:
    """A method by a budget; `fewer` are its further settings where iterations are counted."""
    if iterations is None:
        return kind(tolerance=tolerance)
    return kind(tolerance=tolerance, iterations=iterations, **fewer)


def few(*iterations: int) -> tuple[Budget, ...]:
    """Budgets of so many iterations each."""
    return tuple((1e-3, count) for count in iterations)


class Tool(ABC):
    """Follows a reach, step by step, from its own last posture; in steps without an answer it stays where it is."""

    name: str
    failures: int = 0

    @abstractmethod
    def reset(self, q: Array) -> None:
        """Go to a posture (nq,)."""

    @abstractmethod
    def step(self, target: Array) -> None:
        """Move one step towards a target (3,); this is what is timed."""

    @abstractmethod
    def posture(self) -> Array:
        """Where it is now: a fresh posture (nq,) of our figure."""

    def remarks(self) -> dict[str, float]:
        """What a tool tells of its own steps; empty where it tells nothing."""
        return {}

    def programs(self) -> dict[str, int]:
        """How many quadratic programs each way to solve them closed; empty where the tool does not tell."""
        return {}


Built = TypeVar("Built")


class Outside(SolvesAnew, ABC, Generic[Built]):
    """A tool as a method: refuses terms other than `kinds`, and keeps what it builds while that is right."""

    name: ClassVar[str]
    kinds: ClassVar[tuple[type, ...]]
    blind: ClassVar[bool] = False  # whether it knows no contacts
    loose: ClassVar[tuple[Budget, ...]] = (*few(5, 10, 20), *LADDER)

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        if not 1e-10 <= tolerance <= 0.1:
            raise InputError(f"tolerance is {tolerance}; give metres from 1e-10 to 0.1")
        self.tolerance, self.iterations = tolerance, iterations
        self._built: tuple[tuple[Any, ...], Built] | None = None

    @abstractmethod
    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """What `build` reads: what it made is used again while these are the same objects, or equal numbers."""

    @abstractmethod
    def build(self, problem: Problem) -> Built:
        """What the tool needs besides what may change; InputError where it has no such joint or shape."""

    def unsupported(self, problem: Problem) -> list[str]:
        """Names of what the tool cannot express."""
        return [where for where, term in named_terms(problem) if not isinstance(term, self.kinds)]

    def accepts(self, problem: Problem) -> str | None:
        """None where the tool can express all terms; else the sentence that names those that it cannot."""
        return refusal(self.name, self._refused(problem))

    def leaves_out(self, problem: Problem) -> tuple[str, ...]:
        """Names of what the tool does not look at: what people have by default, and contacts where it knows none."""
        return unseen(problem, lambda term: isinstance(term, self.kinds), contacts=self.blind)

    def _refused(self, problem: Problem) -> list[str]:
        several = problem.scene.figure.root == "several"
        return [*self.unsupported(problem), *(["several figures (its model is of one)"] if several else [])]

    def prepare(self, problem: Problem) -> None:
        """Build what the tool needs; InputError where it cannot express the problem, or the scene changed."""
        self.ready(problem)

    def ready(self, problem: Problem) -> Built:
        """The same, and return it."""
        problem.check_fresh()
        refused = self._refused(problem)
        if refused:
            raise UnsupportedTermError(self.name, refused)
        asked = self.depends_on(problem)
        if self._built is None or not all(map(_same, self._built[0], asked)):
            self._built = asked, self.build(problem)
        return self._built[1]


class OneCall(Outside[Built], ABC):
    """A tool that is called once; `way` is how it finds a posture, `failure` why there is none."""

    way: ClassVar[str]
    failure: ClassVar[str]

    @abstractmethod
    def found(self, built: Built, problem: Problem) -> tuple[Array | None, bool]:
        """The tool's posture (nq,), None where it has none, and whether it says that the posture meets everything."""

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture; InputError as in `prepare`."""
        built, figure = self.ready(problem), problem.scene.figure
        entry = TraceEntry(0.0, 0.0, 0.0, 0.0)
        with Control(None, progress) as control, problem.borrow():
            q, met = self.found(built, problem)
            q = figure.clamp(problem.start if q is None else q)
            control.tell(entry)
        ending = Ending(q, True, 1, (entry,), self.way, "time", "" if met else self.failure)
        ending = with_values(ending, left_out=self.leaves_out(problem))
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)


def _same(first: Any, second: Any) -> bool:
    return first is second or (isinstance(first, (int, bytes)) and first == second)
