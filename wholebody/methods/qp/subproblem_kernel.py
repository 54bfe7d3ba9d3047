"""The rows, the program and the violation of a linearisation, as compiled loops: see `subproblem`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import dot, sort
from wholebody.methods.qp.quadratic_program import LinearRows, Rows, StepSize, Terms
from wholebody.methods.qp.settings import ProgramNumbers, Weights

MOST_ROWS = 4096  # more than one contact ever has


@compiled(forceinline=True)
def fill_rows(there: LinearRows, given: Terms, rows: Rows) -> None:
    """Sort the rows of a linearisation into soft and elastic ones, as `Rows` has them, whose arrays are filled."""
    errors, values, gaps, clearance = there.error, there.value, there.gap, there.clearance
    error_jacobian, value_jacobian, gap_jacobian = there.error_jacobian, there.value_jacobian, there.gap_jacobian
    number, gap_contact, kind, bound, share = there.number, there.gap_contact, given.kind, given.bound, given.share
    elastic_weight, nv, w = rows.elastic_weight, rows.soft.shape[1], given.weights
    weights = Weights(w[0], w[1], w[2], w[3], w[4])
    soft, soft_error, soft_weight, elastic = rows.soft, rows.soft_error, rows.soft_weight, rows.elastic
    violated, contact, key = rows.elastic_violation, rows.contact, rows.key
    goals, square = len(errors), 0.0
    for r in range(goals):
        square += (share[r] * errors[r]) ** 2
    pull = min(max(weights.force / max(np.sqrt(square), 1e-12), weights.least), weights.most)
    for r in range(goals):
        soft_error[r], soft_weight[r] = errors[r], pull * share[r]
        for i in range(nv):
            soft[r, i] = error_jacobian[r, i]
    row = goals
    for c in range(len(values)):
        if kind[c] == 0:
            soft_error[row], soft_weight[row] = values[c] - bound[0, c], weights.hold
            for i in range(nv):
                soft[row, i] = value_jacobian[c, i]
            row += 1
    row = 0
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        for c in range(len(values)):
            if kind[c] == 3 or kind[c] == side + 1:
                violated[row] = sign * (bound[side, c] - values[c])
                contact[row], key[row], elastic_weight[row] = row, -1 - row, weights.elastic
                for i in range(nv):
                    elastic[row, i] = sign * value_jacobian[c, i]
                row += 1
    first, count, place = row, len(number), 0
    for r in range(len(gaps)):
        c = gap_contact[r]
        if r >= count:
            place = place + 1 if r > count and gap_contact[r - 1] == c else 1
        violated[first + r] = clearance[r] - gaps[r]
        contact[first + r], key[first + r] = first + c, number[c] * MOST_ROWS + place
        for i in range(nv):
            elastic[first + r, i] = gap_jacobian[r, i]
        elastic_weight[first + r] = weights.elastic


@compiled()
def violation(rows: Rows, share: Array, displacement: Array) -> tuple[float, float, float, float]:
    """The figures of `Violation` after a displacement (nv,), or empty for none; `share` (g,) are the goals' weights."""
    soft, soft_error, elastic = rows.soft, rows.soft_error, rows.elastic
    violations, contact, contacts = rows.elastic_violation, rows.contact, rows.contacts
    goals, moves = len(share), len(displacement) > 0
    goal, hold, left, total, worst = 0.0, 0.0, 0.0, 0.0, np.zeros(contacts)
    for r in range(len(soft_error)):
        error = soft_error[r]
        if moves:
            error += dot(soft[r], displacement)
        if r < goals:
            goal += share[r] * error * error
            left += error * error
        else:
            hold += error * error
    for r in range(len(violations)):
        violated = violations[r]
        if moves:
            violated -= dot(elastic[r], displacement)
        if contact[r] >= 0:
            worst[contact[r]] = max(worst[contact[r]], violated)
    for c in range(len(worst)):
        total += worst[c]
    return np.sqrt(goal), np.sqrt(hold), total, np.sqrt(left)


@compiled(forceinline=True)
def fill_program(
    columns: Array, rows: Rows, target: Array, least: Array, step: StepSize, given: Array, scale: float
) -> None:
    """Fill in the numbers of a program that are not rows or weights.

    `columns` (4, nv), curvature and gradient of the measures and bounds of the step, become diagonal, linear, lower and
    upper; `target` (m,) and `least` (k,) those of the rows. `given` (9,) are `settings.ProgramNumbers`.
    """
    numbers = ProgramNumbers(given[0], given[1], given[2], given[3], given[4], given[5], given[6], given[7], given[8])
    diagonal, linear, lower, upper = columns[0], columns[1], columns[2], columns[3]
    soft_error, soft_weight, violations, goals = rows.soft_error, rows.soft_weight, rows.elastic_violation, rows.goals
    largest, square, farthest, heaviest_error, box = 0.0, 0.0, 0.0, 0.0, numbers.box * step.radius
    for i in range(len(diagonal)):
        largest = max(largest, scale * diagonal[i])
    floor = largest * numbers.least_curvature
    if floor == 0.0:
        floor = 1.0
    for r in range(goals):
        farthest = max(farthest, abs(soft_error[r]))
    factor = step.pull / farthest if 0.0 < step.pull < farthest else 1.0
    for r in range(len(soft_error)):
        error = soft_error[r]
        if r < goals:
            square += soft_weight[r] * error * error
            error *= factor
            heaviest_error = max(heaviest_error, soft_weight[r] * abs(error))
        target[r] = -(error + target[r])
    for i in range(len(diagonal)):
        entry = max(scale * diagonal[i], floor)
        linear[i] = scale * linear[i] if step.measures else 0.0
        entry = entry / step.gain if step.measures else numbers.proximal_share * entry
        diagonal[i] = max(entry, abs(linear[i]) / step.radius)
        lower[i] = min(max(lower[i], -box), box)
        upper[i] = min(max(upper[i], -box), box)
    if step.pull > 0.0:
        for i in range(len(diagonal)):
            diagonal[i] += step.damping * numbers.lever * heaviest_error
    else:
        # half way between joints that move alike, which takes the fewest steps, and as the measures would have them
        middle = _middle(diagonal)
        for i in range(len(diagonal)):
            diagonal[i] += step.damping * square * np.sqrt(diagonal[i] / middle)
    for r in range(len(violations)):
        least[r] = min(violations[r], numbers.error_clamp * step.radius)


@compiled(inner=True)
def _middle(values: Array) -> float:
    """Entry that half of the values (n,) are less than; 1 where there are none."""
    if len(values) == 0:
        return 1.0
    order = np.empty(len(values), dtype=np.intp)
    sort(values, order)
    return float(values[order[len(values) // 2]])


@compiled()
def work(
    soft: Array, elastic: Array, key: Indices, soft_error: Array, there: Indices, elastic_violation: Array
) -> float:
    """Sum of multipliers `soft` (m,), `elastic` of `key` (k,) times errors and violations; see `Multipliers`."""
    total = 0.0
    for r in range(len(soft_error)):
        total += soft[r] * soft_error[r]
    for j in range(len(key)):
        if elastic[j] != 0.0:
            for other in range(len(there)):
                if there[other] == key[j]:
                    total += elastic[j] * elastic_violation[other]
                    break
    return total


@compiled()
def add_kinematic_hessian(
    total: Array, columns: Array, support: Array, point: Array, force: Array, moment: Array
) -> None:
    """Add the second derivative of force times place and moment times angle (3,) to a total (n, n)."""
    # `columns` (n, 6) at the world's origin, linear then angular; `support` (n,) where they move the point (3,).
    n = total.shape[0]
    px, py, pz = point
    fx, fy, fz = force
    mx, my, mz = moment
    for k in range(n):
        if support[k] == 0.0:
            continue
        wx, wy, wz = columns[k, 3], columns[k, 4], columns[k, 5]
        moved_x = columns[k, 0] + wy * pz - wz * py
        moved_y = columns[k, 1] + wz * px - wx * pz
        moved_z = columns[k, 2] + wx * py - wy * px
        for j in range(k + 1):
            if support[j] == 0.0:
                continue
            ux, uy, uz = columns[j, 3], columns[j, 4], columns[j, 5]
            bent = (
                (fy * uz - fz * uy) * moved_x
                + (fz * ux - fx * uz) * moved_y
                + (fx * uy - fy * ux) * moved_z
                + 0.5 * ((my * uz - mz * uy) * wx + (mz * ux - mx * uz) * wy + (mx * uy - my * ux) * wz)
            )
            total[j, k] += bent
            if j != k:
                total[k, j] += bent
