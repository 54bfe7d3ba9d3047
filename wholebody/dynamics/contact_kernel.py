"""Velocities and impulses at contact points, and the joint program of all contacts, as compiled loops.

At a point of the contact of bodies A and B, with the unit normal n from A to B and tangents t1 and t2, an impulse p
changes the velocities by M^-1 J^T p, and u = J v is the velocity of B's point relative to A's. The program finds

    0 <= p_n  complementary to  u_n - target >= 0                                                    (Signorini)
    p_t = -min(mu p_n, sticking) u_t / |u_t|                                                         (Coulomb)

by Gauss and Seidel's method with projection, one point after the other, forwards and backwards in turn, with the
conjugate directions of Silcowitz, Niebe and Erleben (2010) between sweeps.

The loops share these arrays: `bodies` (m, 2) has A and B of every point, `jacobian` (m, 3, 2, 6) the rows of J along
n, t1, t2 for the velocity and angular velocity of A and of B, `answer` (m, 3, 2, 6) the same of J M^-1, `mobility`
(m, 2) the change of u by a unit impulse, along n and the most along a tangent, `twist` (n, 6) the velocities of all.
"""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Indices
from wholebody.compiled import compiled


@compiled()
def lay(
    bodies: Indices,
    normal: Array,
    point: Array,
    position: Array,
    inverse_mass: Array,
    inverse_inertia: Array,
    axes: Array,
    jacobian: Array,
    answer: Array,
    mobility: Array,
) -> None:
    """Write what the program needs of every contact point.

    Args:
        bodies: (m, 2).
        normal: (m, 3) unit normals from A to B.
        point: (m, 3) in the world.
        position: (n, 3) centres of mass.
        inverse_mass: (n,) zero for bodies that contacts do not move.
        inverse_inertia: (n, 3, 3) along the world's axes.
        axes: (m, 3, 3) room for the rows n, t1, t2.
        jacobian: (m, 3, 2, 6) room.
        answer: (m, 3, 2, 6) room.
        mobility: (m, 2) room.
    """
    gram = np.zeros((3, 3))
    for c in range(len(bodies)):
        least = 0
        for k in range(1, 3):
            if abs(normal[c, k]) < abs(normal[c, least]):
                least = k
        i, j = (least + 1) % 3, (least + 2) % 3
        size = np.sqrt(normal[c, i] ** 2 + normal[c, j] ** 2)
        axes[c, 0] = normal[c]
        axes[c, 1, least], axes[c, 1, i], axes[c, 1, j] = 0.0, -normal[c, j] / size, normal[c, i] / size
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            axes[c, 2, k] = normal[c, i] * axes[c, 1, j] - normal[c, j] * axes[c, 1, i]
        for side in range(2):
            body, sign = bodies[c, side], 1.0 if side == 1 else -1.0
            for row in range(3):
                for k in range(3):
                    i, j = (k + 1) % 3, (k + 2) % 3
                    turn = (point[c, i] - position[body, i]) * axes[c, row, j]
                    turn -= (point[c, j] - position[body, j]) * axes[c, row, i]
                    jacobian[c, row, side, k] = sign * axes[c, row, k]
                    jacobian[c, row, side, 3 + k] = sign * turn
                    answer[c, row, side, k] = inverse_mass[body] * sign * axes[c, row, k]
                for k in range(3):
                    total = 0.0
                    for i in range(3):
                        total += inverse_inertia[body, k, i] * jacobian[c, row, side, 3 + i]
                    answer[c, row, side, 3 + k] = total
        for row in range(3):
            for other in range(3):
                gram[row, other] = coupling(c, row, other, jacobian, answer)
        mobility[c, 0] = gram[0, 0]
        mean = 0.5 * (gram[1, 1] + gram[2, 2])
        mobility[c, 1] = mean + np.sqrt((0.5 * (gram[1, 1] - gram[2, 2])) ** 2 + gram[1, 2] ** 2)


@compiled()
def coupling(c: int, row: int, other: int, jacobian: Array, answer: Array) -> float:
    """Change of the relative velocity along one axis of a point by a unit impulse along another."""
    total = 0.0
    for side in range(2):
        for k in range(6):
            total += jacobian[c, row, side, k] * answer[c, other, side, k]
    return total


@compiled()
def relative(c: int, row: int, bodies: Indices, jacobian: Array, twist: Array) -> float:
    """Velocity of B's point relative to A's along an axis of a contact point."""
    a, b = bodies[c, 0], bodies[c, 1]
    total = 0.0
    for k in range(6):
        total += jacobian[c, row, 0, k] * twist[a, k] + jacobian[c, row, 1, k] * twist[b, k]
    return total


@compiled()
def push(c: int, row: int, impulse: float, bodies: Indices, answer: Array, twist: Array) -> None:
    """Change the velocities by an impulse along an axis of a contact point: on B, and its opposite on A."""
    a, b = bodies[c, 0], bodies[c, 1]
    for k in range(6):
        twist[a, k] += impulse * answer[c, row, 0, k]
        twist[b, k] += impulse * answer[c, row, 1, k]


@compiled()
def _sweep(
    c: int,
    bodies: Indices,
    jacobian: Array,
    answer: Array,
    mobility: Array,
    friction: float,
    target: float,
    twist: Array,
    impulse: Array,
) -> tuple[float, float]:
    """Solve the program for one point alone; the change of u, and the square of that of the impulse."""
    change, square = 0.0, 0.0
    now = max(0.0, impulse[0] - (relative(c, 0, bodies, jacobian, twist) - target) / mobility[0])
    step = now - impulse[0]
    if step != 0.0:
        push(c, 0, step, bodies, answer, twist)
        impulse[0] = now
        change = abs(step) * mobility[0]
        square = step * step * mobility[0]
    most = friction * now
    if most == 0.0 and impulse[1] == 0.0 and impulse[2] == 0.0:
        return change, square
    one = impulse[1] - relative(c, 1, bodies, jacobian, twist) / mobility[1]
    two = impulse[2] - relative(c, 2, bodies, jacobian, twist) / mobility[1]
    size = np.sqrt(one * one + two * two)
    if size > most:
        share = most / size
        one, two = share * one, share * two
    for row, wanted in ((1, one), (2, two)):
        step = wanted - impulse[row]
        if step != 0.0:
            push(c, row, step, bodies, answer, twist)
            impulse[row] = wanted
            change = max(change, abs(step) * mobility[1])
            square += step * step * mobility[1]
    return change, square


@compiled()
def solve(
    chosen: Indices,
    bodies: Indices,
    jacobian: Array,
    answer: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    twist: Array,
    impulse: Array,
    tolerance: float,
    most: int,
) -> int:
    """Solve the program of the points `chosen`; how many sweeps it took.

    Args:
        chosen: (k,) points of the program.
        bodies: (m, 2).
        jacobian: (m, 3, 2, 6).
        answer: (m, 3, 2, 6).
        mobility: (m, 2).
        friction: (m,) coefficients.
        target: (m,) least u_n after it, m/s.
        twist: (n, 6) velocities with the impulses at the start; changed in place.
        impulse: (m, 3) along n, t1, t2, N s; a start, changed in place.
        tolerance: a sweep that changes no u by more ends it, m/s.
        most: sweeps, the last of which is always one of projection.
    """
    count = len(chosen)
    before, way = np.empty((count, 3)), np.zeros((count, 3))
    last = np.inf
    for sweep in range(most):
        change, square = 0.0, 0.0
        for number in range(count):
            place = number if sweep % 2 == 0 else count - 1 - number
            c = chosen[place]
            for row in range(3):
                before[place, row] = impulse[c, row]
            if mobility[c, 0] > 0.0:
                largest, moved = _sweep(
                    c, bodies, jacobian, answer, mobility[c], friction[c], target[c], twist, impulse[c]
                )
                change, square = max(change, largest), square + moved
        if change < tolerance or sweep == most - 1:
            return sweep + 1
        share, last = square / last, square
        for place in range(count):
            c = chosen[place]
            for row in range(3):
                if share < 1.0:
                    farther = share * way[place, row]
                    way[place, row] = farther + impulse[c, row] - before[place, row]
                    if farther != 0.0:
                        push(c, row, farther, bodies, answer, twist)
                        impulse[c, row] += farther
                else:
                    way[place, row] = 0.0
    return most


@compiled()
def residuals(
    bodies: Indices,
    jacobian: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    twist: Array,
    impulse: Array,
) -> tuple[float, float]:
    """Largest violation of Signorini's and of Coulomb's law over all points, both m/s: see `solve`."""
    signorini, coulomb = 0.0, 0.0
    for c in range(len(bodies)):
        if mobility[c, 0] <= 0.0:
            continue
        open_by = relative(c, 0, bodies, jacobian, twist) - target[c]
        signorini = max(signorini, abs(min(impulse[c, 0] * mobility[c, 0], open_by)))
        one = impulse[c, 1] - relative(c, 1, bodies, jacobian, twist) / mobility[c, 1]
        two = impulse[c, 2] - relative(c, 2, bodies, jacobian, twist) / mobility[c, 1]
        size = np.sqrt(one * one + two * two)
        share = min(1.0, friction[c] * impulse[c, 0] / max(size, 1e-300))
        off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
        coulomb = max(coulomb, off * mobility[c, 1])
    return signorini, coulomb


@compiled()
def rates(bodies: Indices, jacobian: Array, twist: Array, result: Array) -> None:
    """Write the relative velocities (m, 3) along the axes of all points."""
    for c in range(len(bodies)):
        for row in range(3):
            result[c, row] = relative(c, row, bodies, jacobian, twist)


@compiled()
def apply(bodies: Indices, answer: Array, twist: Array, impulse: Array) -> None:
    """Change the velocities by the impulses (m, 3) of all points."""
    for c in range(len(bodies)):
        for row in range(3):
            if impulse[c, row] != 0.0:
                push(c, row, impulse[c, row], bodies, answer, twist)


@compiled()
def start_from(
    pair: Indices,
    local: Array,
    impulse: Array,
    head: Indices,
    new_pair: Indices,
    new_local: Array,
    axes: Array,
    near: float,
    start: Array,
) -> None:
    """Write a start for the impulses of new points: those of the nearest old point of the same pair.

    Args:
        pair: (k,) pair of each old point.
        local: (k, 3) the point in the first body's axes.
        impulse: (k, 3) in the world.
        head: (pairs,) all -1; so again afterwards.
        new_pair: (m,) of each new point.
        new_local: (m, 3).
        axes: (m, 3, 3) of the new points.
        near: metres; farther points are not the same.
        start: (m, 3) room for the impulses along the axes of each point.
    """
    following = np.full(len(pair), -1, dtype=np.intp)
    for old in range(len(pair)):
        following[old] = head[pair[old]]
        head[pair[old]] = old
    used = np.zeros(len(pair), dtype=np.bool_)
    for c in range(len(new_pair)):
        start[c] = 0.0
        best, least = -1, near * near
        old = head[new_pair[c]]
        while old >= 0:
            if not used[old]:
                square = 0.0
                for k in range(3):
                    square += (local[old, k] - new_local[c, k]) ** 2
                if square < least:
                    best, least = old, square
            old = following[old]
        if best >= 0:
            used[best] = True
            for row in range(3):
                for k in range(3):
                    start[c, row] += axes[c, row, k] * impulse[best, k]
            start[c, 0] = max(start[c, 0], 0.0)
    for old in range(len(pair)):
        head[pair[old]] = -1
    # what found no point near it goes to the nearest of its pair: witness points jump from corner to corner
    others = np.full(len(new_pair), -1, dtype=np.intp)
    for c in range(len(new_pair)):
        others[c] = head[new_pair[c]]
        head[new_pair[c]] = c
    for old in range(len(pair)):
        best, least = -1, np.inf
        c = -1 if used[old] else head[pair[old]]
        while c >= 0:
            square = 0.0
            for k in range(3):
                square += (local[old, k] - new_local[c, k]) ** 2
            if square < least:
                best, least = c, square
            c = others[c]
        if best >= 0:
            for row in range(3):
                for k in range(3):
                    start[best, row] += axes[best, row, k] * impulse[old, k]
            start[best, 0] = max(start[best, 0], 0.0)
    for c in range(len(new_pair)):
        head[new_pair[c]] = -1
