"""Semismooth Newton steps on the program of contacts with friction, as compiled loops.

At a point with impulse p and velocity u the laws of contact are the projection (Alart and Curnier 1991)

    p_n = max(0, z_n),  z_n = p_n + (target - u_n) / M_nn;    p_t = z_t min(1, mu p_n / |z_t|),  z_t = p_t - u_t / M_tt

with M the mobility, so a point is open, sticks or slides. A step solves the linear equations of what these are: u_n is
the target where a point bears, u_t is zero where it sticks, p_t is mu p_n along z_t where it slides, and beside that
direction its derivative. Points that bear one body are more than it has freedoms, so a small part of the mobility holds
each impulse where it is.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled

STEPS = 8  # most
PART = 1e-2  # of the mobility, that holds impulses at first: less strays more; each better step takes a tenth of it
LEAST = 1e-4  # least of it: with less, impulses that cancel each other in what is squeezed grow, and bring energy
GROWTH = 2.0  # most by which all normal impulses together may grow, for the same reason
STRAY = 1e3  # as often as violated as the best before it, a step is taken back


@compiled(error_model="numpy")
def violation(mobility: Array, velocity: Array, friction: Array, target: Array, impulse: Array) -> float:
    """Most by which a velocity (3 m,) with the impulses (m, 3) is off the laws of contact, m/s."""
    worst = 0.0
    for c in range(len(friction)):
        row = 3 * c
        own = mobility[row, row]
        if own <= 1e-12:
            continue
        now = max(0.0, impulse[c, 0] + (target[c] - velocity[row]) / own)
        worst = max(worst, abs(now - impulse[c, 0]) * own)
        side = side_mobility(mobility, row)
        if side > 1e-12:
            one, two = impulse[c, 1] - velocity[row + 1] / side, impulse[c, 2] - velocity[row + 2] / side
            share = min(1.0, friction[c] * now / max(np.sqrt(one * one + two * two), 1e-300))
            off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
            worst = max(worst, off * side)
    return worst


@compiled(error_model="numpy", inline="always")
def side_mobility(mobility: Array, row: int) -> float:
    """A bound of the mobility of a point along any tangent; `row` is that of its normal."""
    one, two, both = mobility[row + 1, row + 1], mobility[row + 2, row + 2], mobility[row + 1, row + 2]
    return float(max(one, two) + abs(both))


@compiled(error_model="numpy")
def newton(mobility: Array, rest: Array, friction: Array, target: Array, impulse: Array, enough: float) -> float:
    """Change impulses (m, 3) to those of the step that is least off the laws; by how much that is, m/s.

    `rest` (3 m,) are the velocities without impulses, m/s; it ends where they are off by less than `enough` [m/s].
    """
    size, part = len(rest), PART
    now, best, velocity = impulse.copy(), impulse.copy(), np.empty(size)
    least, most = np.inf, 0.0
    for step in range(STEPS + 1):
        pressed = 0.0
        for c in range(len(friction)):
            pressed += abs(now[c, 0])
        most = GROWTH * pressed if step == 0 else most
        for k in range(size):
            total = rest[k]
            for c in range(len(friction)):
                for row in range(3):
                    total += mobility[k, 3 * c + row] * now[c, row]
            velocity[k] = total
        off = violation(mobility, velocity, friction, target, now)
        if off < least and pressed <= most:
            least, part = off, part if step == 0 else max(0.1 * part, LEAST)
            _copy(now, best)
        elif not (off < STRAY * least and pressed <= most):
            part = min(10.0 * part, 1.0)
            _copy(best, now)
            continue
        if least < enough or step == STEPS or not _step(mobility, (rest, velocity), friction, target, now, part):
            break
    _copy(best, impulse)
    return least


@compiled(inner=True)
def _copy(source: Array, target: Array) -> None:
    for c in range(len(source)):
        for row in range(3):
            target[c, row] = source[c, row]


@compiled(inner=True, error_model="numpy")
def _step(
    mobility: Array, velocities: tuple[Array, Array], friction: Array, target: Array, impulse: Array, part: float
) -> bool:
    """Change impulses (m, 3) by one step; false where its equations are singular."""
    # `along` (k, 3): what an unknown is of the impulse of its point; `across`: what its equation is of the velocity
    rest, velocity = velocities
    most = len(rest)
    point, along, across = np.empty(most, np.intp), np.zeros((most, 3)), np.zeros((most, 3))
    diagonal, right, count = np.empty(most), np.empty(most), 0
    for c in range(len(friction)):
        row = 3 * c
        own, side = mobility[row, row], side_mobility(mobility, row)
        normal = impulse[c, 0] + (target[c] - velocity[row]) / own if own > 1e-12 else 0.0
        if normal <= 0.0:
            continue
        point[count], along[count, 0], across[count, 0] = c, 1.0, 1.0
        diagonal[count], right[count] = part * own, target[c] - rest[row] + part * own * impulse[c, 0]
        count += 1
        if friction[c] <= 0.0 or side <= 1e-12:
            continue
        one, two = impulse[c, 1] - velocity[row + 1] / side, impulse[c, 2] - velocity[row + 2] / side
        size, bound = np.sqrt(one * one + two * two), friction[c] * normal
        if size > bound:  # it slides
            one, two = one / size, two / size
            along[count - 1, 1], along[count - 1, 2] = friction[c] * one, friction[c] * two
            share = max(bound / size, 1e-6)
            for vector in (along, across):
                vector[count, 1], vector[count, 2] = -two, one
            point[count], diagonal[count] = c, side * ((1.0 - share) / share + part)
            right[count] = two * rest[row + 1] - one * rest[row + 2]
            right[count] += part * side * (one * impulse[c, 2] - two * impulse[c, 1])
            count += 1
        else:
            for k in (1, 2):
                point[count], along[count, k], across[count, k] = c, 1.0, 1.0
                diagonal[count], right[count] = part * side, part * side * impulse[c, k] - rest[row + k]
                count += 1
    system = _system(mobility, point[:count], along, across, diagonal)
    if not _eliminated(system, right):
        return False
    for c in range(len(friction)):
        for row in range(3):
            impulse[c, row] = 0.0
    for k in range(count):
        for row in range(3):
            impulse[point[k], row] += along[k, row] * right[k]
    return True


@compiled(inner=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _system(mobility: Array, point: Indices, along: Array, across: Array, diagonal: Array) -> Array:
    """(k, k) the mobilities of the unknowns, with a diagonal."""
    count, size = len(point), len(mobility)
    found, moved = np.empty((count, count)), np.empty(size)
    for k in range(count):
        row = 3 * point[k]
        one, two, three = across[k, 0], across[k, 1], across[k, 2]
        for i in range(size):
            moved[i] = one * mobility[row, i] + two * mobility[row + 1, i] + three * mobility[row + 2, i]
        for j in range(count):
            first = 3 * point[j]
            found[k, j] = along[j, 0] * moved[first] + along[j, 1] * moved[first + 1] + along[j, 2] * moved[first + 2]
        found[k, k] += diagonal[k]
    return found


@compiled(inner=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _eliminated(system: Array, right: Array) -> bool:
    """Solve a system (k, k) into the first of `right` by elimination with pivots; false where it is singular."""
    count = len(system)
    for k in range(count):
        pivot = k
        for i in range(k + 1, count):
            if abs(system[i, k]) > abs(system[pivot, k]):
                pivot = i
        if not abs(system[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, count):
                system[k, j], system[pivot, j] = system[pivot, j], system[k, j]
            right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, count):
            factor = system[i, k] / system[k, k]
            if factor != 0.0:
                for j in range(k + 1, count):
                    system[i, j] -= factor * system[k, j]
                right[i] -= factor * right[k]
    for k in range(count - 1, -1, -1):
        total = right[k]
        for j in range(k + 1, count):
            total -= system[k, j] * right[j]
        right[k] = total / system[k, k]
    return True
