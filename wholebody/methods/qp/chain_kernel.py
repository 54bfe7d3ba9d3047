"""Inverse kinematics of a chain of plain joints from many seeds, as compiled loops: see `chain`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.base.dense_kernel import copy, dot, gram, solve
from wholebody.methods.qp.chain_goals_kernel import (
    Chain,
    Goals,
    Room,
    evaluate,
    evaluate_others,
    rows_of,
    rows_of_others,
)
from wholebody.methods.qp.closed_form_kernel import BRANCHES, FULL, Arm, foreseen, sampled

CLEARLY, NEAR = 1.25, 0.3
"""An end of less than this many radians or metres away is left where it will take this many times another's effort."""
HARDLY = 1.6
"""A seed is left from which about this many times another's effort is expected."""


@compiled(inner=True, error_model="numpy")
def reach(
    chain: Chain, goals: Goals, room: Room, seeds: Array, nearest: Array, asked: Array, expected: Array, found: Array
) -> int:  # fmt: skip
    """Descend from seeds, one after the other, and minimise the effort where the goals are met.

    Args:
        chain: the joints.
        goals: what they are to reach.
        room: written.
        seeds: (k, n) where descents begin; each becomes where one ends.
        nearest: (2, n) posture of least effort, and weights of the effort ``sum w (q - nearest)^2``, or zeros.
        asked: (5,) norm of all errors at which the goals are met, metres and radians; damping of a step at the goals,
            squared; most steps; how many ends that meet the goals are enough; 1 where those that will clearly take more
            effort than others may be left.
        expected: (k,) effort that the descent from each seed will about lead to; 0 where nothing is known.
        found: (k, 4) written: norm of the errors at an end; its effort, inf where goals are not met; 1 if the effort is
            stationary there or not asked for, -1 where a descent was left for an end of less effort; steps.

    Returns:
        How many seeds were taken.
    """
    tolerance, most, enough = asked[0], int(asked[2]), asked[3]
    weighed, best, equal = False, np.inf, 0
    for weight in nearest[1]:
        weighed = weighed or weight > 0.0
    for one_sided in goals.one_sided:
        equal += 0 if one_sided else 1
    for r in range(len(room.value)):
        room.active[r] = True
    others = len(goals.plane_entries) + len(goals.mass_entries) > 0
    for k in range(len(seeds)):
        q = seeds[k]
        if weighed and asked[4] > 0.0 and expected[k] > HARDLY * best:
            found[k, 0], found[k, 1], found[k, 2], found[k, 3] = np.inf, np.inf, -1.0, 0.0
            enough -= 1.0
            if enough <= 0.0:
                return k + 1
            continue
        # Programs for the least effort remove the remaining errors too, where they have a way to go.
        done = 1e-3 * tolerance if weighed and len(q) > equal else 0.0
        steps = _descend(chain, goals, room, q, (tolerance, done), asked[1], most, others)
        left = np.sqrt(dot(room.value, room.value))
        found[k, 0], found[k, 1], found[k, 2], found[k, 3] = left, np.inf, 1.0, steps
        if not left <= tolerance:
            continue
        _unwind(chain, q, nearest[0])
        isolated = True
        if weighed:
            before = q.copy()
            asked_of = tolerance, CLEARLY * best if asked[4] > 0.0 else np.inf, others
            found[k, 3] += _least_effort(chain, goals, room, q, nearest, asked_of, found[k])
            for i in range(len(q) if len(q) == equal and asked[3] == 1.0 else 0):
                isolated = isolated and abs(q[i] - before[i]) < 0.1  # rad or m: only singular ends move farther
            if found[k, 2] == 0.0:
                copy(before, q)
        if found[k, 2] >= 0.0:
            found[k, 1] = 0.0
            for i in range(len(q)):
                found[k, 1] += nearest[1, i] * (q[i] - nearest[0, i]) ** 2
            best = min(best, found[k, 1])
        enough -= 1.0 if isolated else 0.0  # of singular ends a seed of less effort may lead to more
        if enough <= 0.0:
            return k + 1
    return len(seeds)


@compiled(inner=True, error_model="numpy")
def _descend(
    chain: Chain, goals: Goals, room: Room, q: Array, near: tuple[float, float], damping: float, most: int, others: bool
) -> int:  # fmt: skip
    """Steps of damped least squares until the goals' errors, `room.value`, are small as they get, or hardly fall.

    Sugihara 2011, "Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt Method", IEEE Transactions on
    Robotics 27(5): the damping is half of the squared error. `near`: norms at which goals are met, and steps end.
    """
    size, rows = len(q), len(room.value)
    right, system, dq, ones = np.empty(rows), np.empty((rows, rows)), np.empty(size), np.ones(size)
    scaled = np.empty((rows, size))
    before, marked, (tolerance, done) = np.inf, np.inf, near
    for count in range(most + 1):
        evaluate(chain, goals, room, q)
        if others:
            evaluate_others(chain, goals, room)
            _activate(goals, room)
            for r in range(rows):
                room.value[r] = room.value[r] if room.active[r] else 0.0
        left = np.sqrt(dot(room.value, room.value))
        if count == most or left <= done or (left <= tolerance and count and left > 0.5 * before):
            return count
        before = left
        if count % 4 == 0:
            # Given up: another seed gets there sooner. Where errors are small, a singular posture is near.
            if left > 0.6 * marked and left > 0.02:
                return count
            marked = left
        rows_of(chain, goals, room)
        if others:
            rows_of_others(chain, goals, room)
        for i in range(size):
            room.free[i], dq[i] = True, 0.0
        held = True
        while held:  # every round holds one more joint, so the loop ends
            damped = damping
            for r in range(rows):
                right[r] = -room.value[r]
                for i in range(size if room.active[r] else 0):
                    if not room.free[i]:
                        right[r] -= room.jacobian[r, i] * dq[i]
                damped += 0.5 * right[r] * right[r]
            _fill_normal(room, ones, damped, scaled, system, others)
            if not solve(system, right):
                return count
            for i in range(size):
                if room.free[i]:
                    dq[i] = 0.0
                    for r in range(rows):
                        dq[i] += room.jacobian[r, i] * right[r]
            held = _hold(chain, room.free, q, dq)
        _move(chain, q, dq, 1.0)
    return most


@compiled(inner=True, error_model="numpy")
def _least_effort(
    chain: Chain, goals: Goals, room: Room, q: Array, nearest: Array, asked: tuple[float, float, bool], found: Array
) -> int:  # fmt: skip
    """Step to the least effort among postures that meet the goals, by programs whose constraints are linear.

    Each step is exact for ``min sum w (q + d - nearest)^2`` with ``J d + e = 0`` and joints within limits, whose
    solution is ``d = p - W^-1 J' y`` with ``p = nearest - q`` and ``J W^-1 J' y = J p + e``. How far it goes along d
    is J. Barzilai and J. M. Borwein's step length ("Two-Point Step Size Gradient Methods", IMA Journal of Numerical
    Analysis 8, 1988), since the curvature of the constraints is left out of the programs. Sets ``found[0]`` to the
    norm of the errors, and ``found[2]`` to 1 where it converged, to -1 where the effort will clearly be more than
    ``asked[1]``, else to 0. ``asked[0]`` is the tolerance, ``asked[2]`` whether there are planes or a centre of mass.

    Returns:
        Steps taken.
    """
    size, rows = len(q), len(room.value)
    right, system, dq, shift = np.empty(rows), np.empty((rows, rows)), np.empty(size), np.empty(size)
    moved, before, share, wrong = np.zeros(size), np.zeros(size), 1.0, -1
    released, scaled, (tolerance, most, others) = np.empty(size, dtype=np.bool_), np.empty((rows, size)), asked
    let_go = np.empty(rows, dtype=np.bool_)  # rows that were
    found[2] = 0.0
    for count in range(40):
        evaluate(chain, goals, room, q)
        if others:
            evaluate_others(chain, goals, room)
            _activate(goals, room)
        left = 0.0
        for r in range(rows):
            left += room.value[r] ** 2 if room.active[r] else 0.0
            let_go[r] = False
        left = np.sqrt(left)
        rows_of(chain, goals, room)
        if others:
            rows_of_others(chain, goals, room)
        for i in range(size):
            room.free[i], released[i], shift[i] = True, False, nearest[0, i] - q[i]
        changed = True
        while changed:  # every round holds a joint or a row, or releases one for the first time
            for r in range(rows):
                right[r] = room.value[r] if room.active[r] else 0.0
                for i in range(size if room.active[r] else 0):
                    right[r] += room.jacobian[r, i] * (shift[i] if room.free[i] else dq[i])
            _fill_normal(room, nearest[1], 1e-12, scaled, system, others)
            if not solve(system, right):
                return count
            for i in range(size):
                if room.free[i]:
                    dq[i] = shift[i]
                    for r in range(rows):
                        dq[i] -= room.jacobian[r, i] * right[r] / nearest[1, i]
            changed = _hold_first(chain, room.free, q, dq)
            if not changed:
                row = _next_row(goals, room, dq, right) if others else -1
                changed = row >= 0 and not (room.active[row] and let_go[row])
                if changed:
                    let_go[row] = let_go[row] or room.active[row]
                    room.active[row] = not room.active[row]
                    continue
                wrong = _held_wrongly(chain, room, q, dq, nearest, right)
                changed = wrong >= 0 and not released[wrong]
                if changed:
                    room.free[wrong] = released[wrong] = True
                wrong = max(wrong, row)
        longest, effort = 0.0, 0.0
        for i in range(size):
            longest = max(longest, abs(dq[i]))
            effort += nearest[1, i] * (q[i] + dq[i] - nearest[0, i]) ** 2
        if longest < NEAR and effort > most:
            found[2] = -1.0
            return count
        if longest < 1e-5 and left <= tolerance:
            found[0], found[2] = left, 1.0 if wrong < 0 else 0.0
            return count
        if count:
            square, bent = 0.0, 0.0
            for i in range(size):
                square += moved[i] * moved[i]
                bent += moved[i] * (before[i] - dq[i])
            share = min(max(square / bent, 0.05), 3.0) if bent > 0.0 else 1.0
        share = min(share, 0.3 / longest) if longest > 0.0 else share
        for i in range(size):
            moved[i], before[i] = share * dq[i], dq[i]
        _move(chain, q, dq, share)
    return 40


@compiled(inner=True)
def _activate(goals: Goals, room: Room) -> None:
    """Count the rows of equalities, and those of inequalities that are not met."""
    for r in range(len(room.value)):
        room.active[r] = not goals.one_sided[r] or room.value[r] < 0.0


@compiled(inner=True)
def _next_row(goals: Goals, room: Room, dq: Array, multipliers: Array) -> int:
    """The inequality that a step violates most; else the one that the effort pulls most away from; -1 where none is."""
    worst, most, pulled, pull = -1, -1e-9, -1, 1e-6
    for r in range(len(room.value)):
        if room.active[r]:
            if goals.one_sided[r] and multipliers[r] > pull:
                pulled, pull = r, multipliers[r]
            continue
        value = room.value[r] + dot(room.jacobian[r], dq)
        if value < most:
            worst, most = r, value
    return worst if worst >= 0 else pulled


@compiled(inner=True, error_model="numpy")
def _fill_normal(room: Room, weights: Array, damping: float, scaled: Array, system: Array, others: bool) -> None:
    """The lower triangle of ``J W^-1 J' + damping`` (m, m) over the free joints, for weights (n,); `scaled` is room."""
    for r in range(len(system)):
        for i in range(len(weights)):
            scaled[r, i] = room.jacobian[r, i] / weights[i] if room.free[i] else 0.0
    gram(scaled, room.jacobian, len(system), system)
    for r in range(len(system)):
        system[r, r] += damping
    for r in range(len(system) if others else 0):
        if not room.active[r]:
            for s in range(len(system)):
                system[max(r, s), min(r, s)] = 1.0 if r == s else 0.0


@compiled(inner=True)
def _hold(chain: Chain, free: Mask, q: Array, dq: Array) -> bool:
    """Stop joints that would leave their limits there; whether there were any."""
    held = False
    for i in range(len(q)):
        if free[i] and not chain.lower[i] <= q[i] + dq[i] <= chain.upper[i]:
            dq[i] = min(max(dq[i], chain.lower[i] - q[i]), chain.upper[i] - q[i])
            free[i], held = False, True
    return held


@compiled(inner=True, error_model="numpy")
def _hold_first(chain: Chain, free: Mask, q: Array, dq: Array) -> bool:
    """Stop the joint that reaches its limit first on a step; whether there is one that would leave them."""
    first, share = -1, 1.0
    for i in range(len(q)):
        if free[i] and not chain.lower[i] <= q[i] + dq[i] <= chain.upper[i]:
            part = ((chain.upper[i] if dq[i] > 0.0 else chain.lower[i]) - q[i]) / dq[i]
            if first < 0 or part < share:
                first, share = i, part
    if first < 0:
        return False
    free[first] = False
    dq[first] = (chain.upper[first] if dq[first] > 0.0 else chain.lower[first]) - q[first]
    return True


@compiled(inner=True)
def _held_wrongly(chain: Chain, room: Room, q: Array, dq: Array, nearest: Array, multipliers: Array) -> int:
    """The held joint that the effort pulls most away from its limit; -1 where there is none."""
    worst, most = -1, 1e-6
    for i in range(len(q)):
        if not room.free[i] and chain.lower[i] < chain.upper[i]:  # a frozen one is held by no limit
            slope = nearest[1, i] * (q[i] + dq[i] - nearest[0, i])
            for r in range(len(multipliers)):
                slope += room.jacobian[r, i] * multipliers[r]
            pull = slope if q[i] + dq[i] > 0.5 * (chain.lower[i] + chain.upper[i]) else -slope
            if pull > most:
                worst, most = i, pull
    return worst


@compiled(inner=True)
def _move(chain: Chain, q: Array, dq: Array, share: float) -> None:
    for i in range(len(q)):
        q[i] = min(max(q[i] + share * dq[i], chain.lower[i]), chain.upper[i])


@compiled(inner=True)
def _unwind(chain: Chain, q: Array, nearest: Array) -> None:
    """Turn joints by whole turns to where they are nearest to a posture."""
    for i in range(len(q)):
        if chain.turns[i, 0] != 0.0 or chain.turns[i, 1] != 0.0 or chain.turns[i, 2] != 0.0:
            while q[i] - nearest[i] > np.pi and q[i] - FULL >= chain.lower[i]:
                q[i] -= FULL
            while nearest[i] - q[i] > np.pi and q[i] + FULL <= chain.upper[i]:
                q[i] += FULL


@compiled(error_model="numpy", nogil=True)
def reach_all(
    bodies: tuple[Chain, Arm, Room], asked: Array, goals: tuple[Array, Goals], samples: tuple[int, int],
    nearest: Array, ends: Array, found: Array, counts: Indices,
) -> None:  # fmt: skip
    """Do for each of k problems what `reach` does, from given seeds and then the branches of its closed form.

    Args:
        bodies: the joints; the arm that they are, without joints where it has no closed form; room, written.
        asked: (5,) as in `reach`.
        goals: floats (k, e, 36) of their places and rotations, and the goals of one, which has the other numbers.
        samples: how many of the joint that the closed form holds, and how many where none of these is within limits.
        nearest: (k, 2, n) as in `reach`.
        ends: (k, m, n) the given seeds; written: where descents end.
        found: (k, m, 4) written, as in `reach`.
        counts: (k,) of given seeds; written: of those that were taken, -1 for more than there is room for.
    """
    chain, arm, room = bodies
    (tables, alike), size, most, limits = goals, len(chain.lower), ends.shape[1], (chain.lower, chain.upper)
    branch, effort = np.empty((samples[1], BRANCHES, size)), np.empty((samples[1], BRANCHES))
    every = most + samples[1] * BRANCHES
    order, seeds = np.empty(samples[1] * BRANCHES, dtype=np.intp), np.empty((every, size))
    met, expected = np.empty((every, 4)), np.zeros(every)
    for p in range(len(tables)):
        one = Goals(
            tables[p], alike.entries, alike.axis_tables, alike.axis_entries, alike.plane_tables, alike.plane_entries,
            alike.mass_tables, alike.mass_entries, alike.bodies, alike.one_sided,
        )  # fmt: skip
        if not len(arm.joints):
            given = ends[p, : counts[p]]
            counts[p] = reach(chain, one, room, given, nearest[p], asked, expected, found[p])
            continue
        first, number = counts[p], 0
        for k in range(first):
            copy(ends[p, k], seeds[k])
            expected[k] = 0.0
        for v in samples:
            if number == 0:
                number = sampled(arm, tables[p, 0], limits, nearest[p], branch[:v], effort[:v], order)
                for k in range(number):
                    at, b = order[k] // BRANCHES, order[k] % BRANCHES
                    copy(branch[at, b], seeds[first + k])
                    expected[first + k] = foreseen(effort[:v], at, b)
        taken = reach(chain, one, room, seeds[: first + number], nearest[p], asked, expected, met)
        counts[p] = taken if taken <= most else -1
        for k in range(min(taken, most)):
            copy(seeds[k], ends[p, k])
            copy(met[k], found[p, k])
