"""One iteration of a projection onto what is held, as a compiled loop: see `projected_motions`."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import gram, solve

DAMPING = 1e-7  # m^2 and rad^2 of a projection; larger = more iterations, smaller = far off where rows are dependent


@compiled()
def displace(rows: Array, value: Array, sides: Array, aims: Array, box: Array, away: Array) -> bool:
    """Write the least displacement (nv,) within a box (2, nv) that brings values (c,) between their aims (2, c).

    Rows (c, nv) with equal aims count in any case. False, with nothing written, where all values are between `sides`
    (2, c) and the box has 0 in it.
    """
    size, missed = len(away), np.empty(len(value))
    met, count = True, 0
    mine, at = np.empty((len(value), size)), np.empty(len(value), dtype=np.intp)
    for row in range(len(value)):
        met = met and sides[0, row] <= value[row] <= sides[1, row]
        off = value[row] - min(max(value[row], aims[0, row]), aims[1, row])
        if off != 0.0 or aims[0, row] == aims[1, row]:
            missed[count], at[count] = off, row
            count += 1
    free = np.empty(size, dtype=np.bool_)
    for i in range(size):
        met = met and box[0, i] <= 0.0 <= box[1, i]
        free[i] = box[0, i] < box[1, i]
    if met:
        return False
    for i in range(size):
        away[i] = min(max(0.0, box[0, i]), box[1, i])
    system, force = np.empty((count, count)), np.empty(count)
    for _ in range(3):  # joints that end at their limits leave the rest to others
        for r in range(count):
            force[r] = missed[r]
            for i in range(size):
                entry = rows[at[r], i]
                mine[r, i] = entry if free[i] else 0.0
                force[r] += 0.0 if free[i] else entry * away[i]
        gram(mine, mine, count, system)
        for r in range(count):
            system[r, r] += DAMPING
        if not solve(system, force):
            return True
        inside = True
        for i in range(size):
            if free[i]:
                away[i] = 0.0
                for r in range(count):
                    away[i] -= mine[r, i] * force[r]
                if not box[0, i] <= away[i] <= box[1, i]:
                    away[i] = min(max(away[i], box[0, i]), box[1, i])
                    inside = free[i] = False
        if inside:
            break
    return True


def compiled_kernel() -> ModuleType:
    """This module, with its loop compiled or loaded from the cache."""
    row, sides = np.zeros((1, 1)), np.zeros((2, 1))
    displace(row, np.ones(1), sides, sides, sides, np.zeros(1))
    return sys.modules[__name__]
