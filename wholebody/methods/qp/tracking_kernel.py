"""A step of tracking in one compiled call, from the linearisation to the displacement: see `step_program`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.active_set_kernel import grow, limits_of
from wholebody.methods.qp.dense_kernel import dot
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.rows import LinearRows, Rows, StepParts, Terms
from wholebody.methods.qp.subproblem_kernel import fill_program, fill_rows
from wholebody.methods.qp.turning_kernel import bodies_in, moved


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
    twists: Array,
    floats: Array,
    integers: Indices,
    masks: Mask,
    numbers: Array,
    measures: bool,
    hot: bool,
    least_damping: float,
) -> tuple[bool, int, float, float, float, float, float, float, float, float]:
    """Sort the rows of a linearisation, build the program of a step and solve it from the last active set.

    It takes arrays, not records; see `active_set_kernel.solve_growing` for what a record costs at a call.

    Args:
        value: (g + c,) errors of goals and values of constraints; see `PackedLinearisation`, like the next eight.
        jacobian: (g + c + r, n).
        gap: (r,).
        gap_contact: (r,).
        clearance: (r,).
        number: (contacts,) pairs of the contacts.
        measure: (2, n + 1).
        box: (2, n).
        q: (nq,) the posture.
        before: (nq + m + 2,) where the last step ended: the posture, the errors of its soft rows there to first order,
            the residual of its goals, and 1 where there was such a step.
        after: (nq + m + 2,) the same of this step, but for the posture, where the program is solved.
        kind: (c,) see `Terms`, like the next two.
        bound: (2, c).
        share: (g,).
        held: (2, n) bounds that held the last program's answer; those that hold this one's where it is solved.
        pushed: keys of the last program's elastic rows that pushed, in ascending order.
        columns: see `turning_kernel.bodies_in`, like the next four.
        joints: of columns and pieces.
        placement: (p, 4, 3).
        reach: (p,).
        twists: (3, njoints, 6) room.
        floats: room, which `parts` lays out, like the next two.
        integers: (5 k,).
        masks: (2 n + 2 k,).
        numbers: see `step_program.numbers_of`.
        measures: whether they count.
        hot: whether to solve the program, not only to build it.
        least_damping: of goals, where the last step does not ask for more.

    Returns:
        Whether the program is solved; how many elastic rows push; longest way and largest turn of the pieces; largest
        violation of an elastic row; least room that a contact row has after the step, and largest violation of an
        elastic row then; least clearance asked of a contact; the damping, and what the answer asks for.
    """
    n, goals, contacts = box.shape[1], len(share), len(number)
    equal, one_sided = 0, 0
    for c in range(len(kind)):
        equal += kind[c] == 0
        one_sided += (kind[c] == 3) * 2 + (kind[c] == 1) + (kind[c] == 2)
    m, terms, last = goals + equal, goals + len(kind), len(q)
    own = parts(floats, integers, masks, n, goals, m, one_sided + len(gap), one_sided + contacts)
    rows, x, given = own.rows, own.x, Terms(kind, bound, share, numbers[20:25])
    there = LinearRows(
        value[:goals], jacobian[:goals], value[goals:], jacobian[goals:terms], gap, jacobian[terms:], gap_contact,
        clearance, number,
    )  # fmt: skip
    fill_rows(there, given, rows)
    target, soft, soft_error, elastic, violations, key = (
        own.program.target, rows.soft, rows.soft_error, rows.elastic, rows.elastic_violation, rows.key,
    )  # fmt: skip
    at_lower, at_upper = own.active.lower, own.active.upper
    error = 0.0
    for r in range(goals):
        error += value[r] * value[r]
    error = max(np.sqrt(error), 1e-12)
    damping = _run_ahead_of(before, q, rows, own.soft[2], measures, numbers[17:20], error, least_damping)
    numbers[3], numbers[5] = damping, measures
    fill_program(measure, box, goals, own.soft, violations, numbers[:11], own.columns, own.program.least)
    least_asked, worst = np.inf, 0.0
    for c in range(contacts):
        least_asked = min(least_asked, clearance[c])
    for violated in violations:
        worst = max(worst, violated)
    for i in range(n):
        at_lower[i], at_upper[i] = held[0, i], held[1, i]
    rounds = -1
    if hot:
        rounds = grow(own.program, rows.key, pushed, own.active, limits_of(numbers[11:17]), own.room, x)
    if rounds < 0:
        return False, 0, 0.0, 0.0, worst, -np.inf, np.inf, least_asked, damping, 0.0
    for i in range(n):
        held[0, i], held[1, i] = at_lower[i], at_upper[i]
    count = _sorted_keys(key, own.active.elastic, own.pushing)
    left = 0.0
    for r in range(m):
        gone = dot(soft[r], x)
        after[last + r] = soft_error[r] + gone
        if r < goals:
            left += (gone - target[r]) ** 2
    left = np.sqrt(left)
    after[-2], after[-1] = left, 1.0
    spare, missed = np.inf, 0.0
    for j in range(len(key)):
        ahead = dot(elastic[j], x) - violations[j]
        missed = max(missed, -ahead)
        if j >= one_sided:
            spare = min(spare, ahead)
    asked = numbers[17] * min(1.0, left / error) if left > numbers[18] else 0.0
    way, turn = moved(x, bodies_in(columns, joints, placement, reach, twists))
    return True, count, way, turn, worst, spare, missed, least_asked, damping, asked


@compiled(inner=True, forceinline=True)
def _run_ahead_of(
    before: Array, q: Array, rows: Rows, shift: Array, measures: bool, numbers: Array, error: float, least: float
) -> float:
    """Write what is added to the errors of the soft rows, as the last step was curved; returns the damping.

    `numbers` are damping, error below which a goal rests, and how far what is held is run ahead of at most; `error` is
    the norm of the goals' errors, `least` the damping at least.
    """
    damping, rest, curved = numbers[0], numbers[1], numbers[2]
    soft_error, goals = rows.soft_error, rows.goals
    last, m = len(q), len(soft_error)
    known = _is_known(before, q)
    for r in range(m):
        shift[r] = soft_error[r] - before[last + r] if known else 0.0
    for r in range(goals, m):  # what is held: a step much shorter than the last one is curved much less
        shift[r] = min(max(shift[r], -curved), curved)
    if not known:
        return least
    # what a goal that rests is missed by, because the last step was curved; a goal that moves is not run ahead of
    resting = measures
    for r in range(goals):
        resting = resting and abs(shift[r]) < rest
    if not resting:
        shift[:goals] = 0.0
    own: float = damping * min(1.0, before[last + m] / error)
    return max(least, own)


@compiled(inner=True, forceinline=True)
def _is_known(before: Array, q: Array) -> bool:
    """Whether the last step ended at the posture q (nq,)."""
    known: bool = before[-1] > 0.0
    for i in range(len(q)):
        known = known and before[i] == q[i]
    return known


@compiled(inner=True, forceinline=True)
def _sorted_keys(key: Indices, pushing: Mask, keys: Indices) -> int:
    """Write the keys of the rows that push in ascending order; returns how many."""
    count = 0
    for j in range(len(key)):
        if pushing[j]:
            place = count
            while place > 0 and keys[place - 1] > key[j]:
                keys[place] = keys[place - 1]
                place -= 1
            keys[place] = key[j]
            count += 1
    return count


@compiled()
def run_ahead(
    curved: Array, soft_error: Array, goals: int, q: Array, moved: float, most: float, straight: float, before: Array
) -> bool:
    """Write into `before` what makes the next program run ahead of what is held as a displacement curves it.

    Args:
        curved: (held,) by how much what is held ends elsewhere than its rows say.
        soft_error: (m,) errors of the last program's soft rows.
        goals: how many of them are goals'.
        q: (nq,) the posture.
        moved: how much a goal that was not known has moved at least, so that it does not count as one that rests.
        most: how far it is run ahead at most.
        straight: see the answer.
        before: (nq + m + 2,) see `solve`.

    Returns:
        Whether a row is to run ahead by more than `straight` farther, or less far, than it did.
    """
    last, known = len(q), _is_known(before, q)
    if not known:  # its goals are asked for as without a step before
        for i in range(last):
            before[i] = q[i]
        for r in range(goals):
            before[last + r] = soft_error[r] + moved
        before[-2], before[-1] = 0.0, 1.0
    largest = 0.0
    for r in range(goals, len(soft_error)):
        predicted = min(max(soft_error[r] - before[last + r], -most), most) if known else 0.0
        bow = curved[r - goals]
        largest = max(largest, abs(min(max(bow, -most), most) - predicted))
        before[last + r] = soft_error[r] - bow
    return largest > straight


@compiled(inner=True, forceinline=True)
def parts(
    floats: Array, integers: Indices, masks: Mask, n: int, goals: int, m: int, k: int, contacts: int
) -> StepParts:
    """The parts of the room for n variables, m soft rows, of which some are goals', and k elastic rows."""
    a = 5 * n
    b = a + 3 * m
    c = b + m * n
    d = c + k * n
    columns, soft_values = floats[n:a].reshape((4, n)), floats[a:b].reshape((3, m))
    soft, elastic = floats[b:c].reshape((m, n)), floats[c:d].reshape((k, n))
    rows = Rows(
        soft, soft_values[0], soft_values[1], goals, elastic, floats[d : d + k], integers[:k], contacts,
        integers[k : 2 * k], floats[d + k : d + 2 * k],
    )  # fmt: skip
    program = QuadraticProgram(
        columns[0], columns[1], soft, soft_values[2], soft_values[1], elastic, floats[d + 2 * k : d + 3 * k],
        floats[d + k : d + 2 * k], columns[2], columns[3],
    )  # fmt: skip
    return StepParts(
        floats[:n], columns, soft_values, rows, program,
        ActiveSet(masks[:n], masks[n : 2 * n], masks[2 * n :][:k]), integers[2 * k : 3 * k],
        Room(floats[d + 3 * k :], integers[3 * k : 5 * k], masks[2 * n + k :][:k]),
    )  # fmt: skip
