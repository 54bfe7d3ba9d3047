"""What the run asks of a tool."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from wholebody.arrays import Array

REACH_COST = 1.0
POSTURE_COST = 1e-3
"""Ratio of what a metre and a radian cost in the tools that weigh them: errors are squared after this."""


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
