"""A step of tracking in one compiled call, from the linearisation to the displacement: see `step_program`."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.active_set_kernel import solve_growing, work_size
from wholebody.methods.qp.dense_kernel import dot
from wholebody.methods.qp.subproblem_kernel import motion, program, sort_rows

Ends: TypeAlias = tuple[int, int, int, int, int, int, int, int, int, int, int, int]


@compiled(error_model="numpy")
def solve(
    value: Array,
    jacobian: Array,
    gap: Array,
    gap_contact: Indices,
    clearance: Array,
    number: Indices,
    measure: Array,
    box: Array,
    q: Array,
    before: Array,
    after: Array,
    kind: Indices,
    bound: Array,
    share: Array,
    held: Mask,
    pushed: Indices,
    columns: Array,
    joints: Indices,
    placement: Array,
    reach: Array,
    twist: Array,
    floats: Array,
    integers: Indices,
    masks: Mask,
    numbers: Array,
    measures: bool,
    hot: bool,
    least_damping: float,
) -> tuple[bool, int, float, float, float, float, float, float, float, float]:
    """Sort the rows of a linearisation, build the program of a step and solve it from the last active set.

    Args:
        value: (g + c,) errors of goals and values of constraints; see `PackedLinearisation`, like the next seven.
        jacobian: (g + c + r, n).
        gap: (r,).
        gap_contact: (r,).
        clearance: (r,).
        number: (contacts,) pairs of the contacts.
        measure: (2, n + 1).
        box: (2, n).
        q: (nq,) the posture.
        before: (nq + m + 2,) where the last step ended, the errors of its soft rows there to first order, what it left
            of the goals, and 1 where there was such a step.
        after: (nq + m + 2,) the same of this step, but for the posture, where the program is solved.
        kind: (c,) see `subproblem_kernel.sort_rows`, like the next two.
        bound: (2, c).
        share: (g,).
        held: (2, n) bounds that held the last program's answer; those that hold this one's where it is solved.
        pushed: keys of its elastic rows that pushed, in ascending order.
        columns: (columns, 6) of the joint Jacobian.
        joints: place in the tangent and joint of each column, parents of the joints, joints of the pieces.
        placement: (pieces, 4, 3) see `subproblem_kernel.motion`.
        reach: (pieces,).
        twist: (njoints, 6) room.
        floats: room, which `parts` lays out.
        integers: room for 5 k: labels and keys of the elastic rows, the keys of those that push, places.
        masks: room for 2 n + 2 k.
        numbers: see `step_program.numbers_of`.
        measures: whether measures count.
        hot: whether to solve it, not only to build it.
        least_damping: of goals, where the last step does not ask for more.

    Returns:
        Whether the program is solved; how many elastic rows push; longest way and largest turn of the pieces; largest
        violation of an elastic row; least room that a contact row has after the step, and largest violation of an
        elastic row then; least clearance asked of a contact; the damping, and what the answer asks for.
    """
    n, goals = box.shape[1], len(share)
    equal, one_sided = 0, 0
    for c in range(len(kind)):
        equal += kind[c] == 0
        one_sided += (kind[c] == 3) * 2 + (kind[c] == 1) + (kind[c] == 2)
    m, k = goals + equal, one_sided + len(gap)
    ends = parts(n, m, k, len(columns))
    x, spread = floats[: ends[0]], floats[ends[0] : ends[1]]
    shift, target = floats[ends[1] : ends[2]], floats[ends[2] : ends[3]]
    soft_values = floats[ends[3] : ends[4]].reshape((2, m))
    entries, soft = floats[ends[4] : ends[5]].reshape((4, n)), floats[ends[5] : ends[6]].reshape((m, n))
    elastic, violated = floats[ends[6] : ends[7]].reshape((k, n)), floats[ends[7] : ends[8]]
    least, elastic_weight, work = floats[ends[8] : ends[9]], floats[ends[9] : ends[10]], floats[ends[10] :]
    labels, pushing_keys, places = integers[: 2 * k].reshape((2, k)), integers[2 * k : 3 * k], integers[3 * k : 5 * k]
    at_lower, at_upper, pushing, chosen = masks[:n], masks[n : 2 * n], masks[2 * n : 2 * n + k], masks[2 * n + k :][:k]
    terms = goals + len(kind)
    sort_rows(
        value[:goals], jacobian[:goals], value[goals:], jacobian[goals:terms], gap, jacobian[terms:], gap_contact,
        clearance, number, kind, bound, share, numbers[14:18], int(numbers[13]), soft, soft_values, elastic, violated,
        labels,
    )  # fmt: skip
    last, damping = len(q), least_damping
    known = before[last + m + 1] > 0.0
    for i in range(last):
        known = known and before[i] == q[i]
    error = 0.0
    for r in range(goals):
        error += value[r] * value[r]
    error = max(np.sqrt(error), 1e-12)
    for r in range(m):
        shift[r] = soft_values[0, r] - before[last + r] if known else 0.0
    for r in range(goals, m):  # what is held: a step much shorter than the last one is curved much less
        shift[r] = min(max(shift[r], -numbers[24]), numbers[24])
    if known:
        damping = max(damping, numbers[10] * min(1.0, before[last + m] / error))
        # what a goal that rests is missed by, because the last step was curved; a goal that moves is not run ahead of
        resting = measures
        for r in range(goals):
            resting = resting and abs(shift[r]) < numbers[11]
        if not resting:
            for r in range(goals):
                shift[r] = 0.0
    numbers[5] = damping
    program(
        measure[0][:n], measure[1][:n], box[0], box[1], soft_values[0], soft_values[1], goals, violated, shift,
        measures, numbers[4] > 0.0, numbers[:10], entries, target, least,
    )  # fmt: skip
    least_asked = np.inf
    for c in range(len(number)):
        least_asked = min(least_asked, clearance[c])
    worst = 0.0
    for j in range(k):
        elastic_weight[j] = numbers[12]
        worst = max(worst, violated[j])
    if not hot:
        return False, 0, 0.0, 0.0, worst, -np.inf, np.inf, least_asked, damping, 0.0
    for i in range(n):
        at_lower[i], at_upper[i] = held[0, i], held[1, i]
    rounds = solve_growing(
        entries[0], entries[1], soft, target, soft_values[1], elastic, least, elastic_weight, entries[2], entries[3],
        labels[1], pushed, at_lower, at_upper, pushing, chosen, numbers[18:24], work, places, x,
    )  # fmt: skip
    if rounds < 0:
        return False, 0, 0.0, 0.0, worst, -np.inf, np.inf, least_asked, damping, 0.0
    for i in range(n):
        held[0, i], held[1, i] = at_lower[i], at_upper[i]
    count = 0
    for j in range(k):
        if pushing[j]:
            place, key = count, labels[1, j]
            while place > 0 and pushing_keys[place - 1] > key:
                pushing_keys[place] = pushing_keys[place - 1]
                place -= 1
            pushing_keys[place] = key
            count += 1
    left = 0.0
    for r in range(m):
        gone = dot(soft[r], x)
        after[last + r] = soft_values[0, r] + gone
        if r < goals:
            left += (gone - target[r]) ** 2
    left = np.sqrt(left)
    after[last + m], after[last + m + 1] = left, 1.0
    spare, missed = np.inf, 0.0
    for j in range(k):
        ahead = dot(elastic[j], x) - violated[j]
        missed = max(missed, -ahead)
        if j >= one_sided:
            spare = min(spare, ahead)
    asked = numbers[10] * min(1.0, left / error) if left > numbers[11] else 0.0
    wide, pieces = len(columns), len(reach)
    for c in range(wide):
        spread[c] = x[joints[c]]
    way, turn = motion(
        spread, columns, joints[wide : 2 * wide], joints[2 * wide : len(joints) - pieces],
        joints[len(joints) - pieces :], placement, reach, twist,
    )  # fmt: skip
    return True, count, way, turn, worst, spare, missed, least_asked, damping, asked


@compiled()
def run_ahead(
    there: Array,
    asked: Array,
    error: Array,
    soft: Array,
    x: Array,
    q: Array,
    goals: int,
    moved: float,
    most: float,
    straight: float,
    before: Array,
) -> bool:
    """Write into `before` what makes the next program run ahead of what is held as the displacement x curves it.

    Args:
        there: (held,) values where the displacement ends.
        asked: (held,) what they are to be.
        error: (m,) errors of the soft rows; first those of goals, then of what is held.
        soft: (m, n) their rows.
        x: (n,) the displacement.
        q: (nq,) the posture.
        goals: how many rows goals have.
        moved: how much a goal that was not known has moved at least, so that it does not count as one that rests.
        most: how far it is run ahead at most.
        straight: see the answer.
        before: (nq + m + 2,) see `solve`.

    Returns:
        Whether a row is to run ahead by more than `straight` farther, or less far, than it did.
    """
    last = len(q)
    known = before[-1] > 0.0
    for i in range(last):
        known = known and before[i] == q[i]
    if not known:  # its goals are asked for as without a step before
        for i in range(last):
            before[i] = q[i]
        for r in range(goals):
            before[last + r] = error[r] + moved
        before[-2], before[-1] = 0.0, 1.0
    largest = 0.0
    for r in range(goals, len(error)):
        foreseen = min(max(error[r] - before[last + r], -most), most) if known else 0.0
        curved = there[r - goals] - asked[r - goals] - error[r] - dot(soft[r], x)
        largest = max(largest, abs(min(max(curved, -most), most) - foreseen))
        before[last + r] = error[r] - curved
    return largest > straight


@compiled()
def parts(n: int, m: int, k: int, columns: int) -> Ends:
    """Where the parts of the room end for n variables, m soft and k elastic rows.

    They are x (n,), x over the columns of the joint Jacobian, shift (m,), target (m,), errors
    and weights (2, m), diagonal, linear, lower and upper (4, n), soft rows (m, n), elastic rows (k, n), their violation
    (k,), least (k,) and weight (k,), and what `active_set_kernel.solve_growing` needs.
    """
    a = n
    c = a + columns
    d = c + m
    e = d + m
    f = e + 2 * m
    g = f + 4 * n
    h = g + m * n
    i = h + k * n
    return a, c, d, e, f, g, h, i, i + k, i + 2 * k, i + 3 * k, i + 3 * k + work_size(n, m, k)
