"""The correcting of an active set as compiled loops: what `active_set` does in array code, at a quarter of the time.

Needs numba (the extra "fast"), which compiles it at the first use and keeps the result beside this file. Both ways give
the same answers to rounding, as far as the program is well conditioned; the array code is the reference.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
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
    inverse, gradient = np.empty(n), np.empty(n)
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
        if size:
            for r in range(size):
                for i in range(n):
                    scaled[r, i] = stacked[r, i] * inverse[i]
            system = np.dot(scaled[:size], stacked[:size].T)
            multiplier = np.dot(stacked[:size], x) - np.dot(scaled[:size], linear) - right[:size]
            for r in range(size):
                system[r, r] += compliance[r]
            if not _solve(system, multiplier):
                return False
            gradient += np.dot(multiplier, stacked[:size])
            for j in range(count):
                push[j] = -multiplier[m + j]
        for i in range(n):
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
            lack = least[j] - reached[j]
            if pushing[j]:
                lack = -push[following] * np.sum(elastic[j] ** 2 / diagonal)
                following += 1
            if next_pushing[j] != pushing[j] and lack > worst:
                worst, kind, place = lack, 2, j
        mask = at_lower if kind == 0 else (at_upper if kind == 1 else pushing)
        mask[place] = not mask[place]
    return False


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc"})  # type: ignore[untyped-decorator]
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
