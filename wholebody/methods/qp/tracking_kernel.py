"""A step of tracking in one compiled call, from the linearisation to the displacement: see `step_program`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.active_set_kernel import solve_growing, work_size
from wholebody.methods.qp.dense_kernel import dot
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Room
from wholebody.methods.qp.rows import (
    Bodies,
    ContactRows,
    Guess,
    Past,
    Rows,
    StepNumbers,
    StepParts,
    StepRequest,
    StepRoom,
    StepSize,
    TermRows,
    Terms,
)
from wholebody.methods.qp.subproblem_kernel import fill_program, sort_rows
from wholebody.methods.qp.turning_kernel import motion
from wholebody.terms.linearisation import PackedLinearisation


@compiled(error_model="numpy")
def solve(
    at: PackedLinearisation,
    given: Terms,
    past: Past,
    guess: Guess,
    bodies: Bodies,
    room: StepRoom,
    numbers: StepNumbers,
    request: StepRequest,
) -> tuple[bool, int, float, float, float, float, float, float, float, float]:
    """Sort the rows of a linearisation, build the program of a step and solve it from the last active set.

    Args:
        at: the linearisation.
        given: the terms' rows.
        past: where the last step ended; where this one does to first order, but for the posture, is written if solved.
        guess: what held the last program's answer; its bounds become those that hold this one's where it is solved.
        bodies: what moves.
        room: which `parts` lays out.
        numbers: of the programs.
        request: what is asked of this one.

    Returns:
        Whether the program is solved; how many elastic rows push; longest way and largest turn of the pieces; largest
        violation of an elastic row; least room that a contact row has after the step, and largest violation of an
        elastic row then; least clearance asked of a contact; the damping, and what the answer asks for.
    """
    n, goals, contacts = at.box.shape[1], len(given.share), len(at.contacts.number)
    equal, one_sided = 0, 0
    for c in range(len(given.kind)):
        equal += given.kind[c] == 0
        one_sided += (given.kind[c] == 3) * 2 + (given.kind[c] == 1) + (given.kind[c] == 2)
    m, terms = goals + equal, goals + len(given.kind)
    own = parts(room, n, goals, m, one_sided + len(at.gap), one_sided + contacts)
    rows, x = own.rows, own.x
    sort_rows(
        TermRows(at.value[:goals], at.jacobian[:goals], at.value[goals:], at.jacobian[goals:terms]),
        ContactRows(at.gap, at.jacobian[terms:], at.gap_contact, at.clearance, at.contacts.number),
        given,
        numbers.weights,
        rows,
    )
    error = 0.0
    for r in range(goals):
        error += at.value[r] * at.value[r]
    error = max(np.sqrt(error), 1e-12)
    damping = _run_ahead_of(past, at.q, rows, numbers, request, error, own.shift)
    size = numbers.size
    step = StepSize(
        size.scale, size.radius, size.pull, damping, size.gain, request.measures, size.box, size.overlap,
        size.least_curvature, size.proximal, size.lever,
    )  # fmt: skip
    fill_program(at.measure[0][:n], at.measure[1][:n], at.box, rows, own.shift, step, own.program)
    least_asked, worst = np.inf, 0.0
    for c in range(contacts):
        least_asked = min(least_asked, at.clearance[c])
    for violated in rows.elastic_violation:
        worst = max(worst, violated)
    for i in range(n):
        own.active.lower[i], own.active.upper[i] = guess.held[0, i], guess.held[1, i]
    rounds = -1
    if request.hot:
        rounds = solve_growing(own.program, rows.key, guess.pushed, own.active, numbers.limits, own.room, x)
    if rounds < 0:
        return False, 0, 0.0, 0.0, worst, -np.inf, np.inf, least_asked, damping, 0.0
    for i in range(n):
        guess.held[0, i], guess.held[1, i] = own.active.lower[i], own.active.upper[i]
    count = _sorted_keys(rows.key, own.active.elastic, own.pushing)
    left = 0.0
    for r in range(m):
        gone = dot(rows.soft[r], x)
        past.after[len(at.q) + r] = rows.soft_error[r] + gone
        if r < goals:
            left += (gone - own.program.target[r]) ** 2
    left = np.sqrt(left)
    past.after[-2], past.after[-1] = left, 1.0
    spare, missed = np.inf, 0.0
    for j in range(len(rows.key)):
        ahead = dot(rows.elastic[j], x) - rows.elastic_violation[j]
        missed = max(missed, -ahead)
        if j >= one_sided:
            spare = min(spare, ahead)
    asked = numbers.damping * min(1.0, left / error) if left > numbers.resting else 0.0
    way, turn = motion(x, bodies)
    return True, count, way, turn, worst, spare, missed, least_asked, damping, asked


@compiled(inner=True)
def _run_ahead_of(
    past: Past, q: Array, rows: Rows, numbers: StepNumbers, request: StepRequest, error: float, shift: Array
) -> float:
    """Write what is added to the errors of the soft rows, as the last step was curved; returns the damping.

    `error` is the norm of the goals' errors.
    """
    last, m, goals = len(q), len(rows.soft_error), rows.goals
    known = _is_known(past.before, q)
    for r in range(m):
        shift[r] = rows.soft_error[r] - past.before[last + r] if known else 0.0
    for r in range(goals, m):  # what is held: a step much shorter than the last one is curved much less
        shift[r] = min(max(shift[r], -numbers.curved), numbers.curved)
    if not known:
        return request.least_damping
    # what a goal that rests is missed by, because the last step was curved; a goal that moves is not run ahead of
    resting = request.measures
    for r in range(goals):
        resting = resting and abs(shift[r]) < numbers.resting
    if not resting:
        shift[:goals] = 0.0
    return max(request.least_damping, numbers.damping * min(1.0, float(past.before[last + m]) / error))


@compiled(inner=True)
def _is_known(before: Array, q: Array) -> bool:
    """Whether the last step ended at the posture q (nq,)."""
    known: bool = before[-1] > 0.0
    for i in range(len(q)):
        known = known and before[i] == q[i]
    return known


@compiled(inner=True)
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
        before: (nq + m + 2,) see `Past`.

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


@compiled()
def parts(room: StepRoom, n: int, goals: int, m: int, k: int, contacts: int) -> StepParts:
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
