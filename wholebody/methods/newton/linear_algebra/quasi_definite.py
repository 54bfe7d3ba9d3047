"""The whole KKT matrix by sparse L D L', which forms no products and so stays sparse with dense columns."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.methods.newton.linear_algebra.base import LinearSystem, Pattern, SingularSystemError

LEAST_DAMPING = 1e-10  # times the largest weight's inverse: makes the matrix quasi-definite; smaller = less stable
REFINEMENTS = 2  # steps of iterative refinement that remove the error of the damping


class QuasiDefinite:
    """L D L' of [H, -J'; -J, -M] with AMD ordering (Vanderbei 1995, "Symmetric quasi-definite matrices").

    H is the diagonal D, or D plus a sparse matrix of second derivatives.
    """

    name = "kkt/ldlt"

    def __init__(self, pattern: Pattern, second: tuple[Indices, Indices] | None = None) -> None:
        """Build and analyse.

        Args:
            pattern: of J.
            second: rows and columns (k,) of the lower triangle of second derivatives, which may repeat.
        """
        import eigenpy
        from scipy.sparse import csc_matrix

        n, m = pattern.width, pattern.height
        none = np.zeros(0, dtype=np.intp)
        row, column = second if second is not None else (none, none)
        size = n + m
        self._seconds = len(row)
        rows = np.concatenate([np.arange(size), n + pattern.rows, row])
        columns = np.concatenate([np.arange(size), pattern.columns, column])
        places, index = np.unique(columns * size + rows, return_inverse=True)
        pointer = np.searchsorted(places // size, np.arange(size + 1)).astype(np.int32)
        self.pattern, self._index = pattern, index
        self._matrix = csc_matrix((np.zeros(len(places)), (places % size).astype(np.int32), pointer), (size, size))
        self._success = eigenpy.ComputationInfo.Success
        self._factor: Any = eigenpy.SimplicialLDLT()
        self._factor.analyzePattern(self._matrix)

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor."""
        return int(self._factor.matrixL().nnz)

    def solve(self, system: LinearSystem, second: Array | None = None) -> tuple[Array, Array]:
        """Refill, refactorise, solve; `second` (k,) are the values of the second derivatives."""
        n, values = self.pattern.width, system.values
        least = LEAST_DAMPING / system.weight.min(initial=1.0)
        extra = np.zeros(self._seconds) if second is None else second
        data = np.concatenate([system.weight, -np.maximum(system.damping, least), -values, extra])
        self._matrix.data[:] = np.bincount(self._index, data, len(self._matrix.data))
        self._factor.factorize(self._matrix)
        if self._factor.info() != self._success:
            raise SingularSystemError("the KKT matrix has no factor; damp it")
        wanted = np.concatenate([-system.gradient, system.residual])
        found = self._factor.solve(wanted)
        slack = np.maximum(least - system.damping, 0.0)
        for _ in range(REFINEMENTS):  # residual of the matrix without the least damping: differs by -slack y
            error = wanted - self._times(found)
            error[n:] -= slack * found[n:]
            found = found + self._factor.solve(error)
        if not np.isfinite(found).all():
            raise SingularSystemError("the equations depend on each other; damp them")
        return found[:n], found[n:]

    def convex(self) -> bool:
        """Whether the last matrix is positive definite on the null space of J: its inertia is (n, m, 0)."""
        pivots = self._factor.vectorD()
        return int((pivots < 0.0).sum()) == self.pattern.height

    def _times(self, x: Array) -> Array:
        lower = self._matrix
        result: Array = lower @ x + lower.T @ x - lower.diagonal() * x
        return result
