"""The correcting of an active set, as compiled loops: see `active_set`."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Mask
from wholebody.compiled import compiled


@compiled(error_model="numpy")
def settle(
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
    at_lower: Mask,
    at_upper: Mask,
    pushing: Mask,
    corrections: int,
    full_corrections: int,
    bound_tolerance: float,
    row_tolerance: float,
    x: Array,
) -> bool:
    """Correct an active set, in place, until it is right; x (n,) becomes the minimiser.

    Returns:
        Whether it is right: false after so many corrections, and where a set has no finite minimiser.
    """
    n, m, k = len(diagonal), len(target), len(least)
    stacked = np.empty((m + k, n))
    stacked[:m] = rows
    scaled = np.empty((m + k, n))
    right, compliance = np.empty(m + k), np.empty(m + k)
    right[:m] = target
    for i in range(m):
        compliance[i] = 1.0 / weight[i]
    inverse, gradient, trial, multiplier = np.empty(n), np.empty(n), np.empty(n), np.empty(m + k)
    push, active = np.empty(k), np.empty(k, dtype=np.int64)
    next_lower, next_upper, next_pushing = np.empty(n, np.bool_), np.empty(n, np.bool_), np.empty(k, np.bool_)
    for attempt in range(corrections):
        count = 0
        for j in range(k):
            if pushing[j]:
                active[count] = j
                stacked[m + count] = elastic[j]
                right[m + count] = least[j]
                compliance[m + count] = 1.0 / elastic_weight[j]
                count += 1
        size = m + count
        for i in range(n):
            held = at_lower[i] or at_upper[i]
            x[i] = lower[i] if at_lower[i] else (upper[i] if at_upper[i] else 0.0)
            inverse[i] = 0.0 if held else 1.0 / diagonal[i]
            gradient[i] = linear[i]
        in_columns = size > n
        if 0 < size <= n:
            for r in range(size):
                for i in range(n):
                    scaled[r, i] = stacked[r, i] * inverse[i]
            system = np.dot(scaled[:size], stacked[:size].T)
            multiplier[:size] = np.dot(stacked[:size], x) - np.dot(scaled[:size], linear) - right[:size]
            for r in range(size):
                system[r, r] += compliance[r]
            in_columns = not _solve(system, multiplier[:size])
            if not in_columns:
                pull = linear + np.dot(multiplier[:size], stacked[:size])
                for i in range(n):
                    trial[i] = x[i] - inverse[i] * pull[i]
                left = np.dot(stacked[:size], trial) - right[:size] - compliance[:size] * multiplier[:size]
                in_columns = not np.abs(left).max() <= row_tolerance
        if in_columns:
            _minimise_in_columns(stacked, right, compliance, size, diagonal, linear, inverse, x, multiplier)
        if size:
            gradient += np.dot(multiplier[:size], stacked[:size])
        for j in range(count):
            push[j] = -multiplier[m + j]
        for i in range(n):
            if not in_columns:
                x[i] -= inverse[i] * gradient[i]
            gradient[i] += diagonal[i] * x[i]
            if not np.isfinite(x[i]):
                return False
        same = True
        for i in range(n):
            next_lower[i] = gradient[i] >= 0.0 if at_lower[i] else x[i] < lower[i] - bound_tolerance
            next_upper[i] = gradient[i] <= 0.0 if at_upper[i] else x[i] > upper[i] + bound_tolerance
            same = same and next_lower[i] == at_lower[i] and next_upper[i] == at_upper[i]
        reached = np.dot(elastic, x)
        for j in range(k):
            next_pushing[j] = reached[j] < least[j] - row_tolerance
        for j in range(count):
            next_pushing[active[j]] = push[j] >= 0.0
        for j in range(k):
            same = same and next_pushing[j] == pushing[j]
        if same:
            for i in range(n):
                x[i] = min(max(x[i], lower[i]), upper[i])
            return True
        if attempt < full_corrections:
            at_lower[:], at_upper[:], pushing[:] = next_lower, next_upper, next_pushing
            continue
        # only the entry that is most wrong, in units of x
        worst, kind, place = -np.inf, 0, 0
        for i in range(n):
            pull = abs(gradient[i]) / diagonal[i]
            if next_lower[i] != at_lower[i]:
                wrong = pull if at_lower[i] else lower[i] - x[i]
                if wrong > worst:
                    worst, kind, place = wrong, 0, i
            if next_upper[i] != at_upper[i]:
                wrong = pull if at_upper[i] else x[i] - upper[i]
                if wrong > worst:
                    worst, kind, place = wrong, 1, i
        following = 0
        for j in range(k):
            violated = least[j] - reached[j]
            if pushing[j]:
                violated = -push[following] * np.sum(elastic[j] ** 2 / diagonal)
                following += 1
            if next_pushing[j] != pushing[j] and violated > worst:
                worst, kind, place = violated, 2, j
        mask = at_lower if kind == 0 else (at_upper if kind == 1 else pushing)
        mask[place] = not mask[place]
    return False


@compiled(error_model="numpy")
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
    free = np.flatnonzero(inverse)
    columns = len(free)
    order = np.argsort(compliance[:size])
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


@compiled(error_model="numpy", fastmath={"contract", "reassoc"})
def _solve(system: Array, right: Array) -> bool:
    """Solve a symmetric positive definite system in place by Cholesky's L L'; false where it is not one."""
    size = len(right)
    for i in range(size):
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
        total = right[i]
        for p in range(i):
            total -= system[i, p] * right[p]
        right[i] = total / system[i, i]
    for i in range(size - 1, -1, -1):
        right[i] /= system[i, i]
        for p in range(i):
            right[p] -= system[i, p] * right[i]
    return True
