"""The filling of OSQP's arrays, as compiled loops: see `osqp_solver`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled


@compiled()
def within(rows: Array, pattern: NDArray[np.bool_]) -> bool:
    """Whether rows (m, n) are zero outside of a pattern (m, n)."""
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            if rows[i, c] != 0.0 and not pattern[i, c]:
                return False
    return True


@compiled(error_model="numpy")
def fill(
    diagonal: Array,
    linear: Array,
    rows: Array,
    target: Array,
    weight: Array,
    elastic: Array,
    least: Array,
    elastic_weight: Array,
    lower: Array,
    upper: Array,
    starts: NDArray[np.int64],
    places: NDArray[np.int64],
    slots: int,
    scale: float,
    heaviest: float,
    inactive: float,
    infinite: float,
    hessian: Array,
    gradient: Array,
    values: Array,
    low: Array,
    high: Array,
) -> None:
    """Write a program's numbers where OSQP's pattern has them.

    The first ten are the program's. `places` has the rows of the pattern of the soft rows, column by column, `starts`
    (n + 1,) where each column begins in it; there are `slots` elastic rows, at least the program's. x is multiplied by
    `scale`, a row by the root of its weight up to the root of `heaviest`. `inactive` is the least value of slots
    without a row, `infinite` OSQP's infinity. The last five are filled: the diagonal of P, q, the entries of A column
    by column, and the bounds of its rows.
    """
    n, m, k = len(diagonal), len(target), len(least)
    root, elastic_root = np.empty(m), np.empty(k)
    for i in range(m):
        root[i] = np.sqrt(min(weight[i], heaviest))
        low[n + i] = high[n + i] = root[i] * target[i]
        hessian[n + i], gradient[n + i] = 1.0, 0.0
    for j in range(slots):
        if j < k:
            elastic_root[j] = np.sqrt(min(elastic_weight[j], heaviest))
        low[n + m + j] = elastic_root[j] * least[j] if j < k else inactive
        high[n + m + j] = infinite
        hessian[n + m + j], gradient[n + m + j] = 1.0, 0.0
    at = 0
    for c in range(n):
        hessian[c], gradient[c] = diagonal[c] / (scale * scale), linear[c] / scale
        low[c], high[c] = scale * lower[c], scale * upper[c]
        values[at] = 1.0
        at += 1
        for place in range(starts[c], starts[c + 1]):
            i = places[place]
            values[at] = root[i] / scale * rows[i, c]
            at += 1
        for j in range(slots):
            values[at + j] = elastic_root[j] / scale * elastic[j, c] if j < k else 0.0
        at += slots
    for i in range(m):
        values[at + i] = -root[i] / np.sqrt(weight[i])
    at += m
    for j in range(slots):
        values[at + j] = elastic_root[j] / np.sqrt(elastic_weight[j]) if j < k else 1.0
