"""Squares of the rows of a program, added to a band matrix, as compiled loops without scipy: see `interior_point`."""

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


def compiled_kernel() -> ModuleType:
    """This module, with its loops compiled or loaded from the cache."""
    none, places, band = np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros((1, 1))
    begins = np.zeros(1, dtype=np.intp)
    add_rows(band, places, begins, none, none)
    return sys.modules[__name__]
