"""A chain of plain joints brought to its goals by damped least squares, as one compiled loop: see `unobstructed`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import solve
from wholebody.methods.qp.rows import Chain, Goals
from wholebody.terms.residual_kernel import residuals


@compiled(error_model="numpy")
def reach(chain: Chain, goals: Goals, tolerance: float, damping: float, jacobian: Array, q: Array, trace: Array) -> int:
    """Step from a posture until the errors of the goals are as small as they get, or the steps are used up.

    Args:
        chain: what moves.
        goals: of its joints.
        tolerance: norm of all errors at which the goals are met, metres and radians.
        damping: squared, of a step at the goals.
        jacobian: (rows, n) becomes the rows of the goals where the last step began.
        q: (n,) where to begin; becomes the answer.
        trace: (steps + 1, 2) written: norm of the errors at each posture, and the longest entry of the step to it.

    Returns:
        How many postures were looked at; the last one is the answer.
    """
    lower, upper, free, most = chain.lower, chain.upper, chain.free, len(trace) - 1
    rows, size = jacobian.shape
    wrench, value, right = np.empty((rows, 6)), np.empty(rows), np.empty(rows)
    system, dq = np.empty((rows, rows)), np.empty(size)
    longest = 0.0
    for count in range(most + 1):
        _place(chain, q)
        wrench[:] = 0.0
        residuals(goals.tables, goals.entries, chain.joints, wrench, value)
        square = 0.0
        for r in range(rows):
            square += value[r] * value[r]
        left = np.sqrt(square)
        trace[count, 0], trace[count, 1] = left, longest
        met = left <= tolerance
        if count == most or left == 0.0 or (met and count and left > 0.5 * trace[count - 1, 0]):
            return count + 1
        _rows(goals, wrench, chain.columns, jacobian)
        for i in range(size):
            free[i], dq[i] = True, 0.0
        held = True
        while held:  # every round holds one more joint, so the loop ends
            damped = damping  # as Sugihara 2011: half of the squared error beside the least
            for r in range(rows):
                right[r] = -value[r]
                for i in range(size):
                    if not free[i]:
                        right[r] -= jacobian[r, i] * dq[i]
                damped += 0.5 * right[r] * right[r]
            for r in range(rows):
                for s in range(r + 1):
                    total = 0.0
                    for i in range(size):
                        if free[i]:
                            total += jacobian[r, i] * jacobian[s, i]
                    system[r, s] = total
                system[r, r] += damped
            if not solve(system, right):
                return count + 1
            held = False
            for i in range(size):
                if free[i]:
                    dq[i] = 0.0
                    for r in range(rows):
                        dq[i] += jacobian[r, i] * right[r]
            for i in range(size):
                if free[i] and not lower[i] <= q[i] + dq[i] <= upper[i]:
                    dq[i] = min(max(dq[i], lower[i] - q[i]), upper[i] - q[i])
                    free[i], held = False, True
        longest = 0.0
        for i in range(size):
            q[i] = min(max(q[i] + dq[i], lower[i]), upper[i])
            longest = max(longest, abs(dq[i]))
    return most + 1


@compiled(inner=True, error_model="numpy")
def _place(chain: Chain, q: Array) -> None:
    """Placements of the joints, and the columns of their Jacobian in the world, linear part at its origin first."""
    joints, turns, slides = chain.joints, chain.turns, chain.slides
    axis = np.empty(3)
    for k in range(len(q)):
        base, place, joint, column = joints[chain.parents[k]], chain.places[k], joints[k + 1], chain.columns[k]
        for i in range(3):
            joint[3, i] = base[3, i]
            for m in range(3):
                joint[3, i] += base[m, i] * place[3, m]
        for j in range(3):
            for i in range(3):
                joint[j, i] = base[0, i] * place[j, 0] + base[1, i] * place[j, 1] + base[2, i] * place[j, 2]
        for i in range(3):
            column[i] = joint[0, i] * slides[k, 0] + joint[1, i] * slides[k, 1] + joint[2, i] * slides[k, 2]
            axis[i] = joint[0, i] * turns[k, 0] + joint[1, i] * turns[k, 1] + joint[2, i] * turns[k, 2]
        for i in range(3):
            joint[3, i] += q[k] * column[i]
        x, y, z = axis[0], axis[1], axis[2]
        column[3], column[4], column[5] = x, y, z
        if x != 0.0 or y != 0.0 or z != 0.0:
            column[0] += joint[3, 1] * z - joint[3, 2] * y
            column[1] += joint[3, 2] * x - joint[3, 0] * z
            column[2] += joint[3, 0] * y - joint[3, 1] * x
            cosine, sine = np.cos(q[k]), np.sin(q[k])
            for j in range(3):  # Rodrigues
                a, b, c = joint[j, 0], joint[j, 1], joint[j, 2]
                along = (1.0 - cosine) * (x * a + y * b + z * c)
                joint[j, 0] = cosine * a + sine * (y * c - z * b) + along * x
                joint[j, 1] = cosine * b + sine * (z * a - x * c) + along * y
                joint[j, 2] = cosine * c + sine * (x * b - y * a) + along * z


@compiled(inner=True)
def _rows(goals: Goals, wrench: Array, columns: Array, jacobian: Array) -> None:
    """Rows of the goals: the rates at which their wrenches work on the motion of a joint relative to another."""
    entries = goals.entries
    for e in range(len(entries)):
        for r in range(entries[e, 0], entries[e, 0] + 3 * (entries[e, 3] + entries[e, 4])):
            for k in range(len(columns)):
                moved = goals.support[entries[e, 1], k] - goals.support[entries[e, 2], k]
                jacobian[r, k] = 0.0
                if moved != 0:
                    for i in range(6):
                        jacobian[r, k] += moved * wrench[r, i] * columns[k, i]
