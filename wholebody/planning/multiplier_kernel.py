"""Multipliers of the rows of a program whose other unknowns are eliminated, as a compiled loop: see `tightening`."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled


@compiled(fastmath=True)
def projected_gauss_seidel(response: Array, gap: Array, force: Array) -> None:
    """Change multipliers (m,), not negative, until no gap is negative, by sweeps over the rows (Gauss-Seidel).

    A gap (m,) is what it was, which is overwritten, and `response` (m, m) times the multipliers.
    """
    count = len(gap)
    for row in range(count):
        for other in range(count):
            gap[row] += response[row, other] * force[other]
    for _ in range(100):  # more = nearer to the bounds, dearer
        moved = 0.0
        for row in range(count):
            own = response[row, row]
            if own < 1e-12:  # nothing moves it
                continue
            change = max(-gap[row] / own, -force[row])
            if change != 0.0:
                force[row] += change
                for other in range(count):
                    gap[other] += response[row, other] * change
                moved = max(moved, abs(change) * own)
        if moved < 1e-5:  # rad, m: a tenth of what counts as missed
            return


def compiled_kernel() -> ModuleType:
    """This module, with its loop compiled or loaded from the cache."""
    projected_gauss_seidel(np.eye(1), np.zeros(1), np.zeros(1))
    return sys.modules[__name__]
