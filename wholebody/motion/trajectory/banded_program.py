"""Quadratic programs with one block a frame and bands between: what is minimised, and the answer.

minimise    1/2 z' P z + c' z
subject to  lower <= G z <= upper,   least <= z <= most
"""

from __future__ import annotations

from typing import Any, NamedTuple

from wholebody.base.arrays import Array


class BandedQP(NamedTuple):
    """A program; matrices are scipy.sparse.csc_array or csc_matrix.

    Attributes:
        P: (n, n) symmetric, both triangles.
        c: (n,).
        G: (m, n).
        lower: (m,).
        upper: (m,).
        least: (n,).
        most: (n,).
        start: (n,) where an iteration may begin; None where nothing is known.
    """

    P: Any
    c: Array
    G: Any
    lower: Array
    upper: Array
    least: Array
    most: Array
    start: Array | None = None


class Answer(NamedTuple):
    """Of a program.

    Attributes:
        z: (n,) the minimiser; not finite numbers never occur.
        solved: whether the solver met its own conditions.
        iterations: of the solver.
    """

    z: Array
    solved: bool
    iterations: int
