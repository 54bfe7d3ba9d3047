"""Normal equations by sparse Cholesky: symbolic analysis once, values and numeric factor at every iteration."""

from __future__ import annotations

import sys
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.methods.newton.linear_algebra.base import LinearSystem, Pattern, SingularSystemError, by_normal_equations

Places = NDArray[np.int32]


class NormalEquations:
    """J D^-1 J' + M by Eigen's SimplicialLDLT or SimplicialLLT with AMD ordering (eq. 10)."""

    def __init__(self, pattern: Pattern, *, square_root: bool = False) -> None:
        """Build and analyse; `square_root` uses L L' in place of L D L'."""
        import eigenpy

        self.name = "normal/llt" if square_root else "normal/ldlt"
        self.pattern = pattern
        self._gram = Gram(pattern)
        self._success = eigenpy.ComputationInfo.Success
        self._factor: Any = eigenpy.SimplicialLLT() if square_root else eigenpy.SimplicialLDLT()
        self._factor.analyzePattern(self._gram.matrix)

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor."""
        return int(self._factor.matrixL().nnz)

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Refill, refactorise, solve."""
        self._gram.refill(system.values, system.weight, system.damping)
        self._factor.factorize(self._gram.matrix)
        if self._factor.info() != self._success:
            raise SingularSystemError("the equations depend on each other; damp them")
        return by_normal_equations(self.pattern, system, self._factor.solve)


class Gram:
    """Lower triangle of J D^-1 J' + M in compressed columns.

    Attributes:
        matrix: scipy's csc_matrix, whose data `refill` overwrites.
    """

    def __init__(self, pattern: Pattern) -> None:
        """Pair the entries of J that share a column, and find the entries of their products."""
        from scipy.sparse import csc_matrix

        self.pattern = pattern
        first, second = _pairs(pattern)
        rows = np.concatenate([pattern.rows[first], np.arange(pattern.height)])
        columns = np.concatenate([pattern.rows[second], np.arange(pattern.height)])
        key = columns * pattern.height + rows
        places, index = np.unique(key, return_inverse=True)
        column = places // max(pattern.height, 1)
        pointer = np.searchsorted(column, np.arange(pattern.height + 1)).astype(np.int32)
        shape = (pattern.height, pattern.height)
        inner = (places % max(pattern.height, 1)).astype(np.int32)
        self.matrix = csc_matrix((np.zeros(len(places)), inner, pointer), shape=shape)
        order = np.argsort(index[: len(first)], kind="stable")
        target = index[: len(first)][order]
        filled = np.unique(target)
        starts = np.append(np.searchsorted(target, filled), len(first))
        self._diagonal = index[len(first) :]
        compiled_kernel()
        self._first, self._second = first[order].astype(np.int32), second[order].astype(np.int32)
        self._starts, self._filled = starts.astype(np.int32), filled.astype(np.int32)

    def refill(self, values: Array, weight: Array, damping: Array) -> None:
        """Compute the matrix for values (nnz,) of J, diagonals D and M."""
        scaled = values / weight[self.pattern.columns]
        data = self.matrix.data
        data[:] = 0.0
        _sum_products(scaled, values, self._first, self._second, self._starts, self._filled, data)
        data[self._diagonal] += damping


@compiled()
def _sum_products(
    scaled: Array, values: Array, first: Places, second: Places, starts: Places, filled: Places, data: Array
) -> None:
    """Write the sums of scaled[first] values[second] between starts into data, at the indices `filled`."""
    for k in range(len(filled)):
        total = 0.0
        for p in range(starts[k], starts[k + 1]):
            total += scaled[first[p]] * values[second[p]]
        data[filled[k]] = total


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """This module, after its loop is compiled or loaded from the cache, before a solve."""
    none, places = np.zeros(0), np.zeros(0, dtype=np.int32)
    _sum_products(none, none, places, places, np.zeros(1, dtype=np.int32), places, none)
    return sys.modules[__name__]


def _pairs(pattern: Pattern) -> tuple[Indices, Indices]:
    """Pairs of entries (row >= row of the other) in one column."""
    order = np.lexsort((pattern.rows, pattern.columns))
    columns = pattern.columns[order]
    counts = np.bincount(columns, minlength=pattern.width)
    place = np.arange(len(columns)) - np.repeat(np.cumsum(counts) - counts, counts)
    after = counts[columns] - place  # partners of an entry: itself and all that follow in its column
    first = np.repeat(np.arange(len(columns)), after)
    offset = np.arange(len(first)) - np.repeat(np.cumsum(after) - after, after)
    return order[first + offset], order[first]
