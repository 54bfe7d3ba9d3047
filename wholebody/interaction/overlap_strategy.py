"""What the ways to remove overlap have in common."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from wholebody.arrays import Array


class Resolution(NamedTuple):
    """How the overlap of one frame was removed; the other attributes are those of `wholebody.interaction.Frame`.

    Attributes:
        candidates: postures (nq,) to show, the best one first; the next is taken if the way to one is not free.
        swept: the way to the first of them was swept and is free.
    """

    candidates: tuple[Array, ...]
    contact_seconds: float
    solve_seconds: float
    iterations: int
    joints: int
    pairs: int
    note: str
    swept: bool = False


class OverlapStrategy(Protocol):
    """A way to remove overlap."""

    @property
    def sweep_tolerance(self) -> float:
        """Depth, metres, to which the way from frame to frame may go in: less than what its postures may keep."""

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""
