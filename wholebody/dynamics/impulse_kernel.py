"""The impulses of a figure's contacts and joint limits, as compiled loops over a dense matrix of mobilities."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled, with_loops
from wholebody.base.dense_kernel import factorise, gram, substitute
from wholebody.dynamics.solve_kernel import FAST, along_way

OVER = 1.6  # over-relaxation of the alternating direction method; 1.5 to 1.8 is usual (Boyd et al., 2011)
COARSE = 2e-4  # m/s: what sweeps leave further from the laws of contact is refined


@compiled(error_model="numpy", fastmath=FAST)
def mobilities(inertia: Array, rows: Array) -> Array:
    """(k, k) changes of velocities along rows (k, n) by unit impulses along them, of an inertia (n, n)."""
    size, count = inertia.shape[0], rows.shape[0]
    root, white, found = inertia.copy(), np.empty((size, count)), np.empty((count, count))
    factorise(root)
    for j in range(size):
        for c in range(count):
            white[j, c] = rows[c, j]
        for k in range(j):
            for c in range(count):
                white[j, c] -= root[j, k] * white[k, c]
        for c in range(count):
            white[j, c] /= root[j, j]
    across = np.empty((count, size))
    for c in range(count):
        for j in range(size):
            across[c, j] = white[j, c]
    gram(across, across, count, found)
    for c in range(count):
        for d in range(c):
            found[d, c] = found[c, d]
    return found


@compiled(error_model="numpy", fastmath=FAST)
def add_bodies(mobility: Array, rows: Array, responses: Array) -> None:
    """Add to mobilities (k, k) what bodies do with responses (b, 6, 6) to impulses, along rows (k, 6 b)."""
    count, scaled = rows.shape[0], np.empty(6)
    own = np.empty(count, np.intp)
    for b in range(len(responses)):
        number = 0
        for c in range(count):
            some = 0.0
            for k in range(6 * b, 6 * b + 6):
                some += abs(rows[c, k])
            if some > 0.0:
                own[number] = c
                number += 1
        for one in range(number):
            for k in range(6):
                scaled[k] = 0.0
                for i in range(6):
                    scaled[k] += rows[own[one], 6 * b + i] * responses[b, i, k]
            for other in range(one + 1):
                total = 0.0
                for k in range(6):
                    total += scaled[k] * rows[own[other], 6 * b + k]
                mobility[own[one], own[other]] += total
                if other < one:
                    mobility[own[other], own[one]] += total


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _push(row: int, one: float, two: float, three: float, mobility: Array, velocity: Array) -> None:
    """Change all velocities by an impulse at the point of three rows; the matrix is symmetric, and read by rows."""
    for k in range(len(velocity)):
        velocity[k] += mobility[row, k] * one + mobility[row + 1, k] * two + mobility[row + 2, k] * three


@compiled(error_model="numpy", fastmath=FAST)
def solve(
    mobility: Array, velocity: Array, laws: tuple[Array, Array], impulse: Array, most: int, tolerance: float
) -> None:
    """Change impulses (m, 3) along the axes of m points, by the method of `solve_kernel`, both frictions together.

    At every point 0 <= p_n is complementary to u_n - target >= 0, and p_t is at most friction p_n against the sliding.
    Sweeps go over points that approach or did so before, a few of those that are near.

    Args:
        mobility: (3 m, 3 m) change of the velocities by unit impulses.
        velocity: (3 m,) without impulses, m/s: along the normal, then two tangents. It becomes that with them.
        laws: friction (m,), and the least velocities (m,) along the normals, m/s.
        impulse: to begin with.
        most: sweeps.
        tolerance: change of all velocities at which it ends, in two sweeps, one each way, m/s.
    """
    friction, target = laws
    count = len(friction)
    chosen, number, sweeps, some, calm = np.empty(count, np.intp), 0, 0, 8, False
    waits = np.ones(count, np.bool_)
    for c in range(count):
        if impulse[c, 0] > 0.0 and mobility[3 * c, 3 * c] > 1e-12:
            chosen[number], waits[c] = c, False
            number += 1
            size, bound = np.sqrt(impulse[c, 1] ** 2 + impulse[c, 2] ** 2), friction[c] * impulse[c, 0]
            if size > bound:  # as where the normal has turned
                impulse[c, 1], impulse[c, 2] = impulse[c, 1] * (bound / size), impulse[c, 2] * (bound / size)
            _push(3 * c, impulse[c, 0], impulse[c, 1], impulse[c, 2], mobility, velocity)
        else:
            impulse[c, 0], impulse[c, 1], impulse[c, 2] = 0.0, 0.0, 0.0
    while True:
        before = number
        for c in range(count):
            if waits[c] and velocity[3 * c] < target[c] and mobility[3 * c, 3 * c] > 1e-12:
                chosen[number], waits[c] = c, False
                number += 1
        if sweeps >= most or (calm and number == before) or number == 0:
            return
        among = np.empty((3 * number, 3 * number))
        for c in range(number):
            for d in range(number):
                for row in range(3):
                    for k in range(3):
                        among[3 * c + row, 3 * d + k] = mobility[3 * chosen[c] + row, 3 * chosen[d] + k]
        given = np.zeros((number, 3))
        for c in range(number):
            for row in range(3):
                given[c, row] = impulse[chosen[c], row]
        some = min(some, most - sweeps)
        done, calm = _sweep(among, velocity, (friction, target, chosen[:number], given), some, tolerance)
        sweeps, some = sweeps + done, 2 * some
        for c in range(number):
            one, two, three = given[c, 0], given[c, 1], given[c, 2]
            own = chosen[c]
            step = one - impulse[own, 0], two - impulse[own, 1], three - impulse[own, 2]
            impulse[own, 0], impulse[own, 1], impulse[own, 2] = one, two, three
            _push(3 * own, step[0], step[1], step[2], mobility, velocity)


@compiled(inner=True, error_model="numpy", fastmath=FAST)
def _sweep(
    mobility: Array, all_velocities: Array, points: tuple[Array, Array, Indices, Array], most: int, tolerance: float
) -> tuple[int, bool]:
    """Sweep over k of m points, changing their impulses (k, 3): how often, and whether the last changed little."""
    friction, target, chosen, impulse = points
    count = len(chosen)
    velocity, before, way = np.empty(3 * count), np.zeros((count, 3)), np.zeros((count, 3))
    for c in range(count):
        for row in range(3):
            velocity[3 * c + row] = all_velocities[3 * chosen[c] + row]
    last, calm = np.inf, 0
    for sweep in range(most):
        largest, square = 0.0, 0.0
        for c in range(count):
            before[c, 0], before[c, 1], before[c, 2] = impulse[c, 0], impulse[c, 1], impulse[c, 2]
        for number in range(count):
            c = number if sweep % 2 == 0 else count - 1 - number
            row, rough = 3 * c, friction[chosen[c]]
            own, held = mobility[row, row], impulse[c, 0]
            now = max(0.0, held + (target[chosen[c]] - velocity[row]) / own)
            if now == 0.0 and held == 0.0:
                continue
            step, one, two = now - held, 0.0, 0.0
            # one step along both axes, with a bound of the mobility along any; 0 where nothing moves along them
            side = max(mobility[row + 1, row + 1], mobility[row + 2, row + 2]) + abs(mobility[row + 1, row + 2])
            if rough > 0.0 and side > 1e-12:
                one = impulse[c, 1] - (velocity[row + 1] + mobility[row + 1, row] * step) / side
                two = impulse[c, 2] - (velocity[row + 2] + mobility[row + 2, row] * step) / side
                size, bound = np.sqrt(one * one + two * two), rough * now
                if size > bound:
                    one, two = one * (bound / size), two * (bound / size)
                one, two = one - impulse[c, 1], two - impulse[c, 2]
            impulse[c, 0] = now
            impulse[c, 1] += one
            impulse[c, 2] += two
            largest = max(largest, abs(step) * own, max(abs(one), abs(two)) * side)
            square += step * step * own + (one * one + two * two) * side
            _push(row, step, one, two, mobility, velocity)
        calm = calm + 1 if largest < tolerance else 0
        if calm == 2 or sweep == most - 1:
            return sweep + 1, calm == 2
        share, last = square / last, square
        for c in range(count):
            step, one, two = along_way(share, way[c], impulse[c], before[c])
            if step != 0.0 or one != 0.0 or two != 0.0:
                _push(3 * c, step, one, two, mobility, velocity)
    return most, False


@compiled(error_model="numpy", fastmath=FAST)
def _split(
    mobility: Array, weight: Array, rest: Array, friction: Array, impulse: Array, dual: Array, most: int
) -> tuple[float, float]:
    """Steps of the alternating direction method: by how much the impulses broke the program, and the laws of contact.

    `mobility` (3 m, 3 m); `weight` (3 m,) of what the laws of contact change; `rest` (3 m,) velocities without
    impulses, less the targets; `impulse` (3 m,) obeys the laws, `dual` are the velocities at which these are solved:
    both change in place.
    """
    size = len(rest)
    root, found, free, broken, moved = mobility.copy(), np.empty(size), np.empty(size), 0.0, 0.0
    for k in range(size):
        root[k, k] += weight[k]
    factorise(root)
    for _ in range(most):
        for k in range(size):
            found[k] = weight[k] * impulse[k] - rest[k] - dual[k]
        substitute(root, found)
        broken, moved = 0.0, 0.0
        for k in range(size):
            broken += weight[k] * (found[k] - impulse[k]) ** 2
            free[k] = OVER * found[k] + (1.0 - OVER) * impulse[k]
        for c in range(len(friction)):
            row = 3 * c
            now = max(0.0, free[row] + dual[row] / weight[row])
            one = free[row + 1] + dual[row + 1] / weight[row + 1]
            two = free[row + 2] + dual[row + 2] / weight[row + 2]
            length, bound = np.sqrt(one * one + two * two), friction[c] * now
            if length > bound:
                one, two = one * (bound / length), two * (bound / length)
            for k, new in ((row, now), (row + 1, one), (row + 2, two)):
                dual[k] += weight[k] * (free[k] - new)
                moved += weight[k] * (new - impulse[k]) ** 2
                impulse[k] = new
    return np.sqrt(broken), np.sqrt(moved)


@compiled(error_model="numpy")
def violation(mobility: Array, velocity: Array, friction: Array, target: Array, impulse: Array) -> float:
    """Most by which a velocity (3 m,) with the impulses (m, 3) is off the laws of contact, m/s; see `solve`."""
    worst = 0.0
    for c in range(len(friction)):
        row = 3 * c
        own = mobility[row, row]
        if own <= 1e-12:
            continue
        now = max(0.0, impulse[c, 0] + (target[c] - velocity[row]) / own)
        worst = max(worst, abs(now - impulse[c, 0]) * own)
        side = max(mobility[row + 1, row + 1], mobility[row + 2, row + 2]) + abs(mobility[row + 1, row + 2])
        if side > 1e-12:
            one, two = impulse[c, 1] - velocity[row + 1] / side, impulse[c, 2] - velocity[row + 2] / side
            share = min(1.0, friction[c] * now / max(np.sqrt(one * one + two * two), 1e-300))
            off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
            worst = max(worst, off * side)
    return worst


@compiled(error_model="numpy")
def _by_cholesky(inertia: Array, momentum: Array) -> tuple[bool, Array]:
    root, velocity = inertia.copy(), momentum.copy()
    if not factorise(root):
        return False, velocity
    substitute(root, velocity)
    return True, velocity


def by_inertia(inertia: Array, momentum: Array) -> Array:
    """The velocities (n,) that an inertia (n, n), symmetric, has with a momentum (n,)."""
    known, velocity = _by_cholesky(np.ascontiguousarray(inertia), np.ascontiguousarray(momentum))
    return np.asarray(velocity if known else np.linalg.solve(inertia, momentum))


def impulses(
    mobility: Array, speed: Array, friction: Array, target: Array, start: Array | None = None
) -> tuple[Array, Array]:
    """Impulses (m, 3) along the axes of m points, and the velocities (3 m,) with them; arguments as of `solve`.

    With those of the step before as a `start`, 1e-6 m/s is exact enough, and the next step goes on from there.
    """
    velocity, impulse = speed.copy(), np.zeros((len(friction), 3)) if start is None else start.copy()
    most, tolerance = (1000, 1e-7) if start is None else (60, 1e-6)
    solve(mobility, velocity, (friction, target), impulse, most, tolerance)
    if violation(mobility, velocity, friction, target, impulse) > COARSE:
        impulse = _refined(mobility, velocity, friction, target, impulse)
        velocity = speed + mobility @ impulse.ravel()
    return impulse, velocity


def _refined(mobility: Array, velocity: Array, friction: Array, target: Array, impulse: Array) -> Array:
    """Impulses (m, 3) nearer to the laws of contact than those of `solve`, with which the velocities are (3 m,).

    Sweeps pass on a thousandth of an impulse where much rests on little; this method factors the matrix of the points
    that bear or approach, and begins where the sweeps ended.
    """
    best, least, share = impulse, violation(mobility, velocity, friction, target, impulse), 1e-2
    speed, own = velocity - mobility @ impulse.ravel(), np.maximum(mobility.diagonal().reshape(-1, 3), 1e-9)
    own[:, 1:] = own[:, 1:].max(axis=1)[:, None]
    for _ in range(3):  # each with the points that approached after the one before
        chosen = np.flatnonzero((impulse[:, 0] > 0.0) | (velocity[::3] < target + 1e-6))
        rows = (3 * chosen[:, None] + np.arange(3)).ravel()
        among, rest, dual = mobility[np.ix_(rows, rows)], speed[rows], -velocity[rows]
        rest[::3] -= target[chosen]
        dual[::3] += target[chosen]
        now, rough, impulse = impulse[chosen].ravel(), friction[chosen], np.zeros_like(impulse)
        for _ in range(8):  # of 20 steps
            broken, moved = _split(among, share * own[chosen].ravel(), rest, rough, now, dual, 20)
            impulse[chosen] = now.reshape(-1, 3)
            velocity = speed + now @ mobility[rows]
            off = violation(mobility, velocity, friction, target, impulse)
            if off < least:
                best, least = impulse.copy(), off
            if off < COARSE:
                return best
            ratio = broken / max(share * moved, 1e-300)
            if not 0.2 < ratio < 5.0:
                share = min(max(share * min(max(np.sqrt(ratio), 1e-3), 1e3), 1e-6), 1e6)
    return best


@compiled(error_model="numpy", fastmath=FAST)
def approaches(pairs: Indices, reach: Array, centres: Array, twist: Array) -> Array:
    """Bounds (pairs,) [m/s] of the approach of pieces; arguments as of `touching.approaches`, with its least reach."""
    found = np.empty(len(pairs))
    for number in range(len(pairs)):
        p, q = pairs[number, 0], pairs[number, 1]
        piece = p if reach[p] < reach[q] else q
        speed, spin = 0.0, 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            one, other = twist[p, 3 + i] - twist[q, 3 + i], twist[p, 3 + j] - twist[q, 3 + j]
            speed += (twist[p, k] - twist[q, k] + one * centres[piece, j] - other * centres[piece, i]) ** 2
            spin += one**2
        found[number] = np.sqrt(speed) + reach[piece] * np.sqrt(spin)
    return found


@compiled(error_model="numpy", fastmath=FAST)
def point_rows(
    points: tuple[Array, Array, Indices],
    joints: tuple[Indices, Array, Array],
    bodies: tuple[Indices, Array, Array],
    found: tuple[Array, Array, Array, Array, Mask],
) -> None:
    """Write axes and velocities of points, of which those of the figure come first.

    Args:
        points: normals and places (m, 3), and the numbers (m, 2) of both bodies.
        joints: the joints (k, 2) of the figure's points, support (joints, nv) and jacobian (6, nv) as in `State`.
        bodies: the place (n,) of each body among those that move by themselves, -1 for others; centres of mass (b, 3)
            of those; twists (n, 6) at the origin, of what is moved, zero for others.
        found: `axes`, `figure`, `things`, `given` and `driven` as in `coupling.Points`, all zero.
    """
    (normal, place, owner), (joint, support, jacobian), (slot, centres, twists) = points, joints, bodies
    axes, figure, things, given, driven = found
    for c in range(len(normal)):
        least = 0
        for k in range(1, 3):
            if abs(normal[c, k]) < abs(normal[c, least]):
                least = k
        i, j = (least + 1) % 3, (least + 2) % 3
        size = np.sqrt(normal[c, i] ** 2 + normal[c, j] ** 2)
        # normal x e, of the axis e that is nearest to a right angle with it
        axes[c, 1, least], axes[c, 1, i], axes[c, 1, j] = 0.0, normal[c, j] / size, -normal[c, i] / size
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            axes[c, 0, k] = normal[c, k]
            axes[c, 2, k] = normal[c, i] * axes[c, 1, j] - normal[c, j] * axes[c, 1, i]
        for r in range(3):
            row, axis = 3 * c + r, axes[c, r]
            turn = (
                place[c, 1] * axis[2] - place[c, 2] * axis[1],
                place[c, 2] * axis[0] - place[c, 0] * axis[2],
                place[c, 0] * axis[1] - place[c, 1] * axis[0],
            )
            for n in range(figure.shape[1] if c < len(joint) else 0):
                share = support[joint[c, 1], n] - support[joint[c, 0], n]
                if share != 0.0:
                    total = 0.0
                    for k in range(3):
                        total += axis[k] * jacobian[k, n] + turn[k] * jacobian[3 + k, n]
                    figure[row, n] = share * total
            for side in range(2):
                body, sign = owner[c, side], 2.0 * side - 1.0
                b = slot[body]
                for k in range(3):
                    rate = axis[k] * twists[body, k] + turn[k] * twists[body, 3 + k]
                    given[row] += sign * rate
                    if twists[body, k] != 0.0 or twists[body, 3 + k] != 0.0 or b >= 0:
                        driven[c] = True
                    if b >= 0:
                        i, j = (k + 1) % 3, (k + 2) % 3
                        things[row, 6 * b + k] = sign * axis[k]
                        lever = centres[b, i] * axis[j] - centres[b, j] * axis[i]
                        things[row, 6 * b + 3 + k] = sign * (turn[k] - lever)


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """The loop."""
    eye, three, one = np.eye(3), np.zeros(3), np.zeros(1)
    none, pairs, rows = np.zeros(0, dtype=np.intp), np.zeros((0, 2), dtype=np.intp), np.zeros((0, 3))
    mobilities(eye, eye)
    approaches(pairs, one, rows, np.zeros((0, 6)))
    axes, flags = np.zeros((0, 3, 3)), np.zeros(0, dtype=bool)
    moved = none, rows, np.zeros((0, 6))
    point_rows((rows, rows, pairs), (pairs, eye, np.zeros((6, 3))), moved, (axes, rows, rows, np.zeros(0), flags))
    _by_cholesky(eye, three)
    add_bodies(eye, np.zeros((3, 6)), np.zeros((1, 6, 6)))
    solve(eye, three, (one, one), np.zeros((1, 3)), 1, 1e-9)
    _split(eye, np.ones(3), three, one, three.copy(), three.copy(), 1)
    violation(eye, three, one, one, np.zeros((1, 3)))
