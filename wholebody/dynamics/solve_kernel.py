"""The program of contacts and joints, as compiled loops.

At every contact point, with u = J v (see `rows_kernel`), it finds

    0 <= p_n  complementary to  u_n - target >= 0                                                    (Signorini)
    p_t = -min(mu p_n, sticking) u_t / |u_t|                                                         (Coulomb)

and at every joint point u = hold, by Gauss and Seidel's method with projection: one point after the other, forwards and
backwards in turn, with the conjugate directions of Silcowitz, Niebe and Erleben (2010) between sweeps. Sweeps over all
points say which of them bear something, so which bodies bear each other; these islands are solved by themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.dynamics.rows_kernel import Rows, push

JOINT_PRECISION = 1e4  # joints are solved to the tolerance over this: they close in every step, contacts only may open
FAST = {"contract", "reassoc"}  # the order of sums is the compiler's, and the same in each run


class Laws(NamedTuple):
    """What a program asks of its points."""

    friction: Array  # (m - j,) coefficients of the contact points
    target: Array  # (m - j,) least u_n after it, m/s
    hold: Array  # (j, 3) u of the joint points after it, m/s


class Limits(NamedTuple):
    """Where a program ends: two sweeps, one each way, change no u by more than a tolerance [m/s]; or most sweeps."""

    tolerance: float
    sweeps: int


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _rates(c: int, rows: Rows, twist: Array) -> tuple[float, float, float]:
    """Velocities of B's point relative to A's along the three axes of a point."""
    one, two, three = 0.0, 0.0, 0.0
    a, b = rows.bodies[c, 0], rows.bodies[c, 1]
    for k in range(6):
        first, second = twist[a, k], twist[b, k]
        one += rows.jacobian[c, 0, k] * first + rows.jacobian[c, 0, 6 + k] * second
        two += rows.jacobian[c, 1, k] * first + rows.jacobian[c, 1, 6 + k] * second
        three += rows.jacobian[c, 2, k] * first + rows.jacobian[c, 2, 6 + k] * second
    return one, two, three


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _push(c: int, one: float, two: float, three: float, rows: Rows, twist: Array) -> None:
    """Change the velocities of A and B by an impulse along the three axes of a point."""
    a, b = rows.bodies[c, 0], rows.bodies[c, 1]
    for k in range(6):
        own = rows.response[c, 0, k] * one + rows.response[c, 1, k] * two
        twist[a, k] += own + rows.response[c, 2, k] * three
    for k in range(6, 12):
        own = rows.response[c, 0, k] * one + rows.response[c, 1, k] * two
        twist[b, k - 6] += own + rows.response[c, 2, k] * three


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _visit(c: int, rows: Rows, laws: Laws, twist: Array, impulse: Array) -> tuple[float, float, bool]:
    """Solve for one point: change of u (a joint's times `JOINT_PRECISION`), its impulse's squared, whether it bears."""
    if rows.mobility[c, 0] <= 0.0:
        return 0.0, 0.0, False
    normal, one, two = _rates(c, rows, twist)
    joint = c - len(laws.target)
    if joint >= 0:
        own = rows.effective_mass[joint]
        x, y, z = laws.hold[joint, 0] - normal, laws.hold[joint, 1] - one, laws.hold[joint, 2] - two
        p = own[0, 0] * x + own[0, 1] * y + own[0, 2] * z
        q = own[1, 0] * x + own[1, 1] * y + own[1, 2] * z
        r = own[2, 0] * x + own[2, 1] * y + own[2, 2] * z
        _push(c, p, q, r, rows, twist)
        impulse[c, 0] += p
        impulse[c, 1] += q
        impulse[c, 2] += r
        return JOINT_PRECISION * max(abs(x), abs(y), abs(z)), p * x + q * y + r * z, True
    each, side = rows.mobility[c, 0], rows.mobility[c, 1]
    open_by, before, first, second = normal - laws.target[c], impulse[c, 0], impulse[c, 1], impulse[c, 2]
    now = max(0.0, before - open_by / each)
    if now == 0.0 and before == 0.0 and first == 0.0 and second == 0.0:
        return 0.0, 0.0, open_by < 0.01  # m/s
    step = now - before
    one = first - (one + rows.mobility[c, 2] * step) / side
    two = second - (two + rows.mobility[c, 3] * step) / side
    most, size = laws.friction[c] * now, np.sqrt(one * one + two * two)
    if size > most:
        one, two = one * (most / size), two * (most / size)
    impulse[c, 0], impulse[c, 1], impulse[c, 2] = now, one, two
    one, two = one - first, two - second
    _push(c, step, one, two, rows, twist)
    change = max(abs(step) * each, max(abs(one), abs(two)) * side)
    return change, step * step * each + (one * one + two * two) * side, True


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def along_way(share: float, way: Array, impulse: Array, before: Array) -> tuple[float, float, float]:
    """Go on by a fraction of the displacement (3,) that an impulse (3,) has gone; by how much along each axis."""
    if share >= 1.0:
        way[0], way[1], way[2] = 0.0, 0.0, 0.0
        return 0.0, 0.0, 0.0
    one, two, three = share * way[0], share * way[1], share * way[2]
    for row in range(3):
        way[row] = share * way[row] + impulse[row] - before[row]
    impulse[0] += one
    impulse[1] += two
    impulse[2] += three
    return one, two, three


@compiled(error_model="numpy", fastmath=FAST)
def solve(chosen: Indices, rows: Rows, laws: Laws, twist: Array, impulse: Array, limits: Limits) -> int:
    """Solve the program of the points `chosen` (k,); how many sweeps it took.

    Points of joints come last, and are visited in this order in every sweep, which needs fewer of them. The velocities
    (n, 6), with the impulses at the start, and the impulses (m, 3) along n, t1, t2 [N s] change in place.
    """
    count = len(chosen)
    before, way = np.zeros((count, 3)), np.zeros((count, 3))
    last, contacts = np.inf, 0
    for c in chosen:
        contacts += c < len(laws.target)
    calm = 0  # sweeps that changed less than the tolerance; one is not enough: islands would be taken up again
    for sweep in range(limits.sweeps):
        change, square = 0.0, 0.0
        for number in range(count):
            place = number if sweep % 2 == 0 or number >= contacts else contacts - 1 - number
            c = chosen[place]
            for row in range(3):
                before[place, row] = impulse[c, row]
            largest, moved, _ = _visit(c, rows, laws, twist, impulse)
            change, square = max(change, largest), square + moved
        calm = calm + 1 if change < limits.tolerance else 0
        if calm == 2 or sweep == limits.sweeps - 1:
            return sweep + 1
        share, last = square / last, square
        for place in range(count):
            c = chosen[place]
            one, two, three = along_way(share, way[place], impulse[c], before[place])
            if one != 0.0 or two != 0.0 or three != 0.0:
                _push(c, one, two, three, rows, twist)
    return limits.sweeps


@compiled(error_model="numpy", fastmath=FAST)
def solve_islands(rows: Rows, laws: Laws, twist: Array, impulse: Array, limits: Limits) -> int:
    """Solve the program of all points, each island apart; the sweeps over all, for slow islands six times as many."""
    count, bodies = len(rows.bodies), len(twist)
    listed, changes = np.empty(count, dtype=np.intp), np.zeros(count)
    root, swept, sweeps = np.empty(bodies, dtype=np.intp), np.zeros(bodies, dtype=np.intp), 0
    part = Limits(0.5 * limits.tolerance, 16)  # with more sweeps islands that met are found later
    while True:
        change, bearing = 0.0, 0
        for c in range(count):
            changes[c], _, bears = _visit(c, rows, laws, twist, impulse)
            change = max(change, changes[c])
            if bears:
                listed[bearing] = c
                bearing += 1
        sweeps += 1
        if change < limits.tolerance:
            return sweeps
        join(listed[:bearing], rows.bodies, rows.movable, root)
        points, first, worst = _by_island(listed[:bearing], rows, root, changes)
        solved = True
        for island in range(bodies):
            rough = worst[island] >= 30.0 * limits.tolerance
            most = 6 * limits.sweeps if rough else limits.sweeps
            if worst[island] >= limits.tolerance and swept[island] < most:
                solved = False
                chosen = points[first[island] : first[island + 1]]
                swept[island] += solve(chosen, rows, laws, twist, impulse, part)
        if solved:
            return sweeps


@compiled(inner=True)
def _by_island(listed: Indices, rows: Rows, root: Indices, changes: Array) -> tuple[Indices, Indices, Array]:
    """The listed points, sorted by island; where each island (n,) begins among them; and its greatest change."""
    count = len(root)
    island = np.empty(len(listed), dtype=np.intp)
    first, worst = np.zeros(count + 1, dtype=np.intp), np.zeros(count)
    for number in range(len(listed)):
        c = listed[number]
        a, b = rows.bodies[c, 0], rows.bodies[c, 1]
        island[number] = root[a if rows.movable[a] else b]
        first[island[number] + 1] += 1
        worst[island[number]] = max(worst[island[number]], changes[c])
    for number in range(count):
        first[number + 1] += first[number]
    points, following = np.empty(len(listed), dtype=np.intp), first.copy()
    for number in range(len(listed)):
        points[following[island[number]]] = listed[number]
        following[island[number]] += 1
    return points, first, worst


@compiled()
def join(points: Indices, bodies: Indices, movable: Mask, root: Indices) -> None:
    """Write the least body of the island of each into `root`; islands do not reach through bodies not movable (n,)."""
    for body in range(len(root)):
        root[body] = body
    for c in points:
        a, b = bodies[c, 0], bodies[c, 1]
        if not movable[a] or not movable[b]:
            continue
        while root[a] != a:
            a = root[a]
        while root[b] != b:
            b = root[b]
        root[max(a, b)] = min(a, b)
    for body in range(len(root)):  # lesser bodies know theirs already
        root[body] = root[root[body]]


@compiled(error_model="numpy")
def residuals(rows: Rows, laws: Laws, twist: Array, impulse: Array) -> tuple[float, float]:
    """Largest violation of Signorini's law and of joints, and of Coulomb's law, both m/s: see `solve`."""
    signorini, coulomb = 0.0, 0.0
    for c in range(len(rows.bodies)):
        if rows.mobility[c, 0] <= 0.0:
            continue
        normal, one, two = _rates(c, rows, twist)
        joint = c - len(laws.target)
        if joint >= 0:
            hold = laws.hold[joint]
            signorini = max(signorini, abs(normal - hold[0]), abs(one - hold[1]), abs(two - hold[2]))
            continue
        each, side = rows.mobility[c, 0], rows.mobility[c, 1]
        signorini = max(signorini, abs(min(impulse[c, 0] * each, normal - laws.target[c])))
        one, two = impulse[c, 1] - one / side, impulse[c, 2] - two / side
        share = min(1.0, laws.friction[c] * impulse[c, 0] / max(np.sqrt(one * one + two * two), 1e-300))
        off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
        coulomb = max(coulomb, off * side)
    return signorini, coulomb


@compiled()
def solve_from(
    old: tuple[Indices, Array, Array],
    new: tuple[Indices, Array],
    rows: Rows,
    laws: Laws,
    twist: Array,
    impulse: Array,
    limits: Limits,
) -> tuple[float, float]:
    """Solve the program of all points from the impulses of the step before; returns the residuals."""
    impulse[: len(laws.target)] = 0.0
    warm_start(old, new, rows.axes, impulse)
    for c in range(len(impulse)):
        for row in range(3):
            if impulse[c, row] != 0.0:
                push(c, row, impulse[c, row], rows, twist)
    solve_islands(rows, laws, twist, impulse, limits)
    return residuals(rows, laws, twist, impulse)


@compiled()
def warm_start(old: tuple[Indices, Array, Array], new: tuple[Indices, Array], axes: Array, impulse: Array) -> None:
    """Write the impulses of the nearest old points (pair, place in the first body's axes, impulse) of a pair."""
    # Witness points jump from corner to corner: an old point nearest to none gives to the nearest within 0.01 m.
    pair, local, world = old
    new_pair, new_local = new
    most = -1
    for number in range(len(pair)):
        most = max(most, pair[number])
    for c in range(len(new_pair)):
        most = max(most, new_pair[c])
    head, following = np.full(most + 1, -1, dtype=np.intp), np.full(len(pair), -1, dtype=np.intp)
    new_head, new_following = np.full(most + 1, -1, dtype=np.intp), np.full(len(new_pair), -1, dtype=np.intp)
    for number in range(len(pair)):  # the points of each pair, as lists
        following[number] = head[pair[number]]
        head[pair[number]] = number
    for c in range(len(new_pair)):
        new_following[c] = new_head[new_pair[c]]
        new_head[new_pair[c]] = c
    used, none = np.zeros(len(pair), dtype=np.bool_), np.zeros(len(new_pair), dtype=np.bool_)
    for c in range(len(new_pair)):
        number = _nearest(head[new_pair[c]], following, local, new_local[c], used, 0.01)
        if number >= 0:
            used[number] = True
            _add(world[number], axes[c], impulse[c])
    for number in range(len(pair)):
        if not used[number]:
            c = _nearest(new_head[pair[number]], new_following, new_local, local[number], none, np.inf)
            if c >= 0:
                _add(world[number], axes[c], impulse[c])


@compiled(inner=True)
def _nearest(first: int, following: Indices, points: Array, at: Array, left_out: Mask, within: float) -> int:
    """The point of a list that is nearest to a place (3,), within a distance; -1 if there is none."""
    best, least, number = -1, within * within, first
    while number >= 0:
        if not left_out[number]:
            square = 0.0
            for k in range(3):
                square += (points[number, k] - at[k]) ** 2
            if square < least:
                best, least = number, square
        number = following[number]
    return best


@compiled(inner=True)
def _add(world: Array, axes: Array, impulse: Array) -> None:
    """Add an impulse (3,) in the world to one (3,) along axes; its normal part is not negative."""
    for row in range(3):
        for k in range(3):
            impulse[row] += axes[row, k] * world[k]
    impulse[0] = max(impulse[0], 0.0)
