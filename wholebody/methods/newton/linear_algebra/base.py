"""Types that all factorisations share."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import WholebodyError


class SingularSystemError(WholebodyError, ArithmeticError):
    """A linear system that the factorisation cannot solve; damp it more, or use a reference method."""


class Pattern(NamedTuple):
    """Structural non-zeros of a sparse Jacobian.

    Attributes:
        rows, columns: (nnz,) indices of the entries.
        height, width: the Jacobian's shape.
    """

    rows: Indices
    columns: Indices
    height: int
    width: int

    def dense(self, values: Array) -> Array:
        """The Jacobian as an array (height, width)."""
        result = np.zeros((self.height, self.width))
        np.add.at(result, (self.rows, self.columns), values)
        return result

    def times(self, values: Array, vector: Array) -> Array:
        """J vector, (height,)."""
        result = np.bincount(self.rows, values * vector[self.columns], self.height)
        return result.astype(np.float64, copy=False)

    def transpose_times(self, values: Array, vector: Array) -> Array:
        """J' vector, (width,)."""
        result = np.bincount(self.columns, values * vector[self.rows], self.width)
        return result.astype(np.float64, copy=False)


class LinearSystem(NamedTuple):
    """One system: values (nnz,) of J, diagonals D (width,) and M (height,), right-hand sides g and c."""

    values: Array
    weight: Array
    damping: Array
    gradient: Array
    residual: Array


class LinearAlgebra(Protocol):
    """A factorisation for one pattern."""

    name: str

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor."""

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Displacement (width,) and multipliers (height,).

        Raises:
            SingularSystemError: it has no unique solution to working accuracy.
        """


def by_normal_equations(pattern: Pattern, system: LinearSystem, solve: Any) -> tuple[Array, Array]:
    """Eliminate d: (J D^-1 J' + M) y = -c + J D^-1 g, then d = D^-1 (J' y - g)  (eqs. 9 and 10)."""
    free = system.gradient / system.weight
    y = solve(pattern.times(system.values, free) - system.residual)
    if not np.isfinite(y).all():
        raise SingularSystemError("the equations depend on each other; damp them")
    return pattern.transpose_times(system.values, y) / system.weight - free, y
