"""The minimiser of a quadratic program with its active set fixed, as compiled loops: see `active_set`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import add, dot, gram, solve


@compiled(error_model="numpy")
def minimise_on_face(
    diagonal: Array,
    linear: Array,
    lower: Array,
    upper: Array,
    at_lower: Mask,
    at_upper: Mask,
    stacked: Array,
    right: Array,
    compliance: Array,
    size: int,
    row_tolerance: float,
    scaled: Array,
    table: Array,
    inverse: Array,
    trial: Array,
    multiplier: Array,
    gradient: Array,
    x: Array,
) -> bool:
    """Minimiser x (n,) with some bounds held and some rows counted, which may be out of the other bounds.

    `stacked` (size or more, n), `right` and `compliance` (size or more,) are the soft and the pushing elastic rows,
    what they are to be and their inverse weights. `scaled` (n or more, n), `table` (n^2 or more,), `inverse` and
    `trial` (n,) are room. `multiplier` (size or more,) becomes weight times residual of each row, `gradient` (n,) the
    derivative by x. Residuals off by more than `row_tolerance` are computed by the other system.

    Returns:
        Whether x is finite.
    """
    n = len(x)
    for i in range(n):
        held = at_lower[i] or at_upper[i]
        x[i] = lower[i] if at_lower[i] else (upper[i] if at_upper[i] else 0.0)
        inverse[i] = 0.0 if held else 1.0 / diagonal[i]
        gradient[i] = linear[i]
    in_columns = size > n
    if 0 < size <= n:
        system = table[: size * size].reshape((size, size))
        for r in range(size):
            for i in range(n):
                scaled[r, i] = stacked[r, i] * inverse[i]
            multiplier[r] = dot(stacked[r], x) - dot(scaled[r], linear) - right[r]
        gram(scaled, stacked, size, system)
        for r in range(size):
            system[r, r] += compliance[r]
        in_columns = not solve(system, multiplier[:size])
        if not in_columns:
            for i in range(n):
                trial[i] = linear[i]
            for r in range(size):
                add(multiplier[r], stacked[r], trial)
            for i in range(n):
                trial[i] = x[i] - inverse[i] * trial[i]
            worst = 0.0
            for r in range(size):
                left = abs(dot(stacked[r], trial) - right[r] - compliance[r] * multiplier[r])
                if not left <= worst:
                    worst = left
            in_columns = not worst <= row_tolerance
    if in_columns:
        _minimise_in_columns(stacked, right, compliance, size, diagonal, linear, inverse, x, multiplier)
    for r in range(size):
        add(multiplier[r], stacked[r], gradient)
    finite = True
    for i in range(n):
        if not in_columns:
            x[i] -= inverse[i] * gradient[i]
        gradient[i] += diagonal[i] * x[i]
        finite = finite and np.isfinite(x[i])
    return finite


@compiled(inner=True, error_model="numpy")
def _minimise_in_columns(
    stacked: Array,
    right: Array,
    compliance: Array,
    size: int,
    diagonal: Array,
    linear: Array,
    inverse: Array,
    x: Array,
    multiplier: Array,
) -> None:
    """Minimiser on a face with more rows than variables, by Householder's QR of the weighted rows.

    The free entries of x minimise |W^1/2 (A x - b)|^2 + |D^1/2 x + D^-1/2 g|^2. The rows stand in the order of their
    weights, for which the factorisation is stable row by row (Cox and Higham 1998): heavy rows lose no digits to light
    ones, nor light ones to heavy.

    Args:
        stacked: (size or more, n) rows A.
        right: (size or more,) b.
        compliance: (size or more,) inverse weights.
        size: how many rows count.
        diagonal: (n,) D.
        linear: (n,) g.
        inverse: (n,) 1 / D of the free variables, 0 of the held ones.
        x: (n,) with the held entries; the free ones are filled in.
        multiplier: (size or more,) is filled with the weight times the residual of each row.
    """
    n = len(x)
    free = inverse.nonzero()[0]
    columns = len(free)
    order = np.arange(size)
    for place in range(1, size):  # few weights, and most of them in order: cheaper than a general sort, and stable
        own, back = order[place], place - 1
        while back >= 0 and compliance[order[back]] > compliance[own]:
            order[back + 1] = order[back]
            back -= 1
        order[back + 1] = own
    table = np.zeros((size + columns, columns + 1))
    for place in range(size):
        r = order[place]
        root = 1.0 / np.sqrt(compliance[r])
        total = right[r]
        for i in range(n):
            if inverse[i] == 0.0:
                total -= stacked[r, i] * x[i]
        for c in range(columns):
            table[place, c] = root * stacked[r, free[c]]
        table[place, columns] = root * total
    for c in range(columns):
        root = np.sqrt(diagonal[free[c]])
        table[size + c, c] = root
        table[size + c, columns] = -linear[free[c]] / root
    work = np.empty(columns + 1)
    for c in range(columns):
        last = size + c + 1  # the rows of D below have nothing in this column yet
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
            total -= table[c, d] * x[free[d]]
        x[free[c]] = total / table[c, c]
    for r in range(size):
        total = -right[r]
        for i in range(n):
            total += stacked[r, i] * x[i]
        multiplier[r] = total / compliance[r]
