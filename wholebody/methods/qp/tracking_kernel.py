"""A step of tracking in one compiled call, from the linearisation to the displacement: see `step_program`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.active_set_kernel import solve_growing, work_size
from wholebody.methods.qp.dense_kernel import dot
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.rows import Bodies, LinearRows, Rows, StepParts, StepState
from wholebody.methods.qp.settings import Corrections
from wholebody.methods.qp.subproblem_kernel import fill_program, sort_rows
from wholebody.methods.qp.turning_kernel import motion
from wholebody.terms.linearisation import PackedLinearisation


@compiled(error_model="numpy")
def solve(
    at: PackedLinearisation,
    state: StepState,
    pushed: Indices,
    bodies: Bodies,
    measures: bool,
    hot: bool,
    least_damping: float,
) -> tuple[bool, int, float, float, float, float, float, float, float, float]:
    """Sort the rows of a linearisation, build the program of a step and solve it from the last active set.

    Args:
        at: the linearisation.
        state: of the tracker; where the program is solved, its bounds become those that hold the answer, and `after`
            is written but for the posture.
        pushed: keys of the last program's elastic rows that pushed, in ascending order.
        bodies: what moves.
        measures: whether they count.
        hot: whether to solve the program, not only to build it.
        least_damping: of goals, where the last step does not ask for more.

    Returns:
        Whether the program is solved; how many elastic rows push; longest way and largest turn of the pieces; largest
        violation of an elastic row; least room that a contact row has after the step, and largest violation of an
        elastic row then; least clearance asked of a contact; the damping, and what the answer asks for.
    """
    given, numbers, held = state.terms, state.numbers, state.held
    n, goals, contacts = at.box.shape[1], len(given.share), len(at.contacts.number)
    equal, one_sided = 0, 0
    for c in range(len(given.kind)):
        equal += given.kind[c] == 0
        one_sided += (given.kind[c] == 3) * 2 + (given.kind[c] == 1) + (given.kind[c] == 2)
    m, terms = goals + equal, goals + len(given.kind)
    own = parts(state, n, goals, m, one_sided + len(at.gap), one_sided + contacts)
    rows, x = own.rows, own.x
    there = LinearRows(
        at.value[:goals], at.jacobian[:goals], at.value[goals:], at.jacobian[goals:terms], at.gap, at.jacobian[terms:],
        at.gap_contact, at.clearance, at.contacts.number,
    )  # fmt: skip
    sort_rows(there, given, rows)
    value, clearance, after, last, target = at.value, at.clearance, state.after, len(at.q), own.program.target
    soft, soft_error, elastic, violations, key = (
        rows.soft, rows.soft_error, rows.elastic, rows.elastic_violation, rows.key,
    )  # fmt: skip
    at_lower, at_upper = own.active.lower, own.active.upper
    error = 0.0
    for r in range(goals):
        error += value[r] * value[r]
    error = max(np.sqrt(error), 1e-12)
    damping = _run_ahead_of(state, at.q, rows, measures, error, least_damping, own.shift)
    numbers[3], numbers[5] = damping, measures
    fill_program(at.measure[0][:n], at.measure[1][:n], at.box, rows, own.shift, numbers[:11], own.program)
    least_asked, worst = np.inf, 0.0
    for c in range(contacts):
        least_asked = min(least_asked, clearance[c])
    for violated in violations:
        worst = max(worst, violated)
    for i in range(n):
        at_lower[i], at_upper[i] = held[0, i], held[1, i]
    rounds = -1
    if hot:
        limits = Corrections(
            numbers[11], int(numbers[12]), int(numbers[13]), int(numbers[14]), int(numbers[15]), numbers[16]
        )
        rounds = solve_growing(own.program, rows.key, pushed, own.active, limits, own.room, x)
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
    way, turn = motion(x, bodies)
    return True, count, way, turn, worst, spare, missed, least_asked, damping, asked


@compiled(inner=True, forceinline=True)
def _run_ahead_of(
    state: StepState, q: Array, rows: Rows, measures: bool, error: float, least_damping: float, shift: Array
) -> float:
    """Write what is added to the errors of the soft rows, as the last step was curved; returns the damping.

    `error` is the norm of the goals' errors.
    """
    before, damping, rest, curved = state.before, state.numbers[17], state.numbers[18], state.numbers[19]
    soft_error, goals = rows.soft_error, rows.goals
    last, m = len(q), len(soft_error)
    known = _is_known(before, q)
    for r in range(m):
        shift[r] = soft_error[r] - before[last + r] if known else 0.0
    for r in range(goals, m):  # what is held: a step much shorter than the last one is curved much less
        shift[r] = min(max(shift[r], -curved), curved)
    if not known:
        return least_damping
    # what a goal that rests is missed by, because the last step was curved; a goal that moves is not run ahead of
    resting = measures
    for r in range(goals):
        resting = resting and abs(shift[r]) < rest
    if not resting:
        shift[:goals] = 0.0
    own: float = damping * min(1.0, before[last + m] / error)
    return max(least_damping, own)


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
def run_ahead(curved: Array, rows: Rows, q: Array, moved: float, most: float, straight: float, before: Array) -> bool:
    """Write into `before` what makes the next program run ahead of what is held as a displacement curves it.

    Args:
        curved: (held,) by how much what is held ends elsewhere than its rows say.
        rows: of the last program.
        q: (nq,) the posture.
        moved: how much a goal that was not known has moved at least, so that it does not count as one that rests.
        most: how far it is run ahead at most.
        straight: see the answer.
        before: (nq + m + 2,) see `StepState`.

    Returns:
        Whether a row is to run ahead by more than `straight` farther, or less far, than it did.
    """
    last, goals, known = len(q), rows.goals, _is_known(before, q)
    if not known:  # its goals are asked for as without a step before
        for i in range(last):
            before[i] = q[i]
        for r in range(goals):
            before[last + r] = rows.soft_error[r] + moved
        before[-2], before[-1] = 0.0, 1.0
    largest = 0.0
    for r in range(goals, len(rows.soft_error)):
        foreseen = min(max(rows.soft_error[r] - before[last + r], -most), most) if known else 0.0
        bow = curved[r - goals]
        largest = max(largest, abs(min(max(bow, -most), most) - foreseen))
        before[last + r] = rows.soft_error[r] - bow
    return largest > straight


@compiled()
def floats_for(n: int, m: int, k: int) -> int:
    """Floats that `parts` lays out for n variables, m soft and k elastic rows."""
    return 5 * n + 4 * m + m * n + k * n + 3 * k + work_size(n, m, k)


@compiled(forceinline=True)
def parts(room: StepState, n: int, goals: int, m: int, k: int, contacts: int) -> StepParts:
    """The parts of the room for n variables, m soft rows, of which some are goals', and k elastic rows."""
    floats, integers, masks = room.floats, room.integers, room.masks
    a = 5 * n
    b = a + 4 * m
    c = b + m * n
    d = c + k * n
    soft, elastic = floats[b:c].reshape((m, n)), floats[c:d].reshape((k, n))
    weight, elastic_weight = floats[a + 3 * m : b], floats[d + 2 * k : d + 3 * k]
    rows = Rows(
        soft, floats[a + 2 * m : a + 3 * m], weight, goals, elastic, floats[d : d + k], integers[:k], contacts,
        integers[k : 2 * k], elastic_weight,
    )  # fmt: skip
    program = QuadraticProgram(
        floats[n : 2 * n], floats[2 * n : 3 * n], soft, floats[a : a + m], weight, elastic, floats[d + k : d + 2 * k],
        elastic_weight, floats[3 * n : 4 * n], floats[4 * n : a],
    )  # fmt: skip
    return StepParts(
        floats[:n], floats[a + m : a + 2 * m], rows, program,
        ActiveSet(masks[:n], masks[n : 2 * n], masks[2 * n :][:k]), integers[2 * k : 3 * k],
        Room(floats[d + 3 * k :], integers[3 * k : 5 * k], masks[2 * n + k :][:k]),
    )  # fmt: skip
