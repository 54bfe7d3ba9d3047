"""What comparisons ask of an adapter: a method that solves, and a tool that follows a reach step by step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

from wholebody.arrays import Array
from wholebody.methods.base import Method
from wholebody.problem import Problem

Budget = tuple[float, "int | None"]
"""Tolerance [m, rad], and the most iterations, or None for the method's own default, or FIRST_FIT."""

FIRST_FIT = -1
"""In place of a count of iterations: the first posture that fits, whatever its measures are."""

LADDER: tuple[Budget, ...] = (
    (1e-1, None),
    (3e-2, None),
    (1e-2, None),
    (3e-3, None),
    (1e-3, None),
    (1e-4, None),
    (1e-5, None),
    (1e-6, None),
    (1e-8, None),
)
"""Tolerances from cheap to exact; each adapter begins and ends where it makes sense for it."""


REACH_COST = 1.0
POSTURE_COST = 1e-3
"""Ratio of what a metre and a radian cost in the tools that weigh them: errors are squared after this."""


@runtime_checkable
class Prepared(Protocol):
    """A method that builds a model of its own before it can solve."""

    def prepare(self, problem: Problem) -> None:
        """Build what a solve of this problem needs; a solve without it builds it itself.

        Raises:
            InputError: the method cannot express the problem.
        """


@dataclass(frozen=True)
class Adapter:
    """A method as it takes part in comparisons.

    Attributes:
        name: "qp", "qp/osqp", "ccd", "newton/slack", ...; it has one colour in all charts.
        make: a fresh method from a tolerance and the most iterations, as in a `Budget`.
        loose: budgets from cheap to exact, that draw its curve of speed against accuracy; those of first fit go before.
        setup: how it was set up, for reports.
        differences: what it cannot express, or does otherwise; one sentence each.
        package: what has to be installed for it; None where it comes with wholebody.
    """

    name: str
    make: Callable[[float, int | None], Method]
    loose: tuple[Budget, ...]
    setup: str
    differences: tuple[str, ...] = ()
    package: str | None = None


def set_up(method: Method, problem: Problem) -> None:
    """Let a method build what it needs before a solve; nothing for one that needs nothing.

    Raises:
        InputError: the method cannot express the problem.
    """
    if isinstance(method, Prepared):
        method.prepare(problem)


def few(*iterations: int) -> tuple[Budget, ...]:
    """Budgets of so many iterations each."""
    return tuple((1e-3, count) for count in iterations)


class Tool(ABC):
    """Follows one reach, step by step, from its own last posture.

    Attributes:
        name: for tables.
        differences: what it cannot express of the task, or does otherwise; one sentence each.
        failures: steps for which it found no answer; it then stays where it is.
    """

    name: str
    differences: ClassVar[tuple[str, ...]] = ()
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
