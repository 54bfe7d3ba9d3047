"""The correcting of an active set, as compiled loops: see `active_set`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import add, dot, gram, least_squares, solve, sort
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.settings import Corrections


class Face(NamedTuple):
    """Rows that count with an active set fixed, and room for their system.

    Attributes:
        stacked: (m + k, n) the soft rows and the pushing elastic ones.
        right: (m + k,) what they are to be.
        compliance: (m + k,) their inverse weights.
        multiplier: (m + k,) becomes weight times residual of each.
        gradient: (n,) becomes the derivative of the objective by x.
        reached: (k,) values of the elastic rows at x.
        scaled, table, inverse, trial: room; (m + k, n), (m + k)^2, (n,) and (n,).
    """

    stacked: Array
    right: Array
    compliance: Array
    multiplier: Array
    gradient: Array
    reached: Array
    scaled: Array
    table: Array
    inverse: Array
    trial: Array


@compiled()
def work_size(variables: int, soft: int, elastic: int) -> int:
    """Floats that `face` needs for a program of so many variables, soft rows and elastic rows."""
    rows = soft + elastic
    return 2 * rows * variables + rows * rows + 3 * rows + elastic + 3 * variables


@compiled(inner=True, forceinline=True)
def face(work: Array, n: int, m: int, k: int) -> Face:
    """Room for the faces of a program with n variables, m soft and k elastic rows, within `work` (see `work_size`)."""
    most = m + k
    first, second, third = most * n, 2 * most * n, 2 * most * n + most * most
    fourth = third + 3 * most
    last = fourth + k
    return Face(
        work[:first].reshape((most, n)),
        work[third:][:most],
        work[third + most :][:most],
        work[third + 2 * most :][:most],
        work[last + n :][:n],
        work[fourth:last],
        work[first:second].reshape((most, n)),
        work[second:third],
        work[last:][:n],
        work[last + 2 * n :][:n],
    )


@compiled(error_model="numpy", forceinline=True)
def solve_growing(
    program: QuadraticProgram,
    key: Indices,
    known: Indices,
    active: ActiveSet,
    limits: Corrections,
    room: Room,
    x: Array,
) -> int:
    """Solve a program from the active set of the one before, with the elastic rows that matter; see `WorkingSet`.

    Args:
        program: what to solve.
        key: (k,) names of its elastic rows.
        known: names of the rows that pushed in the program before, in ascending order.
        active: the bounds that held x then, and room for rows; it becomes the active set of the answer.
        limits: of the corrections.
        room: for this program.
        x: (n,) becomes the minimiser.

    Returns:
        How often rows were added, or -1 where the active set of a round did not settle.
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
        if not primal_dual_active_set(program, places[:count], active, limits.most, limits, room, x):
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


@compiled(error_model="numpy", forceinline=True)
def primal_dual_active_set(
    program: QuadraticProgram, places: Indices, active: ActiveSet, most: int, limits: Corrections, room: Room, x: Array
) -> bool:
    """Correct an active set, in place, until it is right; x (n,) becomes the minimiser.

    Args:
        program: what to solve.
        places: (c,) the elastic rows that count.
        active: where to begin.
        most: corrections; the first ones put right all that is wrong, the others only the worst entry.
        limits: of the corrections.
        room: of which the second half of `places` is used.
        x: (n,).

    Returns:
        Whether it is right: false after so many corrections, and where a set has no finite minimiser.
    """
    elastic, lower, upper = program.elastic, program.lower, program.upper
    pushing = active.elastic
    n, m, k = len(program.diagonal), len(program.target), len(places)
    own, pushes = face(room.work, n, m, k), room.places[len(room.places) // 2 :]
    reached = own.reached
    stack_soft(program, own)
    for attempt in range(most):
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
        if _is_right(program, places, active, own, limits.tolerance, x):
            for i in range(n):
                x[i] = min(max(x[i], lower[i]), upper[i])
            return True
        if attempt < limits.at_once:
            _correct_all(program, places, active, own, limits.tolerance, x)
        else:
            _correct_worst(program, places, active, own, limits.tolerance, x)
    return False


@compiled(error_model="numpy")
def minimise_with(program: QuadraticProgram, active: ActiveSet, limits: Corrections, work: Array, x: Array) -> bool:
    """Minimiser x (n,) of a program with its active set fixed, clipped to the bounds; whether it is finite.

    `work` is room; see `work_size`.
    """
    own = face(work, len(program.diagonal), len(program.target), len(program.least))
    stack_soft(program, own)
    pushes = active.elastic.nonzero()[0]
    stack_elastic(program, pushes, own)
    finite = minimise_on_face(program, active, own, len(program.target) + len(pushes), limits.tolerance, x)
    for i in range(len(x)):
        x[i] = min(max(x[i], program.lower[i]), program.upper[i])
    return finite


@compiled(inner=True, error_model="numpy", forceinline=True)
def stack_soft(program: QuadraticProgram, own: Face) -> None:
    """Let the soft rows be the first of a face."""
    rows, target, weight = program.rows, program.target, program.weight
    stacked, right, compliance = own.stacked, own.right, own.compliance
    for r in range(len(target)):
        compliance[r] = 1.0 / weight[r]
        right[r] = target[r]
        for i in range(rows.shape[1]):
            stacked[r, i] = rows[r, i]


@compiled(inner=True, error_model="numpy", forceinline=True)
def stack_elastic(program: QuadraticProgram, pushes: Indices, own: Face) -> None:
    """Let these elastic rows follow."""
    target, elastic, least, elastic_weight = program.target, program.elastic, program.least, program.elastic_weight
    stacked, right, compliance = own.stacked, own.right, own.compliance
    first = len(target)
    for count in range(len(pushes)):
        j = pushes[count]
        for i in range(elastic.shape[1]):
            stacked[first + count, i] = elastic[j, i]
        right[first + count] = least[j]
        compliance[first + count] = 1.0 / elastic_weight[j]


@compiled(inner=True, error_model="numpy", forceinline=True)
def _is_right(
    program: QuadraticProgram, places: Indices, active: ActiveSet, own: Face, tolerance: float, x: Array
) -> bool:
    """Whether an active set is that of its minimiser x (n,)."""
    target, least, lower, upper = program.target, program.least, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    multiplier, gradient, reached = own.multiplier, own.gradient, own.reached
    for i in range(len(x)):
        if at_lower[i]:
            right = gradient[i] >= 0.0
        elif at_upper[i]:
            right = gradient[i] <= 0.0
        else:
            right = lower[i] - tolerance <= x[i] <= upper[i] + tolerance
        if not right:
            return False
    following = len(target)
    for c in range(len(places)):
        j = places[c]
        if pushing[j]:
            right = multiplier[following] <= 0.0
            following += 1
        else:
            right = reached[c] >= least[j] - tolerance
        if not right:
            return False
    return True


@compiled(inner=True, error_model="numpy", forceinline=True)
def _correct_all(
    program: QuadraticProgram, places: Indices, active: ActiveSet, own: Face, tolerance: float, x: Array
) -> None:
    """Put right everything that is wrong in an active set with the minimiser x (n,)."""
    target, least, lower, upper = program.target, program.least, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    multiplier, gradient, reached = own.multiplier, own.gradient, own.reached
    for i in range(len(x)):
        held_low, held_high = at_lower[i], at_upper[i]
        at_lower[i] = gradient[i] >= 0.0 if held_low else x[i] < lower[i] - tolerance
        at_upper[i] = gradient[i] <= 0.0 if held_high else x[i] > upper[i] + tolerance
    following = len(target)
    for c in range(len(places)):
        j = places[c]
        if pushing[j]:
            pushing[j] = multiplier[following] <= 0.0
            following += 1
        else:
            pushing[j] = reached[c] < least[j] - tolerance


@compiled(inner=True, error_model="numpy", forceinline=True)
def _correct_worst(
    program: QuadraticProgram, places: Indices, active: ActiveSet, own: Face, tolerance: float, x: Array
) -> None:
    """Put right the entry that is most wrong, in units of x."""
    diagonal, target, elastic = program.diagonal, program.target, program.elastic
    least, lower, upper = program.least, program.lower, program.upper
    at_lower, at_upper, pushing = active.lower, active.upper, active.elastic
    multiplier, gradient, reached = own.multiplier, own.gradient, own.reached
    worst, mask, place = -np.inf, at_lower, 0
    for i in range(len(x)):
        pull = abs(gradient[i]) / diagonal[i]
        next_lower = gradient[i] >= 0.0 if at_lower[i] else x[i] < lower[i] - tolerance
        next_upper = gradient[i] <= 0.0 if at_upper[i] else x[i] > upper[i] + tolerance
        wrong = pull if at_lower[i] else lower[i] - x[i]
        if next_lower != at_lower[i] and wrong > worst:
            worst, mask, place = wrong, at_lower, i
        wrong = pull if at_upper[i] else x[i] - upper[i]
        if next_upper != at_upper[i] and wrong > worst:
            worst, mask, place = wrong, at_upper, i
    following = len(target)
    for c in range(len(places)):
        j = places[c]
        wrong = least[j] - reached[c]
        flips = wrong > tolerance
        if pushing[j]:
            flips = not multiplier[following] <= 0.0
            norm = 0.0
            for i in range(len(x)):
                norm += elastic[j, i] * elastic[j, i] / diagonal[i]
            wrong = multiplier[following] * norm
            following += 1
        if flips and wrong > worst:
            worst, mask, place = wrong, pushing, j
    mask[place] = not mask[place]


@compiled(error_model="numpy", forceinline=True)
def minimise_on_face(
    program: QuadraticProgram, active: ActiveSet, own: Face, size: int, tolerance: float, x: Array
) -> bool:
    """Minimiser x (n,) with the bounds of an active set held and the first `size` rows of a face counted.

    It may be out of the other bounds. Residuals off by more than the tolerance are computed by the other system.

    Returns:
        Whether x is finite.
    """
    diagonal, lower, upper = program.diagonal, program.lower, program.upper
    at_lower, at_upper = active.lower, active.upper
    stacked, right, compliance = own.stacked, own.right, own.compliance
    multiplier, gradient, scaled = own.multiplier, own.gradient, own.scaled
    table, inverse, trial = own.table, own.inverse, own.trial
    n = len(x)
    linear = program.linear
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
            for r in range(size):
                left = abs(dot(stacked[r], trial) - right[r] - compliance[r] * multiplier[r])
                in_columns = in_columns or not left <= tolerance
    if in_columns:
        _minimise_in_columns(program, own, size, x)
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
def _minimise_in_columns(program: QuadraticProgram, own: Face, size: int, x: Array) -> None:
    """Minimiser on a face with more rows than variables, by Householder's QR of the weighted rows.

    The free entries of x minimise |W^1/2 (A x - b)|^2 + |D^1/2 x + D^-1/2 g|^2. The rows stand in the order of their
    weights: heavy rows lose no digits to light ones, nor light ones to heavy.
    """
    diagonal, linear = program.diagonal, program.linear
    stacked, right, compliance = own.stacked, own.right, own.compliance
    multiplier, inverse = own.multiplier, own.inverse
    free = inverse.nonzero()[0]
    columns, order = len(free), np.empty(size, dtype=np.intp)
    sort(compliance, order)
    table, part = np.zeros((size + columns, columns + 1)), np.empty(columns)
    for place in range(size):
        r = order[place]
        root = 1.0 / np.sqrt(compliance[r])
        total = right[r]
        for i in range(len(x)):
            if inverse[i] == 0.0:
                total -= stacked[r, i] * x[i]
        for c in range(columns):
            table[place, c] = root * stacked[r, free[c]]
        table[place, columns] = root * total
    for c in range(columns):
        root = np.sqrt(diagonal[free[c]])
        table[size + c, c] = root
        table[size + c, columns] = -linear[free[c]] / root
    least_squares(table, size, part)
    for c in range(columns):
        x[free[c]] = part[c]
    for r in range(size):
        multiplier[r] = (dot(stacked[r], x) - right[r]) / compliance[r]
