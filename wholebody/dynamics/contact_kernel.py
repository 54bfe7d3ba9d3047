"""Velocities and impulses at contact points, as compiled loops.

At a point of the contact of bodies A and B, with the unit normal n from A to B and tangents t1 and t2, an impulse p
changes the velocities by M^-1 J^T p, and u = J v is the velocity of B's point relative to A's.

The loops share these arrays: `bodies` (m, 2) has A and B of every point, `jacobian` (m, 3, 2, 6) the rows of J along
n, t1, t2 for the velocity and angular velocity of A and of B, `response` (m, 3, 2, 6) the same of J M^-1, `mobility`
(m, 2) the change of u by a unit impulse, along n and the most along a tangent, `twist` (n, 6) the velocities of all.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled


@compiled()
def write_rows(
    bodies: Indices,
    normal: Array,
    point: Array,
    position: Array,
    inverse_mass: Array,
    inverse_inertia: Array,
    axes: Array,
    jacobian: Array,
    response: Array,
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
        response: (m, 3, 2, 6) room.
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
        axes[c, 1, least], axes[c, 1, i], axes[c, 1, j] = 0.0, -normal[c, j] / size, normal[c, i] / size
        for k in range(3):
            axes[c, 0, k] = normal[c, k]
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
                    response[c, row, side, k] = inverse_mass[body] * sign * axes[c, row, k]
                for k in range(3):
                    total = 0.0
                    for i in range(3):
                        total += inverse_inertia[body, k, i] * jacobian[c, row, side, 3 + i]
                    response[c, row, side, 3 + k] = total
        for row in range(3):
            for other in range(3):
                gram[row, other] = coupling(c, row, other, jacobian, response)
        mobility[c, 0] = gram[0, 0]
        mean = 0.5 * (gram[1, 1] + gram[2, 2])
        mobility[c, 1] = mean + np.sqrt((0.5 * (gram[1, 1] - gram[2, 2])) ** 2 + gram[1, 2] ** 2)


@compiled(inner=True)
def coupling(c: int, row: int, other: int, jacobian: Array, response: Array) -> float:
    """Change of the relative velocity along one axis of a point by a unit impulse along another."""
    total = 0.0
    for side in range(2):
        for k in range(6):
            total += jacobian[c, row, side, k] * response[c, other, side, k]
    return total


@compiled(inner=True)
def relative(c: int, row: int, bodies: Indices, jacobian: Array, twist: Array) -> float:
    """Velocity of B's point relative to A's along an axis of a contact point."""
    a, b = bodies[c, 0], bodies[c, 1]
    total = 0.0
    for k in range(6):
        total += jacobian[c, row, 0, k] * twist[a, k] + jacobian[c, row, 1, k] * twist[b, k]
    return total


@compiled(inner=True)
def push(c: int, row: int, impulse: float, bodies: Indices, response: Array, twist: Array) -> None:
    """Change the velocities by an impulse along an axis of a contact point: on B, and its opposite on A."""
    a, b = bodies[c, 0], bodies[c, 1]
    for k in range(6):
        twist[a, k] += impulse * response[c, row, 0, k]
        twist[b, k] += impulse * response[c, row, 1, k]


@compiled()
def rates(bodies: Indices, jacobian: Array, twist: Array, result: Array) -> None:
    """Write the relative velocities (m, 3) along the axes of all points."""
    for c in range(len(bodies)):
        for row in range(3):
            result[c, row] = relative(c, row, bodies, jacobian, twist)


@compiled()
def apply(bodies: Indices, response: Array, twist: Array, impulse: Array) -> None:
    """Change the velocities by the impulses (m, 3) of all points."""
    for c in range(len(bodies)):
        for row in range(3):
            if impulse[c, row] != 0.0:
                push(c, row, impulse[c, row], bodies, response, twist)


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


@compiled()
def join(points: Indices, bodies: Indices, movable: Mask, root: Indices) -> None:
    """Write the least body of the island of each: bodies that points join, which do not reach through fixed bodies.

    Args:
        points: (k,) those that join, such as the points that bear something.
        bodies: (m, 2) of all points.
        movable: (n,) bodies that islands may reach through.
        root: (n,) room.
    """
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
