"""The protocol of overlap strategies."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from wholebody.arrays import Array


class Resolution(NamedTuple):
    """Result of the overlap removal of one frame; the other attributes are those of `wholebody.tracking.Frame`.

    Attributes:
        candidates: postures (nq,) to show, the best one first; the next is taken if the motion to one is not free.
        swept: whether the motion to the first of them was swept and is free, where nothing moves by itself.
        path: where things moved, shares of the frame and postures (nq,) on the way to the first of them.
    """

    candidates: tuple[Array, ...]
    contact_seconds: float
    solve_seconds: float
    iterations: int
    joints: int
    pairs: int
    note: str
    swept: bool = False
    path: tuple[tuple[float, Array], ...] = ()


class OverlapStrategy(Protocol):
    """An algorithm that removes overlap."""

    @property
    def sweep_tolerance(self) -> float:
        """Allowed depth of the motion from frame to frame, metres; less than that of its postures."""

    def resolve(self, shown: Array, tracked: Array) -> Resolution:
        """One frame from the overlap-free posture `shown` towards `tracked`, both (nq,)."""
