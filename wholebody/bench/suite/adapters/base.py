"""What comparisons ask of an adapter: a method that solves, and a tool that follows a reach step by step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from wholebody.base.arrays import Array
from wholebody.methods.base import Method
from wholebody.problem import Problem

Budget = tuple[float, "int | None"]
"""Tolerance [m, rad], and the most iterations, or None for the method's own default, or FEASIBILITY_ONLY."""

FEASIBILITY_ONLY = -1
"""In place of a count of iterations: the first posture that fits, whatever its measures are."""

LADDER: tuple[Budget, ...] = tuple((tol, None) for tol in (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8))
"""Tolerances from cheap to exact; each adapter begins and ends where it makes sense for it."""

REACH_COST = 1.0
POSTURE_COST = 1e-3
"""Ratio of what a metre and a radian cost in the tools that weigh them: errors are squared after this."""


def _nothing(method: Any, problem: Problem) -> None:
    pass


@dataclass(frozen=True)
class Adapter:
    """A method as it takes part in comparisons.

    Attributes:
        name: "qp", "qp/osqp", "ccd", "newton/slack", ...; it has one colour in all charts.
        make: a fresh method from a tolerance and the most iterations, as in a `Budget`.
        loose: budgets from cheap to exact, that draw its curve of speed against accuracy; those of feasibility only
            go before.
        prepare: builds what a solve of a problem needs, so that it is not timed with it; raises InputError where the
            method cannot express the problem.
        hindered: a method, from a tolerance, whose quadratic programs are never finished, or that has one iteration;
            None where `make` does the latter.
        setup: how it was set up, for reports.
        differences: what it cannot express, or does otherwise; one sentence each.
    """

    name: str
    make: Callable[[float, int | None], Method]
    loose: tuple[Budget, ...]
    prepare: Callable[[Any, Problem], None] = _nothing
    hindered: Callable[..., Method] | None = None
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
    """Follows one reach, step by step, from its own last posture.

    Attributes:
        name: for tables.
        failures: steps for which it found no answer; it then stays where it is.
    """

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
