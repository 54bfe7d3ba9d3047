"""The rows, the program and the violation of a linearisation, as compiled loops: see `subproblem`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.methods.qp.dense_kernel import dot, sort
from wholebody.methods.qp.rows import LinearRows, Rows, StepSize, Terms
from wholebody.methods.qp.settings import Weights

MOST_ROWS = 4096  # more than one contact ever has


@compiled()
def sort_rows(
    error: Array,
    error_jacobian: Array,
    value: Array,
    value_jacobian: Array,
    gap: Array,
    gap_jacobian: Array,
    gap_contact: Indices,
    clearance: Array,
    number: Indices,
    kind: Indices,
    bound: Array,
    share: Array,
    weights: Array,
    soft: Array,
    soft_values: Array,
    elastic: Array,
    elastic_values: Array,
    labels: Indices,
) -> None:
    """`fill_rows` for a call from Python, which gives the parts of `LinearRows`, of `Terms` and of `Rows`.

    See `active_set_kernel.solve_growing` for what records would cost.
    """
    there = LinearRows(error, error_jacobian, value, value_jacobian, gap, gap_jacobian, gap_contact, clearance, number)
    rows = rows_in(soft, soft_values, elastic, elastic_values, labels, len(error), 0)
    fill_rows(there, Terms(kind, bound, share, weights), rows)


@compiled(inner=True, forceinline=True)
def rows_in(
    soft: Array, soft_values: Array, elastic: Array, elastic_values: Array, labels: Indices, goals: int, contacts: int
) -> Rows:
    """`Rows` in arrays: (2, m) errors and weights, (2, k) violations and weights, (2, k) contacts and keys."""
    return Rows(
        soft, soft_values[0], soft_values[1], goals, elastic, elastic_values[0], labels[0], contacts, labels[1],
        elastic_values[1],
    )  # fmt: skip


@compiled(inner=True, forceinline=True)
def fill_rows(there: LinearRows, given: Terms, rows: Rows) -> None:
    """Sort the rows of a linearisation into soft and elastic ones, as `Rows` has them, whose arrays are filled."""
    errors, values, gaps, clearance = there.error, there.value, there.gap, there.clearance
    error_jacobian, value_jacobian, gap_jacobian = there.error_jacobian, there.value_jacobian, there.gap_jacobian
    number, gap_contact, kind, bound, share = there.number, there.gap_contact, given.kind, given.bound, given.share
    elastic_weight, nv = rows.elastic_weight, rows.soft.shape[1]
    weights = Weights(given.weights[0], given.weights[1], given.weights[2], given.weights[3], given.weights[4])
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
def violation(
    soft: Array,
    soft_error: Array,
    elastic: Array,
    violations: Array,
    contact: Indices,
    contacts: int,
    share: Array,
    displacement: Array,
) -> tuple[float, float, float, float]:
    """The figures of `Violation` after a displacement: (nv,), or empty for none.

    `share` (g,) are the goals' weights. Elastic rows of the contact -1 do not count.
    """
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


@compiled()
def fill_program(
    measure: Array, box: Array, goals: int, soft: Array, violations: Array, size: Array, columns: Array, least: Array
) -> None:
    """Fill in the numbers of a program that are not rows or weights, as `Subproblem.program` says.

    Args:
        measure: (2, nv) gradient and curvature of the measures.
        box: (2, nv) bounds of the step.
        goals: number of their rows.
        soft: (3, m) errors and weights of the soft rows, and what is added to the errors; the last become the targets.
        violations: (k,) of the elastic rows.
        size: (11,) the fields of `StepSize`.
        columns: (4, nv) become diagonal, linear, lower and upper.
        least: (k,) become the least values of the elastic rows.
    """
    step = StepSize(
        size[0], size[1], size[2], size[3], size[4], size[5] > 0.0, size[6], size[7], size[8], size[9], size[10]
    )
    gradient, curvature = measure[0], measure[1]
    soft_error, soft_weight, target = soft[0], soft[1], soft[2]
    diagonal, linear, lower, upper = columns[0], columns[1], columns[2], columns[3]
    largest, square, farthest, heaviest_error = 0.0, 0.0, 0.0, 0.0
    for i in range(box.shape[1]):
        largest = max(largest, step.scale * curvature[i])
    floor = largest * step.least_curvature
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
    for i in range(box.shape[1]):
        entry = max(step.scale * curvature[i], floor)
        linear[i] = step.scale * gradient[i] if step.measures else 0.0
        entry = entry / step.gain if step.measures else step.proximal * entry
        diagonal[i] = max(entry, abs(linear[i]) / step.radius)
        lower[i] = min(max(box[0, i], -step.box), step.box)
        upper[i] = min(max(box[1, i], -step.box), step.box)
    if step.pull > 0.0:
        for i in range(box.shape[1]):
            diagonal[i] += step.damping * step.lever * heaviest_error
    else:
        # half way between joints that move alike, which takes the fewest steps, and as the measures would have them
        middle = _middle(diagonal)
        for i in range(box.shape[1]):
            diagonal[i] += step.damping * square * np.sqrt(diagonal[i] / middle)
    for r in range(len(violations)):
        least[r] = min(violations[r], step.overlap)


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
    """Sum of multipliers times the errors (m,) and the violations of a posture.

    `soft` (m,), `elastic` and `key` (k,) are those of `Multipliers`. Elastic rows of the posture are those with the
    same keys, `there`; the ones that are not there add nothing.
    """
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
    """Add the second derivative of force times place and moment times angle to a total.

    Args:
        total: (n, n) symmetric; it is changed.
        columns: (n, 6) of the joint Jacobian at the world's origin: linear, then angular velocity.
        support: (n,) nonzero for columns that move the point.
        point: (3,) where the force pulls, metres.
        force: (3,) what it pulls with.
        moment: (3,) what turns the body.
    """
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
