"""What a descent sees of a posture, and where it ended."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.arrays import Array
from wholebody.geometry.continuous.moved_pairs import Placed
from wholebody.linearisation import Linearisation
from wholebody.methods.qp.subproblem import Rows, Violation


class Local(NamedTuple):
    """Where a descent ended.

    Attributes:
        q: (nq,) posture.
        violation: what is left there.
        measure: weighted sum of the measures.
        converged: whether it ended because nothing better is near, rather than out of iterations.
        iterations: how many programs were solved.
    """

    q: Array
    violation: Violation
    measure: float
    converged: bool
    iterations: int


class Visit(NamedTuple):
    """A posture that was looked at."""

    at: Linearisation
    rows: Rows
    violation: Violation
    placed: Placed
