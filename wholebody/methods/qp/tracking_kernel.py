"""A step of tracking in one compiled call, from the linearisation to the displacement: see `step_program`."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import dot
from wholebody.methods.qp.active_set_kernel import grow
from wholebody.methods.qp.quadratic_program import (
    NUMBERS,
    ActiveSet,
    Bodies,
    LinearRows,
    PackedRows,
    QuadraticProgram,
    Room,
    Rows,
    StepParts,
    StepRoom,
    StepSize,
    Terms,
)
from wholebody.methods.qp.settings import Corrections, StepNumbers
from wholebody.methods.qp.subproblem_kernel import fill_program, fill_rows
from wholebody.methods.qp.turning_kernel import moved


@compiled(inner=True, forceinline=True)
def fixed_terms(fixed: Array, places: Indices, goals: int) -> Terms:
    """The terms among what does not change; see `solve`."""
    count, end = places[0], NUMBERS + goals
    bound = fixed[end : end + 2 * count].reshape((2, count))
    return Terms(places[1 : count + 1], bound, fixed[NUMBERS:end], fixed[18:23])


@compiled(inner=True, forceinline=True)
def fixed_bodies(fixed: Array, places: Indices, goals: int, columns: Array, placement: Array) -> Bodies:
    """The joints and pieces among what does not change, where they are; see `solve`."""
    wide, pieces, first = len(columns), len(placement), 1 + places[0]
    joints, own = places[first : len(places) - pieces], NUMBERS + goals + 2 * places[0]
    count, room = len(joints) - 2 * wide, own + pieces
    return Bodies(
        columns, joints[:wide], joints[wide : 2 * wide], joints[2 * wide :], places[len(places) - pieces :], placement,
        fixed[own:room], fixed[room : room + 18 * count].reshape((3, count, 6)),
    )  # fmt: skip


@compiled(error_model="numpy")
def solve(
    arrays: tuple[Any, ...], columns: Array, placement: Array, pushed: Indices, fixed: Array, places: Indices,
    buffers: tuple[Any, ...], hot: bool,
) -> tuple[bool, int, float, float, float, float, float, float, float, float]:  # fmt: skip
    """Sort the rows of a linearisation, build the program of a step and solve it from the last active set.

    What does not change comes in two arrays, and records come as tuples of their fields: a call from Python takes as
    long as 0.1 us for each array, and twice that for each of a record.

    Args:
        arrays: of the linearisation, see `PackedRows`.
        columns: of the joint Jacobian, see `Bodies`.
        placement: (p, 4, 3) of the pieces.
        pushed: keys of the elastic rows that pushed in the last program, in ascending order.
        fixed: `step_program.numbers_of`; weights of the goals, bounds of the constraints, reach of the pieces; room of
            `Bodies`; and two rows (nq + m + 2,) of what is remembered: where the last step ended, its posture, the
            errors of its soft rows there to first order, the residual of its goals, and 1 where there was such a step;
            the same of this step, but for the posture, where the program is solved.
        places: number and kinds of constraints, see `Terms`; place and joint of each column, parents of joints, and
            joints of pieces, see `Bodies`.
        buffers: room for the program, see `StepRoom`; the first masks are the bounds that held the last answer.
        hot: whether to solve the program, not only to build it.

    Returns:
        Whether the program is solved; how many elastic rows push; longest way and largest turn of the pieces; largest
        violation of an elastic row; least room that a contact row has after the step, and largest violation of an
        elastic row then; least clearance asked of a contact; the damping, and what the answer asks for.
    """
    at, room = PackedRows(*arrays), StepRoom(*buffers)
    value, jacobian, clearance, q = at.value, at.jacobian, at.clearance, at.q
    goals = len(value) - places[0]
    given = fixed_terms(fixed, places, goals)
    kind, n, contacts = given.kind, at.box.shape[1], len(at.number)
    equal, one_sided = 0, 0
    for c in range(len(kind)):
        equal += kind[c] == 0
        one_sided += (kind[c] == 3) * 2 + (kind[c] == 1) + (kind[c] == 2)
    m, terms, last = goals + equal, goals + len(kind), len(q)
    memory = fixed[len(fixed) - 2 * (last + m + 2) :].reshape((2, last + m + 2))
    before, after = memory[0], memory[1]
    size = StepSize(fixed[0], fixed[1], fixed[2], fixed[3] > 0.0, fixed[4])
    own = parts(room, n, goals, m, one_sided + len(at.gap), one_sided + contacts)
    rows, x = own.rows, own.x
    there = LinearRows(
        value[:goals], jacobian[:goals], value[goals:], jacobian[goals:terms], at.gap, jacobian[terms:], at.gap_contact,
        clearance, at.number,
    )  # fmt: skip
    fill_rows(there, given, rows)
    target, soft, soft_error, elastic, violations, key = (
        own.program.target, rows.soft, rows.soft_error, rows.elastic, rows.elastic_violation, rows.key,
    )  # fmt: skip
    error = 0.0
    for r in range(goals):
        error += value[r] * value[r]
    error = max(np.sqrt(error), 1e-12)
    damping = _run_ahead_of(before, q, rows, target, size, fixed[24:27], error)
    for i in range(n):
        own.columns[0, i], own.columns[1, i] = at.measure[1, i], at.measure[0, i]
        own.columns[2, i], own.columns[3, i] = at.box[0, i], at.box[1, i]
    damped = StepSize(size.radius, size.pull, damping, size.measures, size.gain)
    fill_program(own.columns, rows, target, own.program.least, damped, fixed[5:14], fixed[23])
    least_asked, worst = np.inf, 0.0
    for c in range(contacts):
        least_asked = min(least_asked, clearance[c])
    for violated in violations:
        worst = max(worst, violated)
    rounds = -1
    limits = Corrections(fixed[14], int(fixed[15]), int(fixed[16]), fixed[17])
    if hot:
        rounds = grow(own.program, rows.key, pushed, own.active, limits, own.room, x)
    if rounds < 0:
        return False, 0, 0.0, 0.0, worst, -np.inf, np.inf, least_asked, damping, 0.0
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
    asked = fixed[24] * min(1.0, left / error) if left > fixed[25] else 0.0
    length, turn = moved(x, fixed_bodies(fixed, places, goals, columns, placement))
    return True, count, length, turn, worst, spare, missed, least_asked, damping, asked


@compiled(inner=True, forceinline=True)
def _run_ahead_of(
    before: Array, q: Array, rows: Rows, shift: Array, size: StepSize, numbers: Array, error: float
) -> float:
    """Write what is added to the soft rows' errors, as the last step was curved; the damping. `error`: the goals'."""
    damping, rest, curved = numbers[0], numbers[1], numbers[2]
    soft_error, goals = rows.soft_error, rows.goals
    last, m = len(q), len(soft_error)
    known = _is_known(before, q)
    for r in range(m):
        shift[r] = soft_error[r] - before[last + r] if known else 0.0
    for r in range(goals, m):  # what is held: a step much shorter than the last one is curved much less
        shift[r] = min(max(shift[r], -curved), curved)
    if not known:
        return size.damping
    # what a goal that rests is missed by, because the last step was curved; a goal that moves is not run ahead of
    resting = size.measures
    for r in range(goals):
        resting = resting and abs(shift[r]) < rest
    if not resting:
        shift[:goals] = 0.0
    own: float = damping * min(1.0, before[last + m] / error)
    return max(size.damping, own)


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
def run_ahead(curved: Array, soft_error: Array, goals: int, q: Array, numbers: StepNumbers, before: Array) -> bool:
    """Write into `before` what the next program runs ahead by, from `curved` (held,); whether it is much."""
    most, moved = numbers.curved, 2.0 * numbers.resting  # a goal that was not known does not count as one that rests
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
    return largest > numbers.straight


@compiled(inner=True, forceinline=True)
def parts(room: StepRoom, n: int, goals: int, m: int, k: int, contacts: int) -> StepParts:
    """The parts of the room for n variables, m soft rows, of which some are goals', and k elastic rows."""
    floats, integers, masks = room.floats, room.integers, room.masks
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
        floats[:n], columns, rows, program,
        ActiveSet(masks[:n], masks[n : 2 * n], masks[2 * n :][:k]), integers[2 * k : 3 * k],
        Room(floats[d + 3 * k :], integers[3 * k : 5 * k], masks[2 * n + k :][:k]),
    )  # fmt: skip
