"""Calls whose types numba has looked up before: results are those of Python for each type."""

from __future__ import annotations

import numpy as np

from wholebody.base.compiled import compiled


def walked(rows):
    """Loops, branches, a constant tuple, views and a division."""
    total, (first, last) = 0.0, (0, len(rows))
    for i in range(first, last):
        row = rows[i]
        for k in range(len(row)):
            total += row[k] / (1 + i) if k != i else -row[k]
    for scale, other in ((2.0, 0), (3.0, 1)):
        total += scale * rows[other, 0]
    return total


def test_loops_have_the_results_of_python_also_where_calls_are_known_by_other_types():
    rows = np.random.default_rng(1).normal(size=(4, 5))
    loop = compiled()(walked)
    for given in (rows, rows.astype(np.float32), np.arange(20).reshape(4, 5), rows):
        np.testing.assert_allclose(loop(given), walked(given), rtol=1e-5)
    assert len(loop.signatures) == 3
