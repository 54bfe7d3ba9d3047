"""The filling of the scaled split form, as a compiled loop: see `split_form`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled


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
    scale: float,
    heaviest: float,
    inactive: float,
    form_diagonal: Array,
    form_linear: Array,
    matrix: Array,
    low: Array,
    high: Array,
    box_lower: Array,
    box_upper: Array,
) -> None:
    """Write a program's numbers into a scaled split form of its size, in which all else is as `empty_form` left it.

    The first ten are the program's, the last seven the form's. x is multiplied by `scale`, a row by the root of its
    weight up to the root of `heaviest`; `inactive` is the least value of slots without a row.
    """
    n, m, k = len(diagonal), len(target), len(least)
    for i in range(n):
        form_linear[i], form_diagonal[i] = linear[i] / scale, diagonal[i] / (scale * scale)
        box_lower[i], box_upper[i] = scale * lower[i], scale * upper[i]
    for r in range(m):
        root = np.sqrt(min(weight[r], heaviest))
        for i in range(n):
            matrix[r, i] = rows[r, i] * (root / scale)
        matrix[r, n + r] = -root / np.sqrt(weight[r])
        low[r] = high[r] = root * target[r]
    for j in range(len(low) - m):
        row = m + j
        root = np.sqrt(min(elastic_weight[j], heaviest)) if j < k else 0.0
        for i in range(n):
            matrix[row, i] = elastic[j, i] * (root / scale) if j < k else 0.0
        matrix[row, n + row] = root / np.sqrt(elastic_weight[j]) if j < k else 1.0
        low[row] = root * least[j] if j < k else inactive
