"""Normal equations with dense columns split off, so that a hub adds little cost to that of its arms."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.methods.newton.linear_algebra.base import LinearSystem, Pattern, SingularSystemError, by_normal_equations
from wholebody.methods.newton.linear_algebra.normal_equations import Gram


class DenseColumns:
    """The modified Schur complement (eqs. 11 and 12; Andersen 1996, ACM Transactions on Mathematical Software 22).

    With A_s the sparse and A_D the dense columns of J D^-1/2, A_s A_s' + M + F F' is factorised sparsely. Each column
    of F has one non-zero, in a row that would be empty without it. A small dense system adds A_D and removes F.
    """

    name = "normal/schur"

    def __init__(self, pattern: Pattern, dense: Indices) -> None:
        """Build and analyse; `dense` are the columns to split off."""
        import eigenpy

        self.pattern = pattern
        is_dense = np.zeros(pattern.width, dtype=bool)
        is_dense[dense] = True
        self._split = np.flatnonzero(is_dense[pattern.columns])
        self._rest = np.flatnonzero(~is_dense[pattern.columns])
        place = np.cumsum(is_dense) - 1
        self._dense = dense
        self._dense_at = (pattern.rows[self._split], place[pattern.columns[self._split]])
        sparse = Pattern(pattern.rows[self._rest], pattern.columns[self._rest], pattern.height, pattern.width)
        self._gram = Gram(sparse)
        empty = np.bincount(sparse.rows, minlength=pattern.height) == 0
        self._bare = np.flatnonzero(empty)
        self._success = eigenpy.ComputationInfo.Success
        self._factor = eigenpy.SimplicialLDLT()
        self._factor.analyzePattern(self._gram.matrix)

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor, with the dense columns."""
        columns = len(self._dense) + len(self._bare)
        return int(self._factor.matrixL().nnz) + columns * self.pattern.height

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Refill, refactorise, solve both systems."""
        height, wide = self.pattern.height, len(self._dense)
        extra = np.zeros(height)
        extra[self._bare] = 1.0
        self._gram.refill(system.values[self._rest], system.weight, system.damping + extra)
        self._factor.factorize(self._gram.matrix)
        if self._factor.info() != self._success:
            raise SingularSystemError("the equations depend on each other; damp them")
        border = np.zeros((height, wide + len(self._bare)))
        border[self._dense_at] = system.values[self._split]
        border[:, :wide] /= np.sqrt(system.weight[self._dense])
        border[self._bare, wide + np.arange(len(self._bare))] = 1.0
        through = self._factor.solve(border)
        corner = np.diag(np.concatenate([-np.ones(wide), np.ones(len(self._bare))]))
        small = corner - border.T @ through

        def solve(right: Array) -> Array:
            direct = self._factor.solve(right)
            result: Array = direct - through @ np.linalg.solve(small, -(border.T @ direct))
            return result

        try:
            return by_normal_equations(self.pattern, system, solve)
        except np.linalg.LinAlgError:
            raise SingularSystemError("the equations depend on each other; damp them") from None
