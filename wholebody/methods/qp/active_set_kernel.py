"""The correcting of an active set, and semismooth Newton steps, as compiled loops: see `active_set`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import add, dot
from wholebody.methods.qp.face_kernel import Face, face, minimise_on_face, stack_elastic, stack_soft
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.settings import Corrections

STILL = 1e-13  # rad, m: a step shorter than this is none
WHOLE = 1e-9  # a step this near to the whole way is the whole way but for rounding


@compiled(error_model="numpy")
def solve(
    program: QuadraticProgram, key: Indices, known: Indices, active: ActiveSet, limits: Corrections, room: Room,
    x: Array, steps: int,
) -> int:  # fmt: skip
    """Do what `grow` does, or what `minimise` does where it is to take steps; both share the minimiser on a face."""
    if steps > 0:
        return minimise(program, steps, limits.tolerance, active, room, x)
    return grow(program, key, known, active, limits, room, x)


@compiled(inner=True, error_model="numpy", forceinline=True)
def grow(
    program: QuadraticProgram, key: Indices, known: Indices, active: ActiveSet, limits: Corrections, room: Room,
    x: Array,
) -> int:  # fmt: skip
    """Solve a program from the active set of the one before, with the elastic rows that matter; see `WorkingSet`.

    `key` (k,) names its elastic rows, `known` those that pushed before, ascending; `active` has the bounds of then and
    becomes the answer's, x (n,) the minimiser. How often rows were added, or -1 where a round did not settle.
    """
    elastic, least = program.elastic, program.least
    pushing = active.elastic
    k, chosen, places = len(least), room.chosen, room.places
    for j in range(k):
        pushing[j] = _contains(known, key[j])
        chosen[j] = least[j] > limits.near or pushing[j]
    for attempt in range(limits.rounds + 1):
        count = 0
        for j in range(k):
            if chosen[j] or attempt == limits.rounds:
                chosen[j] = True
                places[count] = j
                count += 1
        if not _primal_dual_active_set(program, places[:count], active, limits.most, limits, room, x):
            return -1
        missed = False
        for j in range(k):
            if not chosen[j] and dot(elastic[j], x) < least[j] - 1e-9:
                chosen[j] = missed = True
        if not missed:
            return attempt
    return limits.rounds


@compiled(inner=True)
def _contains(sorted_keys: Indices, key: int) -> bool:
    """Whether keys (k,) in ascending order contain one; numba's searchsorted would load scipy.linalg at every start."""
    low, high = 0, len(sorted_keys)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if sorted_keys[middle] < key else (low, middle)
    return low < len(sorted_keys) and sorted_keys[low] == key


@compiled(inner=True, error_model="numpy", forceinline=True)
def _primal_dual_active_set(
    program: QuadraticProgram, places: Indices, active: ActiveSet, most: int, limits: Corrections, room: Room, x: Array
) -> bool:
    """Correct an active set for the rows `places` (c,), in place; x (n,) becomes the minimiser. Whether it is right."""
    elastic, lower, upper = program.elastic, program.lower, program.upper
    pushing = active.elastic
    n, m, k = len(program.diagonal), len(program.target), len(places)
    own, pushes = face(room.work, n, m, k), room.places[len(room.places) // 2 :]
    reached = own.reached
    stack_soft(program, own)
    for _ in range(most):
        size = m
        for c in range(k):
            if pushing[places[c]]:
                pushes[size - m] = places[c]
                size += 1
        stack_elastic(program, pushes[: size - m], own)
        if not minimise_on_face(program, active, own, size, limits.tolerance, x):
            return False
        for c in range(k):
            reached[c] = dot(elastic[places[c]], x)
        if not _correct(program, places, active, own, limits.tolerance, x):
            for i in range(n):
                x[i] = min(max(x[i], lower[i]), upper[i])
            return True
    return False


@compiled(inner=True, error_model="numpy", forceinline=True)
def _correct(
    program: QuadraticProgram, places: Indices, active: ActiveSet, own: Face, tolerance: float, x: Array
) -> bool:
    """Put right every wrong entry of an active set; whether any was."""
    least, lower, upper = program.least, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    multiplier, gradient, reached = own.multiplier, own.gradient, own.reached
    found = False
    for i in range(len(x)):
        low = gradient[i] >= 0.0 if at_lower[i] else x[i] < lower[i] - tolerance
        high = gradient[i] <= 0.0 if at_upper[i] else x[i] > upper[i] + tolerance
        found = found or low != at_lower[i] or high != at_upper[i]
        at_lower[i], at_upper[i] = low, high
    following = len(program.target)
    for c in range(len(places)):
        j = places[c]
        push = reached[c] < least[j] - tolerance
        if pushing[j]:
            push = multiplier[following] <= 0.0
            following += 1
        found = found or push != pushing[j]
        pushing[j] = push
    return found


@compiled(inner=True, error_model="numpy")
def minimise(
    program: QuadraticProgram, iterations: int, tolerance: float, active: ActiveSet, room: Room, x: Array
) -> int:
    """Lower the objective from x (n,), in place, until its minimum, or for so many iterations; returns how many."""
    diagonal, lower, upper = program.diagonal, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    n, m, k = len(diagonal), len(program.target), len(program.least)
    own, pushes = face(room.work, n, m, k), room.places
    gradient = own.gradient
    direction, end, violated, speed = np.empty(n), np.empty(n), np.empty(k), np.empty(k)
    stack_soft(program, own)
    for i in range(n):
        x[i] = min(max(x[i], lower[i]), upper[i])
    _look(program, x, violated, active)
    _differentiate(program, violated, x, gradient)
    for i in range(n):
        at_lower[i] = x[i] <= lower[i] and gradient[i] >= 0.0
        at_upper[i] = x[i] >= upper[i] and gradient[i] <= 0.0 and not at_lower[i]
    rough = 1e3 * tolerance  # a face before the last one only says which way to go: half as many in columns
    for used in range(1, iterations + 1):
        count = 0
        for j in range(k):
            if pushing[j]:
                pushes[count] = j
                count += 1
        stack_elastic(program, pushes[:count], own)
        if not minimise_on_face(program, active, own, m + count, rough, end):
            return used
        for i in range(n):
            direction[i] = 0.0 if at_lower[i] or at_upper[i] else end[i] - x[i]
        if _line_search(program, active, x, direction, violated, speed):
            continue
        # the minimum of the face: let the bounds go that hold on the wrong side
        _differentiate(program, violated, x, gradient)
        right = True
        for i in range(n):
            pull = gradient[i] / diagonal[i]
            if (at_lower[i] and -pull > STILL) or (at_upper[i] and pull > STILL):
                at_lower[i] = at_upper[i] = right = False
        if right and rough == tolerance:
            return used
        rough = tolerance if right else rough
    return iterations


@compiled(inner=True, error_model="numpy")
def _line_search(
    program: QuadraticProgram, active: ActiveSet, x: Array, direction: Array, violated: Array, speed: Array
) -> bool:
    """Go along a direction (n,), bent at bounds, as far as the objective decreases; whether a face is left to look at.

    A bound that is met holds from then on, and the others go on: one face may meet many.
    """
    lower, upper, met = program.lower, program.upper, False
    while True:
        longest, hit, largest = np.inf, -1, 0.0
        for i in range(len(x)):
            largest = max(largest, abs(direction[i]))
            if abs(direction[i]) > STILL:
                room = ((upper[i] if direction[i] > 0.0 else lower[i]) - x[i]) / direction[i]
                if room < longest:
                    longest, hit = room, i
        best = _line_minimum(program, x, direction, violated, speed, longest)
        for i in range(len(x)):
            x[i] = min(max(x[i] + best * direction[i], lower[i]), upper[i])
        changed = _look(program, x, violated, active)
        if best != longest or hit < 0:
            return met or (best * largest > STILL and (best != 1.0 or changed))
        active.lower[hit], active.upper[hit] = direction[hit] < 0.0, direction[hit] > 0.0
        direction[hit], met = 0.0, True


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
    program: QuadraticProgram, x: Array, direction: Array, violated: Array, speed: Array, longest: float
) -> float:
    """The step in [0, longest] along a direction (n,) from x (n,) with the least objective.

    The derivative along the step is a(t) = base + rise t - sum over pushing rows of v_j s_j (l_j - c_j x - t s_j), with
    s_j = c_j direction; rows begin or cease to push where l_j - c_j x = t s_j. `speed` (k,) is room for s.
    """
    diagonal, linear, rows = program.diagonal, program.linear, program.rows
    target, weight, elastic = program.target, program.weight, program.elastic
    base, rise, push = 0.0, 0.0, program.elastic_weight
    for i in range(len(x)):
        base += (diagonal[i] * x[i] + linear[i]) * direction[i]
        rise += diagonal[i] * direction[i] * direction[i]
    for r in range(len(target)):
        slope = dot(rows[r], direction)
        base += weight[r] * slope * (dot(rows[r], x) - target[r])
        rise += weight[r] * slope * slope
    k = len(violated)
    for j in range(k):
        speed[j] = dot(elastic[j], direction)
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
