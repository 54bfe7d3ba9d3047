"""Small dense linear algebra as compiled loops: at these sizes a call to BLAS costs more than its work."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled

LEAST = 1e-9  # of the square of a row that moves anything, and m or rad by which a row is violated


@compiled(inner=True, error_model="numpy", fastmath={"contract", "reassoc"})
def dot(a: Array, b: Array) -> float:
    """The product of two vectors."""
    total = 0.0
    for i in range(len(b)):
        total += a[i] * b[i]
    return total


@compiled(inner=True)
def copy(source: Array, target: Array) -> None:
    """Copy a vector number by number: for `target[:] = source` numba compiles how Python writes strings."""
    for i in range(len(target)):
        target[i] = source[i]


@compiled(inner=True)
def add(factor: float, row: Array, total: Array) -> None:
    """Add a multiple of a row to a vector, in place."""
    for i in range(len(total)):
        total[i] += factor * row[i]


@compiled(inner=True, error_model="numpy", fastmath={"contract", "reassoc"})
def gram(scaled: Array, stacked: Array, size: int, system: Array) -> None:
    """Lower triangle (size, size) of the products of rows, four at a time."""
    n = stacked.shape[1]
    for r in range(size):
        own = scaled[r]
        s = 0
        while s + 3 <= r:
            a, b, c, d = 0.0, 0.0, 0.0, 0.0
            for i in range(n):
                entry = own[i]
                a += entry * stacked[s, i]
                b += entry * stacked[s + 1, i]
                c += entry * stacked[s + 2, i]
                d += entry * stacked[s + 3, i]
            system[r, s], system[r, s + 1], system[r, s + 2], system[r, s + 3] = a, b, c, d
            s += 4
        while s <= r:
            system[r, s] = dot(own, stacked[s])
            s += 1


@compiled(inner=True, error_model="numpy", fastmath={"contract", "reassoc"})
def factorise(system: Array) -> bool:
    """Write Cholesky's L into the lower triangle of L L' (n, n); false where that is not positive definite."""
    for i in range(len(system)):
        for j in range(i + 1):
            total = system[i, j]
            for p in range(j):
                total -= system[i, p] * system[j, p]
            if j < i:
                system[i, j] = total / system[j, j]
            elif total > 0.0:
                system[i, i] = np.sqrt(total)
            else:
                return False
    return True


@compiled(inner=True, error_model="numpy", fastmath={"contract", "reassoc"})
def substitute(root: Array, right: Array) -> None:
    """Solve L L' x = b in place of b (n,), with L in the lower triangle of a matrix."""
    for i in range(len(right)):
        total = right[i]
        for p in range(i):
            total -= root[i, p] * right[p]
        right[i] = total / root[i, i]
    for i in range(len(right) - 1, -1, -1):
        right[i] /= root[i, i]
        for p in range(i):
            right[p] -= root[i, p] * right[i]


@compiled(inner=True)
def solve(system: Array, right: Array) -> bool:
    """Solve a symmetric positive definite system in place by Cholesky's L L'; false where it is not one."""
    if not factorise(system):
        return False
    substitute(system, right)
    return True


@compiled(inner=True, error_model="numpy")
def sort(values: Array, order: Indices) -> None:
    """Put the places of values (k,) into `order`, the least first, stably: by insertion, as few are out of order."""
    for place in range(len(order)):
        back = place - 1
        while back >= 0 and values[order[back]] > values[place]:
            order[back + 1] = order[back]
            back -= 1
        order[back + 1] = place


@compiled(inner=True, error_model="numpy")
def least_squares(table: Array, size: int, x: Array) -> None:
    """Minimise |A x - b|^2 + |R x - c|^2 into x (n,) by Householder's QR; `table` has A, b over R, c."""
    # (size + n, n + 1), overwritten; long rows first are stable row by row (Cox and Higham 1998)
    columns = len(x)
    work = np.empty(columns + 1)
    for c in range(columns):
        last = size + c + 1  # the rows of R below have nothing in this column yet
        square = 0.0
        for r in range(c, last):
            square += table[r, c] * table[r, c]
        norm = -np.sqrt(square) if table[c, c] > 0.0 else np.sqrt(square)
        head = table[c, c] - norm  # Householder's vector: this, and the column below
        scale = -1.0 / (norm * head)
        for d in range(c + 1, columns + 1):
            work[d] = head * table[c, d]
        for r in range(c + 1, last):
            entry = table[r, c]
            if entry != 0.0:
                for d in range(c + 1, columns + 1):
                    work[d] += entry * table[r, d]
        for d in range(c + 1, columns + 1):
            work[d] *= scale
            table[c, d] -= head * work[d]
        for r in range(c + 1, last):
            entry = table[r, c]
            if entry != 0.0:
                for d in range(c + 1, columns + 1):
                    table[r, d] -= entry * work[d]
        table[c, c] = norm
    for c in range(columns - 1, -1, -1):
        total = table[c, columns]
        for d in range(c + 1, columns):
            total -= table[c, d] * x[d]
        x[c] = total / table[c, c]


@compiled()
def project(rows: Array, room: Array, low: Array, high: Array, gone: Array) -> None:
    """Add to a displacement (nv,) what meets the violated rows, one after the other, within bounds (Kaczmarz, 1937)."""
    count, size = rows.shape
    square, left = np.zeros(count), room.copy()
    for r in range(count):
        for k in range(size):
            square[r] += rows[r, k] * rows[r, k]
            left[r] -= rows[r, k] * gone[k]  # the room is that at the displacement so far
    for _ in range(30):  # over all rows, at most
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
