"""Squares of the rows of a program, added to a band matrix, as compiled loops without scipy: see `interior_point`."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled, with_loops


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


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """This module, with its loops compiled or loaded from the cache."""
    none, places = np.zeros(0), np.zeros(0, dtype=np.intp)
    add_rows(np.zeros((1, 1)), places, np.zeros(1, dtype=np.intp), none, none)
