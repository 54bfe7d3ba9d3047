"""Rows that are violated are met one after the other, within bounds (Kaczmarz, 1937), as a compiled loop."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array
from wholebody.compiled import compiled

SWEEPS = 30  # over all rows in one round, at most
LEAST = 1e-9  # of the square of a row that moves anything, and m or rad by which a row is violated


@compiled()
def project(rows: Array, room: Array, low: Array, high: Array, gone: Array) -> None:
    """Add to a displacement (nv,) what meets the violated rows, one after the other, within bounds (nv,)."""
    count, size = rows.shape
    square, left = np.zeros(count), room.copy()
    for r in range(count):
        for k in range(size):
            square[r] += rows[r, k] * rows[r, k]
            left[r] -= rows[r, k] * gone[k]  # the room is that at the displacement so far
    for _ in range(SWEEPS):
        changed = False
        for r in range(count):
            if square[r] < LEAST:
                continue
            here = left[r]
            for k in range(size):
                here += rows[r, k] * gone[k]
            if here < -LEAST:
                changed = True
                for k in range(size):
                    gone[k] = min(max(gone[k] - here / square[r] * rows[r, k], low[k]), high[k])
        if not changed:
            return
