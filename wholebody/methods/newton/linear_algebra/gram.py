"""The matrix J D^-1 J' + M: its pattern is made once a structure, its values at every iteration."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.arrays import Array, Indices
from wholebody.methods.newton.linear_algebra.base import Pattern


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
        self._kernel = compiled_kernel()
        listed = (first[order], second[order], starts, filled)
        self._places = tuple(part.astype(np.int32) for part in listed)

    def refill(self, values: Array, weight: Array, damping: Array) -> None:
        """Compute the matrix for values (nnz,) of J, diagonals D and M."""
        scaled = values / weight[self.pattern.columns]
        data = self.matrix.data
        data[:] = 0.0
        self._kernel.sum_products(scaled, values, *self._places, data)
        data[self._diagonal] += damping


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or loaded from the cache, before a solve."""
    from wholebody.methods.newton.linear_algebra import gram_kernel

    none, places = np.zeros(0), np.zeros(0, dtype=np.int32)
    gram_kernel.sum_products(none, none, places, places, np.zeros(1, dtype=np.int32), places, none)
    return gram_kernel


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
