"""The rows, the program and the violation of a linearisation, as compiled loops: see `subproblem`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled


@compiled()
def sort_rows(
    goal_error: Array,
    goal_jacobian: Array,
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
    force: Array,
    most_rows: int,
    soft: Array,
    soft_values: Array,
    elastic: Array,
    violated: Array,
    labels: Indices,
) -> None:
    """Sort the rows of a linearisation into soft and elastic ones, as `Rows` has them.

    The first nine arguments are the linearisation's, `number` being that of its contacts. `kind` (c,) says of each
    value whether it is an equality (0), has a lower bound (1), an upper bound (2) or both (3); `bound` (2, c) are the
    bounds. `share` (g,) are the goals' shares of the largest weight, `force` the force of all goals with these weights,
    the least and the largest factor of their weights and the weight of equalities. A contact has fewer rows than
    `most_rows`. The other arguments are room: `soft_values` (2, m) for errors and weights, `labels` (2, k) for contacts
    and keys.
    """
    nv, goals, values = soft.shape[1], len(goal_error), len(value)
    square = 0.0
    for r in range(goals):
        square += (share[r] * goal_error[r]) ** 2
    pull = min(max(force[0] / max(np.sqrt(square), 1e-12), force[1]), force[2])
    for r in range(goals):
        soft_values[0, r], soft_values[1, r] = goal_error[r], pull * share[r]
        for i in range(nv):
            soft[r, i] = goal_jacobian[r, i]
    row = goals
    for c in range(values):
        if kind[c] == 0:
            soft_values[0, row], soft_values[1, row] = value[c] - bound[0, c], force[3]
            for i in range(nv):
                soft[row, i] = value_jacobian[c, i]
            row += 1
    row = 0
    for side in range(2):
        for c in range(values):
            if kind[c] == 3 or kind[c] == side + 1:
                sign = 1.0 if side == 0 else -1.0
                violated[row] = sign * (bound[side, c] - value[c])
                labels[0, row], labels[1, row] = row, -1 - row
                for i in range(nv):
                    elastic[row, i] = sign * value_jacobian[c, i]
                row += 1
    first, contacts = row, len(number)
    place = 0
    for r in range(len(gap)):
        c = gap_contact[r]
        if r >= contacts:
            place = place + 1 if r > contacts and gap_contact[r - 1] == c else 1
        violated[first + r] = clearance[r] - gap[r]
        labels[0, first + r], labels[1, first + r] = first + c, number[c] * most_rows + place
        for i in range(nv):
            elastic[first + r, i] = gap_jacobian[r, i]


@compiled()
def violation(
    soft_error: Array,
    soft: Array,
    violated: Array,
    elastic: Array,
    contact: Indices,
    share: Array,
    worst: Array,
    displacement: Array,
) -> tuple[float, float, float, float]:
    """The figures of `Violation` after a displacement: (nv,), or empty for none; `worst` (contacts,) is room.

    Elastic rows of the contact -1 do not count.
    """
    goals, moves = len(share), len(displacement) > 0
    goal, hold, left, total = 0.0, 0.0, 0.0, 0.0
    for r in range(len(soft_error)):
        error = soft_error[r]
        if moves:
            for i in range(len(displacement)):
                error += soft[r, i] * displacement[i]
        if r < goals:
            goal += share[r] * error * error
            left += error * error
        else:
            hold += error * error
    worst[:] = 0.0
    for r in range(len(violated)):
        violation = violated[r]
        if moves:
            for i in range(len(displacement)):
                violation -= elastic[r, i] * displacement[i]
        if contact[r] >= 0:
            worst[contact[r]] = max(worst[contact[r]], violation)
    for c in range(len(worst)):
        total += worst[c]
    return np.sqrt(goal), np.sqrt(hold), total, np.sqrt(left)


@compiled()
def program(
    gradient: Array,
    curvature: Array,
    lower: Array,
    upper: Array,
    soft_error: Array,
    soft_weight: Array,
    goals: int,
    violated: Array,
    shift: Array,
    measures: bool,
    pulls: bool,
    numbers: Array,
    columns: Array,
    target: Array,
    least: Array,
) -> None:
    """The numbers of a program that are not rows, as `Subproblem.program` says.

    `numbers` are the scale of the measures, the least share of the largest curvature, the proximal share, the radius,
    the pull, the damping, the lever, the size of the box, the largest violation asked for and the gain. `columns` (4,
    nv) is room for diagonal, linear, lower and upper; `target` (m,) and `least` (k,) are room too.
    """
    nv = len(gradient)
    scale, floor_share, proximal, radius = numbers[0], numbers[1], numbers[2], numbers[3]
    pull, damping, lever, box, most, gain = numbers[4], numbers[5], numbers[6], numbers[7], numbers[8], numbers[9]
    largest = 0.0
    for i in range(nv):
        largest = max(largest, scale * curvature[i])
    floor = largest * floor_share
    if floor == 0.0:
        floor = 1.0
    square, heaviest, farthest, heaviest_error = 0.0, 0.0, 0.0, 0.0
    for r in range(goals):
        farthest = max(farthest, abs(soft_error[r]))
    factor = pull / farthest if pulls and farthest > pull else 1.0
    for r in range(len(target)):
        error = soft_error[r]
        if r < goals:
            square += soft_weight[r] * error * error
            error *= factor
            heaviest = max(heaviest, soft_weight[r])
            heaviest_error = max(heaviest_error, soft_weight[r] * abs(error))
        target[r] = -(error + shift[r])
    for i in range(nv):
        entry = max(scale * curvature[i], floor)
        columns[1, i] = scale * gradient[i] if measures else 0.0
        columns[0, i] = max(entry / gain if measures else proximal * entry, abs(columns[1, i]) / radius)
        columns[2, i] = min(max(lower[i], -box), box)
        columns[3, i] = min(max(upper[i], -box), box)
    if pulls:
        for i in range(nv):
            columns[0, i] += damping * lever * heaviest_error
    else:
        # half way between joints that move alike, which takes the fewest steps, and as the measures would have them
        middle = _middle(columns[0])
        for i in range(nv):
            columns[0, i] += damping * square * np.sqrt(columns[0, i] / middle)
    for r in range(len(least)):
        least[r] = min(violated[r], most)


@compiled(inner=True)
def _middle(values: Array) -> float:
    """Entry that half of the values (n,) are less than."""
    ordered = values.copy()
    for place in range(1, len(values)):
        own, back = ordered[place], place - 1
        while back >= 0 and ordered[back] > own:
            ordered[back + 1] = ordered[back]
            back -= 1
        ordered[back + 1] = own
    return float(ordered[len(values) // 2])


@compiled()
def multipliers(
    rows: Array,
    target: Array,
    weight: Array,
    elastic: Array,
    least: Array,
    elastic_weight: Array,
    pushing: Mask,
    x: Array,
    scale: float,
    soft_multiplier: Array,
    elastic_multiplier: Array,
) -> None:
    """Write the multipliers of a program's first soft rows and of its elastic ones, as `Multipliers` has them.

    The arguments up to `elastic_weight` are the program's; `x` (n,) is its answer with the elastic rows that push (k,),
    and `scale` what measures are multiplied by. The last two, (m,) and (k,), are written.
    """
    for r in range(len(soft_multiplier)):
        residual = -target[r]
        for i in range(len(x)):
            residual += rows[r, i] * x[i]
        soft_multiplier[r] = weight[r] * residual / scale
    for j in range(len(elastic_multiplier)):
        violated = 0.0
        if pushing[j]:
            violated = least[j]
            for i in range(len(x)):
                violated -= elastic[j, i] * x[i]
        elastic_multiplier[j] = elastic_weight[j] * violated / scale


@compiled()
def work(
    soft_multiplier: Array,
    elastic_multiplier: Array,
    key: Indices,
    soft_error: Array,
    key_there: Indices,
    violated: Array,
) -> float:
    """Sum of the multipliers times the errors (m,) and the violations (k,) of a posture.

    Elastic rows are those with the same keys; the ones that `key_there` (k,) has not add nothing.
    """
    total = 0.0
    for r in range(len(soft_error)):
        total += soft_multiplier[r] * soft_error[r]
    for j in range(len(key)):
        if elastic_multiplier[j] != 0.0:
            for other in range(len(key_there)):
                if key_there[other] == key[j]:
                    total += elastic_multiplier[j] * violated[other]
                    break
    return total


@compiled()
def motion(
    displacement: Array,
    columns: Array,
    column_joint: Indices,
    parents: Indices,
    joint: Indices,
    placement: Array,
    reach: Array,
    twist: Array,
) -> tuple[float, float]:
    """Longest way of any point of any piece [m], and largest turn [rad], to first order.

    `displacement` (n,) is spread over the `columns` (n, 6) of the joint Jacobian, which belong to `column_joint` (n,);
    `parents` (njoints,) are the joints' parents; the pieces are carried by `joint` (p,), stand at `placement` (p, 4, 3)
    and reach `reach` (p,) from there. `twist` (njoints, 6) is room.
    """
    twist[:] = 0.0
    for k in range(len(columns)):
        for i in range(6):
            twist[column_joint[k], i] += columns[k, i] * displacement[k]
    for j in range(1, len(parents)):
        for i in range(6):
            twist[j, i] += twist[parents[j], i]
    longest, most = 0.0, 0.0
    for p in range(len(joint)):
        if joint[p] == 0:
            continue
        own = twist[joint[p]]
        shift, turn = 0.0, 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            speed = own[i] + own[3 + j] * placement[p, 3, k] - own[3 + k] * placement[p, 3, j]
            shift += speed * speed
            turn += own[3 + i] * own[3 + i]
        turn = np.sqrt(turn)
        most = max(most, turn)
        longest = max(longest, np.sqrt(shift) + (turn * reach[p] if turn > 0.0 else 0.0))
    return longest, most
