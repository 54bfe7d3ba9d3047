"""Rows of contact points and joint points, as compiled loops.

At a point of the contact of bodies A and B, with the unit normal n from A to B and tangents t1 and t2, an impulse p
changes the velocities by M^-1 J^T p, and u = J v is the velocity of B's point relative to A's. A joint point is one
point of each of two bodies that stay together; its axes are those of the world.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.dynamics.motion_kernel import Bodies, invert
from wholebody.dynamics.pieces import ContactPoints


class Rows(NamedTuple):
    """What programs need of m points, of which the last j are those of joints."""

    bodies: Indices  # (m, 2) A and B of each; twice B for a joint to the world
    axes: Array  # (m - j, 3, 3) n, t1, t2 of the contact points
    jacobian: Array  # (m, 3, 12) rows of J for the velocity and angular velocity of A, then of B
    response: Array  # (m, 3, 12) the same of J M^-1
    # (m, 4) change of u by a unit impulse: along n by n, the most along a tangent by tangents, along t1 and t2 by n.
    # Of a joint point, the most along any axis in the first; zero where nothing moves
    mobility: Array
    effective_mass: Array  # (j, 3, 3) inverses of J M^-1 J^T of the joint points; zero where nothing moves
    movable: Mask  # (n,) bodies that impulses move

    @staticmethod
    def room(bodies: Indices, joints: int, movable: Mask) -> Rows:
        """Room for the rows of these points (m, 2), the last of which are those of joints."""
        count = len(bodies)
        return Rows(
            bodies, np.empty((count - joints, 3, 3)), np.empty((count, 3, 12)), np.empty((count, 3, 12)),
            np.empty((count, 4)), np.empty((joints, 3, 3)), movable,
        )  # fmt: skip


class JointPoints(NamedTuple):
    """Points of joints."""

    bodies: Indices  # (j, 2) A and B; twice B for a joint to the world
    anchor: Array  # (j, 2, 3) in the body's axes, from the centre of mass; that of the world is in the world
    world: Mask  # (j,) joints to the world


@compiled()
def contact_rows(points: ContactPoints, bodies: Bodies, rows: Rows) -> None:
    """Write the rows of the contact points, which are the first of all."""
    inverse = _inverse_inertias(bodies, rows.movable)
    gram = np.empty((3, 3))
    for c in range(len(points.gap)):
        normal, axes = points.normal[c], rows.axes[c]
        least = 0
        for k in range(1, 3):
            if abs(normal[k]) < abs(normal[least]):
                least = k
        i, j = (least + 1) % 3, (least + 2) % 3
        size = np.sqrt(normal[i] ** 2 + normal[j] ** 2)
        axes[1, least], axes[1, i], axes[1, j] = 0.0, -normal[j] / size, normal[i] / size
        for k in range(3):
            axes[0, k] = normal[k]
            i, j = (k + 1) % 3, (k + 2) % 3
            axes[2, k] = normal[i] * axes[1, j] - normal[j] * axes[1, i]
        for side in range(2):
            body, sign = rows.bodies[c, side], 1.0 if side == 1 else -1.0
            for row in range(3):
                for k in range(3):
                    i, j = (k + 1) % 3, (k + 2) % 3
                    turn = (points.point[c, i] - bodies.position[body, i]) * axes[row, j]
                    turn -= (points.point[c, j] - bodies.position[body, j]) * axes[row, i]
                    rows.jacobian[c, row, 6 * side + k] = sign * axes[row, k]
                    rows.jacobian[c, row, 6 * side + 3 + k] = sign * turn
        _respond(c, bodies, inverse, rows, gram)
        mean = 0.5 * (gram[1, 1] + gram[2, 2])
        rows.mobility[c, 0], rows.mobility[c, 2], rows.mobility[c, 3] = gram[0, 0], gram[1, 0], gram[2, 0]
        rows.mobility[c, 1] = mean + np.sqrt((0.5 * (gram[1, 1] - gram[2, 2])) ** 2 + gram[1, 2] ** 2)


@compiled()
def joint_rows(points: JointPoints, bodies: Bodies, rows: Rows) -> None:
    """Write the rows of the joint points, which are the last of all."""
    inverse = _inverse_inertias(bodies, rows.movable)
    gram, lever = np.empty((3, 3)), np.empty(3)
    for number in range(len(points.bodies)):
        c = len(rows.bodies) - len(points.bodies) + number
        for side in range(2):
            sign = 1.0 if side == 1 else -1.0
            if side == 0 and points.world[number]:
                sign = 0.0
            _lever(points, number, side, bodies, lever)
            for row in range(3):
                i, j = (row + 1) % 3, (row + 2) % 3
                own = rows.jacobian[c, row, 6 * side : 6 * side + 6]
                own[:] = 0.0
                own[row] = sign
                own[3 + i] = sign * lever[j]  # the point's velocity along e is v . e + w . (r x e)
                own[3 + j] = -sign * lever[i]
        _respond(c, bodies, inverse, rows, gram)
        rows.mobility[c, :] = max(gram[0, 0], gram[1, 1], gram[2, 2])
        rows.effective_mass[number] = 0.0
        if rows.mobility[c, 0] > 0.0:
            invert(gram, rows.effective_mass[number])


@compiled()
def joint_gaps(points: JointPoints, bodies: Bodies, gap: Array) -> None:
    """Write the point of B seen from that of A (j, 3), metres."""
    lever = np.empty(3)
    for number in range(len(points.bodies)):
        gap[number] = 0.0
        for side in range(2):
            body, sign = points.bodies[number, side], 1.0 if side == 1 else -1.0
            _lever(points, number, side, bodies, lever)
            for k in range(3):
                centre = 0.0 if side == 0 and points.world[number] else bodies.position[body, k]
                gap[number, k] += sign * (lever[k] + centre)


@compiled(inner=True)
def _lever(points: JointPoints, number: int, side: int, bodies: Bodies, lever: Array) -> None:
    """Write a joint point (3,) along the world's axes, from the centre of mass, or where it is in the world."""
    body = points.bodies[number, side]
    for k in range(3):
        lever[k] = points.anchor[number, side, k]
        if side == 1 or not points.world[number]:
            lever[k] = 0.0
            for i in range(3):
                lever[k] += bodies.rotation[body, k, i] * points.anchor[number, side, i]


@compiled(inner=True)
def _inverse_inertias(bodies: Bodies, movable: Mask) -> Array:
    """Inverse inertias (n, 3, 3) along the world's axes; zero for bodies that nothing moves."""
    found = np.zeros((len(movable), 3, 3))
    half = np.empty(3)
    for b in range(len(movable)):
        if movable[b]:
            turned = bodies.rotation[b]
            for i in range(3):  # in loops: numba's matrix products load scipy.linalg
                for k in range(3):
                    half[k] = 0.0
                    for m in range(3):
                        half[k] += turned[i, m] * bodies.inverse[b, m, k]
                for j in range(3):
                    for k in range(3):
                        found[b, i, j] += half[k] * turned[j, k]
    return found


@compiled(inner=True)
def _respond(c: int, bodies: Bodies, inverse: Array, rows: Rows, gram: Array) -> None:
    """Write J M^-1 of a point, and J M^-1 J^T (3, 3)."""
    for side in range(2):
        body = rows.bodies[c, side]
        inverse_mass = 1.0 / bodies.mass[body] if rows.movable[body] else 0.0
        for row in range(3):
            own, result = rows.jacobian[c, row, 6 * side :], rows.response[c, row, 6 * side :]
            for k in range(3):
                result[k], result[3 + k] = inverse_mass * own[k], 0.0
                for i in range(3):
                    result[3 + k] += inverse[body, k, i] * own[3 + i]
    for row in range(3):
        for other in range(3):
            gram[row, other] = coupling(c, row, other, rows)


@compiled(inner=True)
def coupling(c: int, row: int, other: int, rows: Rows) -> float:
    """Change of the relative velocity along one axis of a point by a unit impulse along another."""
    total = 0.0
    for k in range(12):
        total += rows.jacobian[c, row, k] * rows.response[c, other, k]
    return total


@compiled(inner=True)
def relative(c: int, row: int, rows: Rows, twist: Array) -> float:
    """Velocity of B's point relative to A's along an axis of a point."""
    a, b = rows.bodies[c, 0], rows.bodies[c, 1]
    total = 0.0
    for k in range(6):
        total += rows.jacobian[c, row, k] * twist[a, k] + rows.jacobian[c, row, 6 + k] * twist[b, k]
    return total


@compiled(inner=True)
def push(c: int, row: int, impulse: float, rows: Rows, twist: Array) -> None:
    """Change the velocities by an impulse along an axis of a point: on B, and its opposite on A."""
    a, b = rows.bodies[c, 0], rows.bodies[c, 1]
    for k in range(6):
        twist[a, k] += impulse * rows.response[c, row, k]
        twist[b, k] += impulse * rows.response[c, row, 6 + k]


@compiled()
def rates(bodies: Indices, jacobian: Array, twist: Array, result: Array) -> None:
    """Write the relative velocities (m, 3) along the axes of all points."""
    # Arrays, not the record: numba needs four microseconds to recognise a record from Python.
    for c in range(len(bodies)):
        a, b = bodies[c, 0], bodies[c, 1]
        for row in range(3):
            total = 0.0
            for k in range(6):
                total += jacobian[c, row, k] * twist[a, k] + jacobian[c, row, 6 + k] * twist[b, k]
            result[c, row] = total
