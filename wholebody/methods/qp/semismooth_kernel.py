"""Semismooth Newton steps as compiled loops: see `active_set.minimise`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.methods.qp.active_set_kernel import face, minimise_on_face, stack_elastic, stack_soft, work_size
from wholebody.methods.qp.dense_kernel import add, dot
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram

STILL = 1e-13  # rad, m: a step shorter than this is none
WHOLE = 1e-9  # a step this near to the whole way is the whole way but for rounding


@compiled(error_model="numpy")
def minimise(program: QuadraticProgram, iterations: int, tolerance: float, active: ActiveSet, x: Array) -> int:
    """Lower the objective from x (n,), in place, until its minimum, or for so many iterations; returns how many.

    `tolerance` is that of rows, metres. `active` becomes the active set at x.
    """
    n, m, k = len(program.diagonal), len(program.target), len(program.least)
    own = face(np.empty(work_size(n, m, k)), n, m, k)
    way, end, violated, speed = np.empty(n), np.empty(n), np.empty(k), np.empty(k)
    stack_soft(program, own)
    for i in range(n):
        x[i] = min(max(x[i], program.lower[i]), program.upper[i])
    _look(program, x, violated, active)
    _differentiate(program, violated, x, own.gradient)
    for i in range(n):
        active.lower[i] = x[i] <= program.lower[i] and own.gradient[i] >= 0.0
        active.upper[i] = x[i] >= program.upper[i] and own.gradient[i] <= 0.0 and not active.lower[i]
    for used in range(1, iterations + 1):
        pushes = active.elastic.nonzero()[0]
        stack_elastic(program, pushes, own)
        if not minimise_on_face(program, active, own, m + len(pushes), tolerance, end):
            return used
        longest, hit, largest = np.inf, -1, 0.0
        for i in range(n):
            way[i] = 0.0 if active.lower[i] or active.upper[i] else end[i] - x[i]
            largest = max(largest, abs(way[i]))
            if abs(way[i]) > STILL:
                room = ((program.upper[i] if way[i] > 0.0 else program.lower[i]) - x[i]) / way[i]
                if room < longest:
                    longest, hit = room, i
        best = _line_minimum(program, x, way, violated, speed, longest)
        for i in range(n):
            x[i] = min(max(x[i] + best * way[i], program.lower[i]), program.upper[i])
        changed = _look(program, x, violated, active)
        if best == longest and hit >= 0:  # a bound is in the way: it holds from now on
            active.lower[hit], active.upper[hit] = way[hit] < 0.0, way[hit] > 0.0
            continue
        if best * largest > STILL and not (best == 1.0 and not changed):
            continue
        # the minimum of the face: let the bound go that holds the most
        _differentiate(program, violated, x, own.gradient)
        worst, place = STILL, -1
        for i in range(n):
            pull = own.gradient[i] / program.diagonal[i]
            wrong = -pull if active.lower[i] else (pull if active.upper[i] else 0.0)
            if wrong > worst:
                worst, place = wrong, i
        if place < 0:
            return used
        active.lower[place] = active.upper[place] = False
    return iterations


@compiled(inner=True, error_model="numpy")
def _look(program: QuadraticProgram, x: Array, violated: Array, active: ActiveSet) -> bool:
    """By how much each elastic row is violated at x (n,) and whether it pushes; whether that differs from before."""
    changed = False
    for j in range(len(violated)):
        violated[j] = program.least[j] - dot(program.elastic[j], x)
        changed = changed or active.elastic[j] != (violated[j] > 0.0)
        active.elastic[j] = violated[j] > 0.0
    return changed


@compiled(inner=True, error_model="numpy")
def _differentiate(program: QuadraticProgram, violated: Array, x: Array, gradient: Array) -> None:
    """Fill in the derivative (n,) of the objective at x (n,), where elastic rows are violated by so much (k,)."""
    for i in range(len(x)):
        gradient[i] = program.diagonal[i] * x[i] + program.linear[i]
    for r in range(len(program.target)):
        add(program.weight[r] * (dot(program.rows[r], x) - program.target[r]), program.rows[r], gradient)
    for j in range(len(violated)):
        if violated[j] > 0.0:
            add(-program.elastic_weight[j] * violated[j], program.elastic[j], gradient)


@compiled(inner=True, error_model="numpy")
def _line_minimum(
    program: QuadraticProgram, x: Array, way: Array, violated: Array, speed: Array, longest: float
) -> float:
    """The step in [0, longest] along a way (n,) from x (n,) with the least objective.

    The derivative along the way is a(t) = base + rise t - sum over pushing rows of v_j s_j (l_j - c_j x - t s_j), with
    s_j = c_j way; rows begin or cease to push where l_j - c_j x = t s_j. `speed` (k,) is room for s.
    """
    base, rise, weight = 0.0, 0.0, program.elastic_weight
    for i in range(len(x)):
        base += (program.diagonal[i] * x[i] + program.linear[i]) * way[i]
        rise += program.diagonal[i] * way[i] * way[i]
    for r in range(len(program.target)):
        slope = dot(program.rows[r], way)
        base += program.weight[r] * slope * (dot(program.rows[r], x) - program.target[r])
        rise += program.weight[r] * slope * slope
    k = len(violated)
    for j in range(k):
        speed[j] = dot(program.elastic[j], way)
        if violated[j] > 0.0:
            base -= weight[j] * speed[j] * violated[j]
            rise += weight[j] * speed[j] * speed[j]
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
        base -= sign * weight[j] * speed[j] * violated[j]
        rise += sign * weight[j] * speed[j] * speed[j]
    if rise <= 0.0:
        return 0.0
    best = min(max(-base / rise, 0.0), longest)
    return 1.0 if abs(best - 1.0) < WHOLE else best
