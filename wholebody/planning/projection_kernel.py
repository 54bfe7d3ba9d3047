"""Compiled loops of plans: see `projected_motions` for projections and `tightening` for multipliers of rows."""

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
    """This module, with its loops compiled or loaded from the cache."""
    row, sides = np.zeros((1, 1)), np.zeros((2, 1))
    displace(row, np.ones(1), sides, sides, sides, np.zeros(1))
    projected_gauss_seidel(np.eye(1), np.zeros(1), np.zeros(1))
    return sys.modules[__name__]
