"""Velocities and impulses at contact points, and the joint program of all contacts, as compiled loops.

At a point of the contact of bodies A and B, with the unit normal n from A to B and tangents t1 and t2, an impulse p
changes the velocities by M^-1 J^T p, and u = J v is the velocity of B's point relative to A's. The program finds

    0 <= p_n  complementary to  u_n - target >= 0                                                    (Signorini)
    p_t = -min(mu p_n, sticking) u_t / |u_t|                                                         (Coulomb)

by Gauss and Seidel's method with projection, one point after the other, forwards and backwards in turn.
"""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Indices
from wholebody.compiled import compiled


@compiled()
def frames(
    first: Indices,
    second: Indices,
    normal: Array,
    point: Array,
    position: Array,
    inverse_mass: Array,
    inverse_inertia: Array,
    axes: Array,
    levers: Array,
    answers: Array,
    mobility: Array,
) -> None:
    """Write what the program needs of every contact point.

    Args:
        first: (m,) body A of each point.
        second: (m,) body B.
        normal: (m, 3) unit normals from A to B.
        point: (m, 3) in the world.
        position: (n, 3) centres of mass.
        inverse_mass: (n,) zero for bodies that contacts do not move.
        inverse_inertia: (n, 3, 3) along the world's axes.
        axes: (m, 3, 3) room for the rows n, t1, t2.
        levers: (m, 2, 3, 3) room for r cross axis, of A and of B.
        answers: (m, 2, 3, 3) room for I^-1 (r cross axis).
        mobility: (m, 2) room for the change of u by a unit impulse: along n, and the most along a tangent.
    """
    gram = np.zeros((3, 3))
    for c in range(len(first)):
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
        gram[:] = 0.0
        for side in range(2):
            body = first[c] if side == 0 else second[c]
            for row in range(3):
                for k in range(3):
                    i, j = (k + 1) % 3, (k + 2) % 3
                    levers[c, side, row, k] = (point[c, i] - position[body, i]) * axes[c, row, j] - (
                        point[c, j] - position[body, j]
                    ) * axes[c, row, i]
            for row in range(3):
                for k in range(3):
                    total = 0.0
                    for j in range(3):
                        total += inverse_inertia[body, k, j] * levers[c, side, row, j]
                    answers[c, side, row, k] = total
            for row in range(3):
                gram[row, row] += inverse_mass[body]
                for other in range(3):
                    for k in range(3):
                        gram[row, other] += levers[c, side, row, k] * answers[c, side, other, k]
        mobility[c, 0] = gram[0, 0]
        mean = 0.5 * (gram[1, 1] + gram[2, 2])
        mobility[c, 1] = mean + np.sqrt((0.5 * (gram[1, 1] - gram[2, 2])) ** 2 + gram[1, 2] ** 2)


@compiled()
def relative(
    c: int, row: int, first: Indices, second: Indices, axes: Array, levers: Array, v: Array, w: Array
) -> float:
    """Velocity of B's point relative to A's along an axis of a contact point."""
    a, b = first[c], second[c]
    total = 0.0
    for k in range(3):
        total += axes[c, row, k] * (v[b, k] - v[a, k])
        total += levers[c, 1, row, k] * w[b, k] - levers[c, 0, row, k] * w[a, k]
    return total


@compiled()
def push(
    c: int,
    row: int,
    impulse: float,
    first: Indices,
    second: Indices,
    axes: Array,
    answers: Array,
    inverse_mass: Array,
    v: Array,
    w: Array,
) -> None:
    """Change the velocities by an impulse along an axis of a contact point: on B, and its opposite on A."""
    a, b = first[c], second[c]
    for k in range(3):
        v[a, k] -= impulse * inverse_mass[a] * axes[c, row, k]
        v[b, k] += impulse * inverse_mass[b] * axes[c, row, k]
        w[a, k] -= impulse * answers[c, 0, row, k]
        w[b, k] += impulse * answers[c, 1, row, k]


@compiled()
def solve(
    chosen: Indices,
    first: Indices,
    second: Indices,
    axes: Array,
    levers: Array,
    answers: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    inverse_mass: Array,
    v: Array,
    w: Array,
    impulse: Array,
    tolerance: float,
    most: int,
) -> int:
    """Solve the program of the points `chosen`; how many sweeps it took.

    Args:
        chosen: (k,) points of the program.
        first: (m,) body A of each point.
        second: (m,) body B.
        axes: (m, 3, 3), see `frames`; so levers, answers and mobility.
        levers: (m, 2, 3, 3).
        answers: (m, 2, 3, 3).
        mobility: (m, 2).
        friction: (m,) coefficients.
        target: (m,) least u_n after it, m/s.
        inverse_mass: (n,).
        v: (n, 3) velocities with the impulses at the start; changed in place.
        w: (n, 3) angular velocities, likewise.
        impulse: (m, 3) along n, t1, t2, N s; a start, changed in place.
        tolerance: a sweep that changes no u by more ends it, m/s.
        most: sweeps.
    """
    count = len(chosen)
    for sweep in range(most):
        change = 0.0
        for number in range(count):
            c = chosen[number if sweep % 2 == 0 else count - 1 - number]
            if mobility[c, 0] <= 0.0:
                continue
            u = relative(c, 0, first, second, axes, levers, v, w)
            now = max(0.0, impulse[c, 0] - (u - target[c]) / mobility[c, 0])
            step = now - impulse[c, 0]
            if step != 0.0:
                push(c, 0, step, first, second, axes, answers, inverse_mass, v, w)
                impulse[c, 0] = now
                change = max(change, abs(step) * mobility[c, 0])
            most_tangential = friction[c] * now
            if most_tangential == 0.0 and impulse[c, 1] == 0.0 and impulse[c, 2] == 0.0:
                continue
            one = impulse[c, 1] - relative(c, 1, first, second, axes, levers, v, w) / mobility[c, 1]
            two = impulse[c, 2] - relative(c, 2, first, second, axes, levers, v, w) / mobility[c, 1]
            size = np.sqrt(one * one + two * two)
            if size > most_tangential:
                share = most_tangential / size
                one, two = share * one, share * two
            for row, wanted in ((1, one), (2, two)):
                step = wanted - impulse[c, row]
                if step != 0.0:
                    push(c, row, step, first, second, axes, answers, inverse_mass, v, w)
                    impulse[c, row] = wanted
                    change = max(change, abs(step) * mobility[c, 1])
        if change < tolerance:
            return sweep + 1
    return most


@compiled()
def residuals(
    first: Indices,
    second: Indices,
    axes: Array,
    levers: Array,
    mobility: Array,
    friction: Array,
    target: Array,
    v: Array,
    w: Array,
    impulse: Array,
) -> tuple[float, float]:
    """Largest violation of Signorini's and of Coulomb's law over all points, both m/s: see `solve`."""
    signorini, coulomb = 0.0, 0.0
    for c in range(len(first)):
        if mobility[c, 0] <= 0.0:
            continue
        open_by = relative(c, 0, first, second, axes, levers, v, w) - target[c]
        signorini = max(signorini, abs(min(impulse[c, 0] * mobility[c, 0], open_by)))
        one = impulse[c, 1] - relative(c, 1, first, second, axes, levers, v, w) / mobility[c, 1]
        two = impulse[c, 2] - relative(c, 2, first, second, axes, levers, v, w) / mobility[c, 1]
        size = np.sqrt(one * one + two * two)
        share = min(1.0, friction[c] * impulse[c, 0] / max(size, 1e-300))
        off = np.sqrt((share * one - impulse[c, 1]) ** 2 + (share * two - impulse[c, 2]) ** 2)
        coulomb = max(coulomb, off * mobility[c, 1])
    return signorini, coulomb


@compiled()
def apply(
    first: Indices,
    second: Indices,
    axes: Array,
    answers: Array,
    inverse_mass: Array,
    v: Array,
    w: Array,
    impulse: Array,
) -> None:
    """Change the velocities by the impulses (m, 3) of all points."""
    for c in range(len(first)):
        for row in range(3):
            if impulse[c, row] != 0.0:
                push(c, row, impulse[c, row], first, second, axes, answers, inverse_mass, v, w)


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
