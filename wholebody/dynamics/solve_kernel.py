"""The joint program of all contacts and joints, as compiled loops.

At every contact point, with u = J v (see `contact_kernel`), it finds

    0 <= p_n  complementary to  u_n - target >= 0                                                    (Signorini)
    p_t = -min(mu p_n, sticking) u_t / |u_t|                                                         (Coulomb)

and at every joint point u = hold, by Gauss and Seidel's method with projection, one point after the other, forwards and
backwards in turn, with the conjugate directions of Silcowitz, Niebe and Erleben (2010) between sweeps. Most points bear
nothing: sweeps over those that do follow a sweep over all.
"""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Indices
from wholebody.compiled import compiled

EXACTER = 1e4  # joints are solved to the tolerance over this: they close in every step, contacts only may open
NEARLY = 0.01  # m/s: points without impulse that are nearer to their target than this are visited in every sweep
EVERY = 8  # sweeps over the points that bear something between sweeps over all
FAST = {"contract", "reassoc"}  # the order of sums is the compiler's, and the same in each run


@compiled(error_model="numpy", fastmath=FAST)
def _rate(rows: Array, c: int, row: int, v: Array) -> float:
    """Relative velocity along an axis of a point, from the velocities (12,) of A and B."""
    total = 0.0
    for k in range(12):
        total += rows[c, row, k] * v[k]
    return total


@compiled(error_model="numpy", fastmath=FAST)
def _push(answers: Array, c: int, row: int, step: float, v: Array) -> None:
    """Change the velocities (12,) of A and B by an impulse along an axis of a point."""
    for k in range(12):
        v[k] += step * answers[c, row, k]


@compiled(error_model="numpy", fastmath=FAST)
def _visit(
    c: int,
    rows: Array,
    answers: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    impulse: Array,
    v: Array,
) -> tuple[float, float, bool]:
    """Solve the program for one contact point alone.

    Returns:
        The change of u, the square of that of the impulse, and whether the point bears or nearly bears something.
    """
    each = mobility[c, 0]
    open_by = _rate(rows, c, 0, v) - target[c]
    now = max(0.0, impulse[c, 0] - open_by / each)
    if now == 0.0 and impulse[c, 0] == 0.0 and impulse[c, 1] == 0.0 and impulse[c, 2] == 0.0:
        return 0.0, 0.0, open_by < NEARLY
    step = now - impulse[c, 0]
    _push(answers, c, 0, step, v)
    impulse[c, 0] = now
    change, square = abs(step) * each, step * step * each
    most = friction[c] * now
    if most == 0.0 and impulse[c, 1] == 0.0 and impulse[c, 2] == 0.0:
        return change, square, True
    each = mobility[c, 1]
    one = impulse[c, 1] - _rate(rows, c, 1, v) / each
    two = impulse[c, 2] - _rate(rows, c, 2, v) / each
    size = np.sqrt(one * one + two * two)
    if size > most:
        share = most / size
        one, two = share * one, share * two
    step = one - impulse[c, 1]
    other = two - impulse[c, 2]
    _push(answers, c, 1, step, v)
    _push(answers, c, 2, other, v)
    impulse[c, 1], impulse[c, 2] = one, two
    change = max(change, max(abs(step), abs(other)) * each)
    return change, square + (step * step + other * other) * each, True


@compiled(error_model="numpy", fastmath=FAST)
def _hold(
    c: int, number: int, rows: Array, answers: Array, held: Array, hold: Array, impulse: Array, v: Array
) -> tuple[float, float]:
    """Solve the three equations of one joint point; the change of u, and the square of that of the impulse."""
    change, square = 0.0, 0.0
    one = hold[number, 0] - _rate(rows, c, 0, v)
    two = hold[number, 1] - _rate(rows, c, 1, v)
    three = hold[number, 2] - _rate(rows, c, 2, v)
    for row in range(3):
        step = held[number, row, 0] * one + held[number, row, 1] * two + held[number, row, 2] * three
        off = one if row == 0 else (two if row == 1 else three)
        _push(answers, c, row, step, v)
        impulse[c, row] += step
        change, square = max(change, abs(off)), square + step * off
    return change, square


@compiled(error_model="numpy", fastmath=FAST)
def solve(
    chosen: Indices,
    bodies: Indices,
    jacobian: Array,
    answer: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    held: Array,
    hold: Array,
    twist: Array,
    impulse: Array,
    tolerance: float,
    visits: int,
    most: int,
) -> int:
    """Solve the program of the points `chosen`; how many sweeps it took.

    Args:
        chosen: (k,) points of the program; the last j of all m are those of joints.
        bodies: (m, 2).
        jacobian: (m, 3, 2, 6).
        answer: (m, 3, 2, 6).
        mobility: (m, 2).
        friction: (m - j,) coefficients.
        target: (m - j,) least u_n after it, m/s.
        held: (j, 3, 3) impulses of a joint point by a unit velocity: inverses of its J M^-1 J^T.
        hold: (j, 3) u of the joint points after it, m/s.
        twist: (n, 6) velocities with the impulses at the start; changed in place.
        impulse: (m, 3) along n, t1, t2, N s; a start, changed in place.
        tolerance: a sweep over all that changes no u by more ends it, m/s.
        visits: of points, after which the next sweep over all ends it.
        most: sweeps, the last of which is always one of projection over all.
    """
    count, joints = len(chosen), len(bodies) - len(held)
    rows, answers = jacobian.reshape(len(bodies), 3, 12), answer.reshape(len(bodies), 3, 12)
    before, way = np.zeros((count, 3)), np.zeros((count, 3))
    listed, v = np.arange(count), np.empty(12)
    bearing, last, full, left = 0, np.inf, True, visits
    for sweep in range(most):
        change, square = 0.0, 0.0
        size = count if full else bearing
        kept = 0
        for number in range(size):
            index = number if sweep % 2 == 0 else size - 1 - number
            place = index if full else listed[index]
            c = chosen[place]
            if mobility[c, 0] <= 0.0:
                continue
            for row in range(3):
                before[place, row] = impulse[c, row]
            a, b = bodies[c, 0], bodies[c, 1]
            for k in range(6):
                v[k], v[6 + k] = twist[a, k], twist[b, k]
            if c >= joints:
                largest, moved = _hold(c, c - joints, rows, answers, held, hold, impulse, v)
                largest, bears = EXACTER * largest, True
            else:
                largest, moved, bears = _visit(c, rows, answers, mobility, friction, target, impulse, v)
            if moved > 0.0:
                for k in range(6):  # where A is B, a joint to the world, the row of A is zero
                    twist[a, k] = v[k]
                for k in range(6):
                    twist[b, k] = v[6 + k]
                change, square = max(change, largest), square + moved
            if full and bears:
                listed[kept] = place
                kept += 1
            elif full:
                for row in range(3):
                    way[place, row] = 0.0
        left -= size
        if full:
            bearing = kept
            if sweep % 2 == 1:  # in the order of the points again
                for index in range(kept // 2):
                    other = kept - 1 - index
                    listed[index], listed[other] = listed[other], listed[index]
            if change < tolerance or sweep >= most - 1 or left <= 0:
                return sweep + 1
        full = change < tolerance or left <= 0 or sweep >= most - 2 or sweep % EVERY == EVERY - 1
        share, last = square / last, square
        for index in range(bearing):
            place = listed[index]
            c = chosen[place]
            if share < 1.0:
                _go_on(c, place, bodies, answers, share, before, way, twist, impulse, v)
            else:
                for row in range(3):
                    way[place, row] = 0.0
    return most


@compiled(error_model="numpy", fastmath=FAST)
def _go_on(
    c: int,
    place: int,
    bodies: Indices,
    answers: Array,
    share: float,
    before: Array,
    way: Array,
    twist: Array,
    impulse: Array,
    v: Array,
) -> None:
    """Go farther along the last way of a point's impulse, by a share of it."""
    any_way = False
    for row in range(3):
        v[row] = share * way[place, row]
        way[place, row] = v[row] + impulse[c, row] - before[place, row]
        any_way = any_way or v[row] != 0.0
    if not any_way:
        return
    a, b = bodies[c, 0], bodies[c, 1]
    for row in range(3):
        step = v[row]
        impulse[c, row] += step
        for k in range(6):
            twist[a, k] += step * answers[c, row, k]
        for k in range(6):
            twist[b, k] += step * answers[c, row, 6 + k]


@compiled(error_model="numpy")
def residuals(
    bodies: Indices,
    jacobian: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    hold: Array,
    twist: Array,
    impulse: Array,
) -> tuple[float, float]:
    """Largest violation of Signorini's law and of joints, and of Coulomb's law, both m/s: see `solve`."""
    signorini, coulomb = 0.0, 0.0
    joints = len(bodies) - len(hold)
    rows, v = jacobian.reshape(len(bodies), 3, 12), np.empty(12)
    for c in range(len(bodies)):
        if mobility[c, 0] <= 0.0:
            continue
        for k in range(6):
            v[k], v[6 + k] = twist[bodies[c, 0], k], twist[bodies[c, 1], k]
        if c >= joints:
            for row in range(3):
                signorini = max(signorini, abs(_rate(rows, c, row, v) - hold[c - joints, row]))
            continue
        open_by = _rate(rows, c, 0, v) - target[c]
        signorini = max(signorini, abs(min(impulse[c, 0] * mobility[c, 0], open_by)))
        one = impulse[c, 1] - _rate(rows, c, 1, v) / mobility[c, 1]
        two = impulse[c, 2] - _rate(rows, c, 2, v) / mobility[c, 1]
        size = np.sqrt(one * one + two * two)
        share = min(1.0, friction[c] * impulse[c, 0] / max(size, 1e-300))
        off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
        coulomb = max(coulomb, off * mobility[c, 1])
    return signorini, coulomb
