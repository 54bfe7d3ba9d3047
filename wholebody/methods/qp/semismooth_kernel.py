"""Semismooth Newton steps as compiled loops: see `active_set.minimise`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import add, dot
from wholebody.methods.qp.face_kernel import face, minimise_on_face, stack_elastic, stack_soft
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram

STILL = 1e-13  # rad, m: a step shorter than this is none
WHOLE = 1e-9  # a step this near to the whole way is the whole way but for rounding


@compiled(error_model="numpy")
def minimise(
    program: QuadraticProgram, iterations: int, tolerance: float, active: ActiveSet, work: Array, x: Array
) -> int:
    """Lower the objective from x (n,), in place, until its minimum, or for so many iterations; returns how many."""
    diagonal, lower, upper = program.diagonal, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    n, m, k = len(diagonal), len(program.target), len(program.least)
    own = face(work, n, m, k)
    gradient = own.gradient
    way, end, violated, speed = np.empty(n), np.empty(n), np.empty(k), np.empty(k)
    stack_soft(program, own)
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    _look(program, x, violated, active)
    _differentiate(program, violated, x, gradient)
    for i in range(n):
        at_lower[i] = x[i] <= lower[i] and gradient[i] >= 0.0
        at_upper[i] = x[i] >= upper[i] and gradient[i] <= 0.0 and not at_lower[i]
    for used in range(1, iterations + 1):
        pushes = pushing.nonzero()[0]
        stack_elastic(program, pushes, own)
        if not minimise_on_face(program, active, own, m + len(pushes), tolerance, end):
            return used
        longest, hit, largest = np.inf, -1, 0.0
        for i in range(n):
            way[i] = 0.0 if at_lower[i] or at_upper[i] else end[i] - x[i]
            largest = max(largest, abs(way[i]))
            if abs(way[i]) > STILL:
                room = ((upper[i] if way[i] > 0.0 else lower[i]) - x[i]) / way[i]
                if room < longest:
                    longest, hit = room, i
        best = _line_minimum(program, x, way, violated, speed, longest)
        for i in range(n):
            x[i] = min(max(x[i] + best * way[i], lower[i]), upper[i])
        changed = _look(program, x, violated, active)
        if best == longest and hit >= 0:  # a bound is in the way: it holds from now on
            at_lower[hit], at_upper[hit] = way[hit] < 0.0, way[hit] > 0.0
            continue
        if best * largest > STILL and not (best == 1.0 and not changed):
            continue
        # the minimum of the face: let the bound go that holds the most
        _differentiate(program, violated, x, gradient)
        worst, place = STILL, -1
        for i in range(n):
            pull = gradient[i] / diagonal[i]
            wrong = -pull if at_lower[i] else (pull if at_upper[i] else 0.0)
            if wrong > worst:
                worst, place = wrong, i
        if place < 0:
            return used
        at_lower[place] = at_upper[place] = False
    return iterations


@compiled(inner=True, error_model="numpy", forceinline=True)
def _look(program: QuadraticProgram, x: Array, violated: Array, active: ActiveSet) -> bool:
    """By how much each elastic row is violated at x (n,) and whether it pushes; whether that differs from before."""
    elastic, least = program.elastic, program.least
    pushing = active.elastic
    changed = False
    for j in range(len(violated)):
        violated[j] = least[j] - dot(elastic[j], x)
        changed = changed or pushing[j] != (violated[j] > 0.0)
        pushing[j] = violated[j] > 0.0
    return changed


@compiled(inner=True, error_model="numpy", forceinline=True)
def _differentiate(program: QuadraticProgram, violated: Array, x: Array, gradient: Array) -> None:
    """Fill in the derivative (n,) of the objective at x (n,), where elastic rows are violated by so much (k,)."""
    diagonal, linear, rows, target = program.diagonal, program.linear, program.rows, program.target
    weight, elastic, elastic_weight = program.weight, program.elastic, program.elastic_weight
    for i in range(len(x)):
        gradient[i] = diagonal[i] * x[i] + linear[i]
    for r in range(len(target)):
        add(weight[r] * (dot(rows[r], x) - target[r]), rows[r], gradient)
    for j in range(len(violated)):
        if violated[j] > 0.0:
            add(-elastic_weight[j] * violated[j], elastic[j], gradient)


@compiled(inner=True, error_model="numpy")
def _line_minimum(
    program: QuadraticProgram, x: Array, way: Array, violated: Array, speed: Array, longest: float
) -> float:
    """The step in [0, longest] along a way (n,) from x (n,) with the least objective.

    The derivative along the way is a(t) = base + rise t - sum over pushing rows of v_j s_j (l_j - c_j x - t s_j), with
    s_j = c_j way; rows begin or cease to push where l_j - c_j x = t s_j. `speed` (k,) is room for s.
    """
    diagonal, linear, rows = program.diagonal, program.linear, program.rows
    target, weight, elastic = program.target, program.weight, program.elastic
    base, rise, push = 0.0, 0.0, program.elastic_weight
    for i in range(len(x)):
        base += (diagonal[i] * x[i] + linear[i]) * way[i]
        rise += diagonal[i] * way[i] * way[i]
    for r in range(len(target)):
        slope = dot(rows[r], way)
        base += weight[r] * slope * (dot(rows[r], x) - target[r])
        rise += weight[r] * slope * slope
    k = len(violated)
    for j in range(k):
        speed[j] = dot(elastic[j], way)
        if violated[j] > 0.0:
            base -= push[j] * speed[j] * violated[j]
            rise += push[j] * speed[j] * speed[j]
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
        base -= sign * push[j] * speed[j] * violated[j]
        rise += sign * push[j] * speed[j] * speed[j]
    if rise <= 0.0:
        return 0.0
    best = min(max(-base / rise, 0.0), longest)
    return 1.0 if abs(best - 1.0) < WHOLE else best
