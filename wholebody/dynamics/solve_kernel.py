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

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.dynamics.contact_kernel import join

JOINT_PRECISION = 1e4  # joints are solved to the tolerance over this: they close in every step, contacts only may open
NEAR_TARGET = 0.01  # m/s: points without impulse that are nearer to their target than this are visited in every sweep
FULL_SWEEP_PERIOD = 8  # sweeps over the points that bear something between sweeps over all
UNCONVERGED = 30.0  # tolerances: while a sweep changes more, visits are not counted as used up ...
EXTRA_VISITS = 6  # ... until they are so many times as many
ISLAND_SWEEPS = 16  # sweeps over an island between sweeps over all; more = islands that met are found later
FAST = {"contract", "reassoc"}  # the order of sums is the compiler's, and the same in each run


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _rates(c: int, bodies: Indices, rows: Array, twist: Array) -> tuple[float, float, float]:
    """Velocities of B's point relative to A's along the three axes of a point."""
    one, two, three = 0.0, 0.0, 0.0
    a, b = bodies[c, 0], bodies[c, 1]
    for k in range(6):
        first, second = twist[a, k], twist[b, k]
        one += rows[c, 0, k] * first + rows[c, 0, 6 + k] * second
        two += rows[c, 1, k] * first + rows[c, 1, 6 + k] * second
        three += rows[c, 2, k] * first + rows[c, 2, 6 + k] * second
    return one, two, three


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _push(
    c: int, bodies: Indices, responses: Array, one: float, two: float, three: float, twist: Array, impulse: Array
) -> None:
    """Add to the impulse of a point, and change the velocities of A and B by that."""
    a, b = bodies[c, 0], bodies[c, 1]
    for k in range(6):
        twist[a, k] += one * responses[c, 0, k] + two * responses[c, 1, k] + three * responses[c, 2, k]
    for k in range(6, 12):
        twist[b, k - 6] += one * responses[c, 0, k] + two * responses[c, 1, k] + three * responses[c, 2, k]
    impulse[c, 0] += one
    impulse[c, 1] += two
    impulse[c, 2] += three


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _visit(
    c: int,
    bodies: Indices,
    rows: Array,
    responses: Array,
    mobility: Array,
    across: Array,
    friction: Array,
    target: Array,
    twist: Array,
    impulse: Array,
) -> tuple[float, float, bool]:
    """Solve the program for one contact point alone; `across` (m, 2) are the rates along t1 and t2 by a normal impulse.

    Returns:
        The change of u, the square of that of the impulse, and whether the point bears or nearly bears something.
    """
    normal, one, two = _rates(c, bodies, rows, twist)
    each, open_by = mobility[c, 0], normal - target[c]
    before, first, second = impulse[c, 0], impulse[c, 1], impulse[c, 2]
    now = max(0.0, before - open_by / each)
    if now == 0.0 and before == 0.0 and first == 0.0 and second == 0.0:
        return 0.0, 0.0, open_by < NEAR_TARGET
    step, side = now - before, mobility[c, 1]
    one = first - (one + across[c, 0] * step) / side
    two = second - (two + across[c, 1] * step) / side
    most, size = friction[c] * now, np.sqrt(one * one + two * two)
    if size > most:
        one, two = one * (most / size), two * (most / size)
    one, two = one - first, two - second
    _push(c, bodies, responses, step, one, two, twist, impulse)
    impulse[c, 0] = now  # without rounding: none is less than zero
    change = max(abs(step) * each, max(abs(one), abs(two)) * side)
    return change, step * step * each + (one * one + two * two) * side, True


@compiled(inner=True, error_model="numpy", fastmath=FAST)
def _hold(
    first: int,
    chosen: Indices,
    bodies: Indices,
    rows: Array,
    responses: Array,
    mobility: Array,
    effective_mass: Array,
    hold: Array,
    twist: Array,
    impulse: Array,
    before: Array,
) -> tuple[float, float]:
    """Solve the three equations of each joint point alone, from the `first` of the chosen ones on; as `_visit`."""
    change, square = 0.0, 0.0
    for place in range(first, len(chosen)):
        c = chosen[place]
        if mobility[c, 0] <= 0.0:
            continue
        number = c - len(bodies) + len(effective_mass)
        one, two, three = _rates(c, bodies, rows, twist)
        one, two, three = hold[number, 0] - one, hold[number, 1] - two, hold[number, 2] - three
        own = effective_mass[number]
        p = own[0, 0] * one + own[0, 1] * two + own[0, 2] * three
        q = own[1, 0] * one + own[1, 1] * two + own[1, 2] * three
        r = own[2, 0] * one + own[2, 1] * two + own[2, 2] * three
        for row in range(3):
            before[place, row] = impulse[c, row]
        _push(c, bodies, responses, p, q, r, twist, impulse)
        change = max(change, abs(one), abs(two), abs(three))
        square += p * one + q * two + r * three
    return change, square


@compiled(error_model="numpy", fastmath=FAST)
def solve(
    chosen: Indices,
    bodies: Indices,
    jacobian: Array,
    response: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    effective_mass: Array,
    hold: Array,
    twist: Array,
    impulse: Array,
    tolerance: float,
    visits: int,
    most: int,
) -> int:
    """Solve the program of the points `chosen`; how many sweeps it took.

    Args:
        chosen: (k,) points of the program, in order; the last j of all m are those of joints.
        bodies: (m, 2).
        jacobian: (m, 3, 2, 6).
        response: (m, 3, 2, 6).
        mobility: (m, 2).
        friction: (m - j,) coefficients.
        target: (m - j,) least u_n after it, m/s.
        effective_mass: (j, 3, 3) impulses of a joint point by a unit velocity: inverses of its J M^-1 J^T.
        hold: (j, 3) u of the joint points after it, m/s.
        twist: (n, 6) velocities with the impulses at the start; changed in place.
        impulse: (m, 3) along n, t1, t2, N s; a start, changed in place.
        tolerance: a sweep over all that changes no u by more ends it, m/s.
        visits: of points, after which the next sweep over all ends it; `EXTRA_VISITS` times as many where impulses
            change much.
        most: sweeps, the last of which is always one of projection over all.
    """
    count, joints = len(chosen), len(bodies) - len(effective_mass)
    rows, responses = jacobian.reshape(len(bodies), 3, 12), response.reshape(len(bodies), 3, 12)
    before, way, across = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((joints, 2))
    contacts = 0
    for c in chosen:
        if c < joints:
            contacts += 1
            for k in range(12):
                across[c, 0] += rows[c, 1, k] * responses[c, 0, k]
                across[c, 1] += rows[c, 2, k] * responses[c, 0, k]
    listed = np.arange(count)
    bearing, last, full, left = 0, np.inf, True, visits
    for sweep in range(most):
        change, square = 0.0, 0.0
        size = contacts if full else bearing
        kept = 0
        for number in range(size):
            index = number if sweep % 2 == 0 else size - 1 - number
            place = index if full else listed[index]
            c = chosen[place]
            if mobility[c, 0] <= 0.0:
                continue
            for row in range(3):
                before[place, row] = impulse[c, row]
            largest, moved, bears = _visit(
                c, bodies, rows, responses, mobility, across, friction, target, twist, impulse
            )  # fmt: skip
            change, square = max(change, largest), square + moved
            if full and bears:
                listed[kept] = place
                kept += 1
            elif full:
                for row in range(3):
                    way[place, row] = 0.0
        if contacts < count:
            largest, moved = _hold(
                contacts, chosen, bodies, rows, responses, mobility, effective_mass, hold, twist, impulse, before
            )  # fmt: skip
            change, square = max(change, JOINT_PRECISION * largest), square + moved
        left -= size + count - contacts
        spent = left <= 0 and (change < UNCONVERGED * tolerance or left <= (1 - EXTRA_VISITS) * visits)
        if full:
            bearing = kept
            if sweep % 2 == 1:  # in the order of the points again
                for index in range(kept // 2):
                    other = kept - 1 - index
                    listed[index], listed[other] = listed[other], listed[index]
            if change < tolerance or sweep >= most - 1 or spent:
                return sweep + 1
        full = change < tolerance or spent or sweep >= most - 2 or sweep % FULL_SWEEP_PERIOD == FULL_SWEEP_PERIOD - 1
        share, last = square / last, square
        for index in range(bearing + count - contacts):
            place = listed[index] if index < bearing else contacts + index - bearing
            c = chosen[place]
            if share < 1.0:  # farther along the last way
                one, two, three = share * way[place, 0], share * way[place, 1], share * way[place, 2]
                way[place, 0] = one + impulse[c, 0] - before[place, 0]
                way[place, 1] = two + impulse[c, 1] - before[place, 1]
                way[place, 2] = three + impulse[c, 2] - before[place, 2]
                if one != 0.0 or two != 0.0 or three != 0.0:
                    _push(c, bodies, responses, one, two, three, twist, impulse)
            else:
                for row in range(3):
                    way[place, row] = 0.0
    return most


@compiled(error_model="numpy", fastmath=FAST)
def solve_islands(
    bodies: Indices,
    jacobian: Array,
    response: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    effective_mass: Array,
    hold: Array,
    twist: Array,
    impulse: Array,
    tolerance: float,
    visits: int,
    most: int,
) -> int:
    """Solve the program of all points, each island of bodies that bear each other apart; how many sweeps were over all.

    A sweep over all points says which of them bear something, so which bodies are islands, and which islands are not
    solved yet. Those are solved by themselves, until a sweep over all changes none by more than the tolerance.

    Args:
        bodies: (m, 2); all arrays and the tolerance are as in `solve`.
        jacobian: (m, 3, 2, 6).
        response: (m, 3, 2, 6).
        mobility: (m, 2).
        friction: (m - j,).
        target: (m - j,).
        effective_mass: (j, 3, 3).
        hold: (j, 3).
        twist: (n, 6).
        impulse: (m, 3).
        tolerance: m/s.
        visits: of all points; an island has as many sweeps as that allows them all, and `EXTRA_VISITS` times as many
            where impulses change much.
        most: sweeps over an island.
    """
    count, joints = len(bodies), len(bodies) - len(effective_mass)
    rows, responses = jacobian.reshape(count, 3, 12), response.reshape(count, 3, 12)
    across, before, everything = np.zeros((joints, 2)), np.zeros((count, 3)), np.arange(count)
    movable = np.zeros(len(twist), dtype=np.bool_)
    for c in range(count):
        for side in range(2):
            movable[bodies[c, side]] |= responses[c, 0, 6 * side] != 0.0 or responses[c, 1, 6 * side] != 0.0
            movable[bodies[c, side]] |= responses[c, 2, 6 * side] != 0.0
        if c < joints:
            for k in range(12):
                across[c, 0] += rows[c, 1, k] * responses[c, 0, k]
                across[c, 1] += rows[c, 2, k] * responses[c, 0, k]
    usual = min(most, visits // max(count, 1) + 1)
    listed, points = np.empty(count, dtype=np.intp), np.empty(count, dtype=np.intp)
    changes, worst = np.zeros(count), np.zeros(len(twist))
    root, first = np.empty(len(twist), dtype=np.intp), np.empty(len(twist) + 1, dtype=np.intp)
    swept, sweeps = np.zeros(len(twist), dtype=np.intp), 0
    while True:
        change, bearing = 0.0, 0
        for c in range(joints):
            if mobility[c, 0] <= 0.0:
                continue
            changes[c], _, bears = _visit(
                c, bodies, rows, responses, mobility, across, friction, target, twist, impulse
            )  # fmt: skip
            change = max(change, changes[c])
            if bears:
                listed[bearing] = c
                bearing += 1
        for c in range(joints, count):
            if mobility[c, 0] <= 0.0:
                continue
            largest, _ = _hold(
                c, everything[: c + 1], bodies, rows, responses, mobility, effective_mass, hold, twist, impulse, before
            )  # fmt: skip
            changes[c] = JOINT_PRECISION * largest
            change = max(change, changes[c])
            listed[bearing] = c
            bearing += 1
        sweeps += 1
        if change < tolerance:
            return sweeps
        join(listed[:bearing], bodies, movable, root)
        first[:] = 0
        worst[:] = 0.0
        for c in listed[:bearing]:
            island = root[bodies[c, 0] if movable[bodies[c, 0]] else bodies[c, 1]]
            first[island + 1] += 1
            worst[island] = max(worst[island], changes[c])
        for island in range(len(twist)):
            first[island + 1] += first[island]
        for c in listed[:bearing]:  # in their order within each island; `first` becomes the end of each
            island = root[bodies[c, 0] if movable[bodies[c, 0]] else bodies[c, 1]]
            points[first[island]] = c
            first[island] += 1
        solved = True
        for island in range(len(twist)):
            start = first[island - 1] if island > 0 else 0
            if worst[island] < tolerance or swept[island] >= min(most, EXTRA_VISITS * usual):
                continue
            if swept[island] >= usual and worst[island] < UNCONVERGED * tolerance:
                continue
            solved = False
            swept[island] += solve(
                points[start : first[island]], bodies, jacobian, response, mobility, friction, target, effective_mass,
                hold, twist, impulse, 0.5 * tolerance, ISLAND_SWEEPS * count, ISLAND_SWEEPS,
            )  # fmt: skip
        if solved:
            return sweeps


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
    rows = jacobian.reshape(len(bodies), 3, 12)
    for c in range(len(bodies)):
        if mobility[c, 0] <= 0.0:
            continue
        normal, one, two = _rates(c, bodies, rows, twist)
        if c >= joints:
            number = c - joints
            off = max(abs(normal - hold[number, 0]), abs(one - hold[number, 1]), abs(two - hold[number, 2]))
            signorini = max(signorini, off)
            continue
        signorini = max(signorini, abs(min(impulse[c, 0] * mobility[c, 0], normal - target[c])))
        one, two = impulse[c, 1] - one / mobility[c, 1], impulse[c, 2] - two / mobility[c, 1]
        share = min(1.0, friction[c] * impulse[c, 0] / max(np.sqrt(one * one + two * two), 1e-300))
        off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
        coulomb = max(coulomb, off * mobility[c, 1])
    return signorini, coulomb
