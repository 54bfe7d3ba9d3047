"""Semismooth Newton steps as compiled loops: see `semismooth_newton`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import add, dot
from wholebody.methods.qp.face_kernel import minimise_on_face


@compiled(error_model="numpy")
def minimise(
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
    iterations: int,
    limits: Array,
    at_lower: Mask,
    at_upper: Mask,
    pushing: Mask,
    x: Array,
) -> int:
    """Lower the objective from x (n,), in place, until its minimum, or for so many iterations; returns how many.

    The first ten arguments are the program. `at_lower` and `at_upper` (n,) become the bounds that hold x, `pushing`
    (k,) the elastic rows that push. `limits` are the step below which x is still, the difference from the whole way
    that is rounding, and the tolerance of rows.
    """
    n, m, k = len(diagonal), len(target), len(least)
    still, whole, row_tolerance = limits
    stacked, right, compliance = np.empty((m + k, n)), np.empty(m + k), np.empty(m + k)
    scaled, table, multiplier = np.empty((n, n)), np.empty(n * n), np.empty(m + k)
    inverse, trial, gradient, way, end = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    violated, speed = np.empty(k), np.empty(k)
    for r in range(m):
        right[r], compliance[r] = target[r], 1.0 / weight[r]
        for i in range(n):
            stacked[r, i] = rows[r, i]
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    _look(elastic, least, x, violated, pushing)
    _differentiate(diagonal, linear, rows, target, weight, elastic, elastic_weight, violated, x, gradient)
    for i in range(n):
        at_lower[i] = x[i] <= lower[i] and gradient[i] >= 0.0
        at_upper[i] = x[i] >= upper[i] and gradient[i] <= 0.0 and not at_lower[i]
    used = 0
    while used < iterations:
        used += 1
        size = m
        for j in range(k):
            if pushing[j]:
                right[size], compliance[size] = least[j], 1.0 / elastic_weight[j]
                for i in range(n):
                    stacked[size, i] = elastic[j, i]
                size += 1
        if not minimise_on_face(
            diagonal, linear, lower, upper, at_lower, at_upper, stacked, right, compliance, size, row_tolerance, scaled,
            table, inverse, trial, multiplier, gradient, end,
        ):  # fmt: skip
            break
        longest, hit, largest = np.inf, -1, 0.0
        for i in range(n):
            way[i] = 0.0 if at_lower[i] or at_upper[i] else end[i] - x[i]
            largest = max(largest, abs(way[i]))
            if abs(way[i]) > still:
                room = ((upper[i] if way[i] > 0.0 else lower[i]) - x[i]) / way[i]
                if room < longest:
                    longest, hit = room, i
        base, rise = 0.0, 0.0
        for i in range(n):
            base += (diagonal[i] * x[i] + linear[i]) * way[i]
            rise += diagonal[i] * way[i] * way[i]
        for r in range(m):
            slope = dot(rows[r], way)
            base += weight[r] * slope * (dot(rows[r], x) - target[r])
            rise += weight[r] * slope * slope
        for j in range(k):
            speed[j] = dot(elastic[j], way)
        best = _line_minimum(base, rise, violated, speed, elastic_weight, longest, whole)
        for i in range(n):
            x[i] = min(max(x[i] + best * way[i], lower[i]), upper[i])
        changed = _look(elastic, least, x, violated, pushing)
        if best == longest and hit >= 0:  # a bound is in the way: it holds from now on
            at_lower[hit], at_upper[hit] = way[hit] < 0.0, way[hit] > 0.0
            continue
        if best * largest > still and not (best == 1.0 and not changed):
            continue
        # the minimum of the face: let the bound go that holds the most
        _differentiate(diagonal, linear, rows, target, weight, elastic, elastic_weight, violated, x, gradient)
        worst, place = still, -1
        for i in range(n):
            pull = gradient[i] / diagonal[i]
            wrong = -pull if at_lower[i] else (pull if at_upper[i] else 0.0)
            if wrong > worst:
                worst, place = wrong, i
        if place < 0:
            break
        at_lower[place] = at_upper[place] = False
    return used


@compiled(inner=True, error_model="numpy")
def _look(elastic: Array, least: Array, x: Array, violated: Array, pushing: Mask) -> bool:
    """By how much each elastic row is violated at x (n,) and whether it pushes; whether that differs from before."""
    changed = False
    for j in range(len(least)):
        violated[j] = least[j] - dot(elastic[j], x)
        changed = changed or pushing[j] != (violated[j] > 0.0)
        pushing[j] = violated[j] > 0.0
    return changed


@compiled(inner=True, error_model="numpy")
def _differentiate(
    diagonal: Array,
    linear: Array,
    rows: Array,
    target: Array,
    weight: Array,
    elastic: Array,
    elastic_weight: Array,
    violated: Array,
    x: Array,
    gradient: Array,
) -> None:
    """Fill in the derivative (n,) of the objective at x (n,), where elastic rows are violated by so much (k,)."""
    for i in range(len(x)):
        gradient[i] = diagonal[i] * x[i] + linear[i]
    for r in range(len(target)):
        add(weight[r] * (dot(rows[r], x) - target[r]), rows[r], gradient)
    for j in range(len(violated)):
        if violated[j] > 0.0:
            add(-elastic_weight[j] * violated[j], elastic[j], gradient)


@compiled(inner=True, error_model="numpy")
def _line_minimum(
    base: float, rise: float, violated: Array, speed: Array, elastic_weight: Array, longest: float, whole: float
) -> float:
    """The step in [0, longest] with the least objective along a way.

    The derivative along the way is a(t) = base + rise t - sum over pushing rows of v_j s_j (l_j - c_j x - t s_j), with
    s_j = c_j way; rows begin or cease to push where l_j - c_j x = t s_j.
    """
    k = len(violated)
    for j in range(k):
        if violated[j] > 0.0:
            base -= elastic_weight[j] * speed[j] * violated[j]
            rise += elastic_weight[j] * speed[j] * speed[j]
    last, before = 0.0, k
    while True:
        place, following = np.inf, -1  # the next row that changes, those at one place in their order
        for j in range(k):
            if speed[j] != 0.0:
                at = violated[j] / speed[j]
                if at > 0.0 and (at > last or (at == last and j > before)) and at < place:
                    place, following = at, j
        if following < 0 or place >= longest or base + rise * place >= 0.0:
            break
        j, last, before = following, place, following
        sign = -1.0 if violated[j] > 0.0 else 1.0
        base -= sign * elastic_weight[j] * speed[j] * violated[j]
        rise += sign * elastic_weight[j] * speed[j] * speed[j]
    if rise <= 0.0:
        return 0.0
    best = min(max(-base / rise, 0.0), longest)
    return 1.0 if abs(best - 1.0) < whole else best
