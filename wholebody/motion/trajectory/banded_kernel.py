"""Squares of the rows of a program, added to a band matrix, as compiled loops: see `interior_point`."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled


@compiled(fastmath=True)
def add_rows(band: Array, first: Indices, begins: Indices, values: Array, weights: Array) -> None:
    """Add the sum over rows r of w_r a_r a_r' to a symmetric band matrix."""
    # `band` (n, k): entry (j, i) is at row j + i, column j; `first` (m,) columns, `begins` (m + 1,) into `values`.
    for row in range(len(first)):
        begin, end = begins[row], begins[row + 1]
        for at in range(begin, end):
            scaled = weights[row] * values[at]
            if scaled != 0.0:
                column = first[row] + at - begin
                for to in range(at, end):
                    band[column, to - at] += scaled * values[to]


@compiled(fastmath=True)
def add_sums(
    band: Array, first: Indices, begins: Indices, values: Array, factors: Array, members: Indices, groups: Indices,
    weights: Array,
) -> None:  # fmt: skip
    """Add the sum over groups g of w_g v_g v_g', v_g the group's rows times their factors; see `add_rows`."""
    total = np.zeros(band.shape[0])
    for group in range(len(groups) - 1):
        least, most = band.shape[0], 0
        for k in range(groups[group], groups[group + 1]):
            row = members[k]
            begin, end, column = begins[row], begins[row + 1], first[row]
            if end > begin:
                least, most = min(least, column), max(most, column + end - begin)
                for at in range(begin, end):
                    total[column + at - begin] += factors[row] * values[at]
        for column in range(least, most):
            scaled = weights[group] * total[column]
            if scaled != 0.0:
                for to in range(column, most):
                    band[column, to - column] += scaled * total[to]
        total[least:most] = 0.0


def compiled_kernel() -> ModuleType:
    """This module, with its loops compiled or loaded from the cache."""
    none, places, band = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((1, 1))
    begins = np.zeros(1, dtype=np.intp)
    add_rows(band, places, begins, none, none)
    add_sums(band, places, begins, none, none, places, begins, none)
    return sys.modules[__name__]
