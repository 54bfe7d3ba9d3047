"""The minimiser of a program on the face of an active set, as compiled loops: see `active_set`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import add, dot, gram, least_squares, solve, sort
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram


class Face(NamedTuple):
    """Rows that count with an active set fixed, and room for their system."""

    stacked: Array  # (m + k, n) the soft rows and the pushing elastic ones
    right: Array  # (m + k,) what they are to be
    compliance: Array  # (m + k,) their inverse weights
    multiplier: Array  # (m + k,) becomes weight times residual of each
    gradient: Array  # (n,) becomes the derivative of the objective by x
    reached: Array  # (k,) values of the elastic rows at x
    scaled: Array  # room; (m + k, n), (m + k)^2, (n,) and (n,)
    table: Array
    inverse: Array
    trial: Array


@compiled(inner=True, forceinline=True)
def face(work: Array, n: int, m: int, k: int) -> Face:
    """Room for the faces of a program with n variables, m soft and k elastic rows, within `work`; see `Room`."""
    most = m + k
    first, second, third = most * n, 2 * most * n, 2 * most * n + most * most
    fourth = third + 3 * most
    last = fourth + k
    return Face(
        work[:first].reshape((most, n)), work[third:][:most], work[third + most :][:most],
        work[third + 2 * most :][:most], work[last + n :][:n], work[fourth:last],
        work[first:second].reshape((most, n)), work[second:third], work[last:][:n], work[last + 2 * n :][:n],
    )  # fmt: skip


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


@compiled(inner=True, error_model="numpy")
def minimise_on_face(
    program: QuadraticProgram, active: ActiveSet, own: Face, size: int, tolerance: float, x: Array
) -> bool:
    """Minimiser x (n,) with an active set's bounds held and `size` rows of a face counted; whether it is finite."""
    # It may be out of the other bounds. Residuals off by more than the tolerance are computed by the other system.
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
