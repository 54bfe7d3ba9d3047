"""The motion of rigid bodies during a step, as compiled loops.

The centre of mass goes straight, or along its parabola where no contact acts. The body turns about it with its angular
momentum constant: midpoint steps of the rotation (order 2), each followed by the least rotation that restores the
kinetic energy, so that momentum and energy of free bodies are constant to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled


class Bodies(NamedTuple):
    """The bodies of a scene."""

    mass: Array  # (n,) kg; infinite where nothing is known
    inertia: Array  # (n, 3, 3) about the centre of mass, along the body's axes
    inverse: Array  # (n, 3, 3) inverses of these
    position: Array  # (n, 3) centres of mass
    rotation: Array  # (n, 3, 3)
    twist: Array  # (n, 6) velocities of the centres and angular velocities along the world's axes, m/s and rad/s
    moving: Mask  # (n,) bodies that move by themselves, and do not sleep
    given: Mask  # (n,) bodies whose motion is given
    jointed: Mask  # (n,) bodies that have joints


@compiled(inner=True)
def exponential(turn: Array, rotation: Array) -> None:
    """Write the rotation (3, 3) by a rotation vector (3,)."""
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if angle < 1e-6:
        sine, versed = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    else:
        sine, versed = np.sin(angle) / angle, (1.0 - np.cos(angle)) / (angle * angle)
    for i in range(3):
        for j in range(3):
            rotation[i, j] = versed * turn[i] * turn[j]
        rotation[i, i] += 1.0 - versed * angle * angle
    rotation[0, 1] -= sine * turn[2]
    rotation[1, 0] += sine * turn[2]
    rotation[0, 2] += sine * turn[1]
    rotation[2, 0] -= sine * turn[1]
    rotation[1, 2] -= sine * turn[0]
    rotation[2, 1] += sine * turn[0]


@compiled(inner=True)
def _turned(turn: Array, rotation: Array, result: Array) -> None:
    """Write exp(turn) rotation."""
    by = np.empty((3, 3))
    exponential(turn, by)
    for i in range(3):
        for j in range(3):
            result[i, j] = by[i, 0] * rotation[0, j] + by[i, 1] * rotation[1, j] + by[i, 2] * rotation[2, j]


@compiled(inner=True)
def _spin(rotation: Array, inverse: Array, momentum: Array, spin: Array) -> None:
    """Write the angular velocity R I^-1 R^T L."""
    local, other = np.empty(3), np.empty(3)
    for i in range(3):
        local[i] = rotation[0, i] * momentum[0] + rotation[1, i] * momentum[1] + rotation[2, i] * momentum[2]
    for i in range(3):
        other[i] = inverse[i, 0] * local[0] + inverse[i, 1] * local[1] + inverse[i, 2] * local[2]
    for i in range(3):
        spin[i] = rotation[i, 0] * other[0] + rotation[i, 1] * other[1] + rotation[i, 2] * other[2]


@compiled(inner=True)
def angular_momentum(rotation: Array, inertia: Array, spin: Array, result: Array) -> None:
    """Write the angular momentum R I R^T w (3,) of a body about its centre of mass."""
    _spin(rotation, inertia, spin, result)


@compiled()
def turn_freely(rotation: Array, inertia: Array, inverse: Array, spin: Array, time: float) -> None:
    """Turn a free body for a time [s]: rotation (3, 3) and angular velocity (3,) in the world change in place."""
    speed = np.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    if speed < 1e-12:  # rad/s: no motion, whose axis would be 0 / 0
        return
    momentum, turn, middle, now = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    pull = np.empty(3)
    angular_momentum(rotation, inertia, spin, momentum)
    energy = momentum[0] * spin[0] + momentum[1] * spin[1] + momentum[2] * spin[2]
    steps = int(speed * time / 0.1) + 1  # rad of one midpoint step; smaller is more accurate and slower
    h = time / steps
    for _ in range(steps):
        for k in range(3):
            turn[k] = 0.5 * h * spin[k]
        _turned(turn, rotation, middle)
        _spin(middle, inverse, momentum, spin)
        for k in range(3):
            turn[k] = h * spin[k]
        _turned(turn, rotation, now)
        _spin(now, inverse, momentum, spin)
        for _ in range(2):  # Newton's steps along the gradient w x L of the energy
            change = energy - (momentum[0] * spin[0] + momentum[1] * spin[1] + momentum[2] * spin[2])
            square = 0.0
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                pull[k] = spin[i] * momentum[j] - spin[j] * momentum[i]
                square += pull[k] * pull[k]
            if square * h * h < 1e-20 * energy * energy or abs(change) < 1e-15 * energy:
                break
            for k in range(3):
                turn[k] = 0.5 * change / square * pull[k]
            _turned(turn, now, middle)
            _copy(middle, now)
            _spin(now, inverse, momentum, spin)
        _orthonormal(now)
        _copy(now, rotation)


@compiled(inner=True)
def invert(matrix: Array, result: Array) -> None:
    """Write the inverse (3, 3) of a matrix that has one, by cofactors: numba's solver loads scipy.linalg."""
    determinant = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        determinant += matrix[0, k] * (matrix[1, i] * matrix[2, j] - matrix[1, j] * matrix[2, i])
    for row in range(3):
        for column in range(3):
            i, j = (column + 1) % 3, (column + 2) % 3
            k, m = (row + 1) % 3, (row + 2) % 3
            result[row, column] = (matrix[i, k] * matrix[j, m] - matrix[i, m] * matrix[j, k]) / determinant


@compiled(inner=True)
def _orthonormal(rotation: Array) -> None:
    """Remove rounding from a rotation: one step of Newton's iteration for the polar factor."""
    product = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            product[i, j] = 0.0
            for k in range(3):
                product[i, j] += rotation[k, i] * rotation[k, j]
    before = rotation.copy()
    for i in range(3):
        for j in range(3):
            rotation[i, j] = 1.5 * before[i, j]
            for k in range(3):
                rotation[i, j] -= 0.5 * before[i, k] * product[k, j]


@compiled()
def drift(bodies: Bodies, pushed: Mask, gravity: Array, time: float) -> None:
    """Move bodies for a time [s] in place; pushed ones (n,) with the velocity at the end, others with the mean."""
    now, turn = np.empty((3, 3)), np.empty(3)
    for b in range(len(bodies.mass)):
        if not bodies.moving[b] and not bodies.given[b]:
            continue
        half = 0.0 if pushed[b] or bodies.given[b] else 0.5 * time * time
        for k in range(3):
            bodies.position[b, k] += time * bodies.twist[b, k] - half * gravity[k]
        if bodies.moving[b]:
            turn_freely(bodies.rotation[b], bodies.inertia[b], bodies.inverse[b], bodies.twist[b, 3:], time)
        else:
            for k in range(3):
                turn[k] = time * bodies.twist[b, 3 + k]
            _turned(turn, bodies.rotation[b], now)
            _copy(now, bodies.rotation[b])


@compiled(inner=True)
def _copy(source: Array, target: Array) -> None:
    """Copy a rotation number by number: for `target[:] = source` numba compiles how Python writes strings."""
    for i in range(3):
        for k in range(3):
            target[i, k] = source[i, k]


@compiled()
def kinetic(bodies: Bodies, chosen: Mask) -> float:
    """Kinetic energy of the chosen bodies (n,), joules."""
    total, momentum = 0.0, np.empty(3)
    for b in range(len(chosen)):
        if chosen[b]:
            angular_momentum(bodies.rotation[b], bodies.inertia[b], bodies.twist[b, 3:], momentum)
            for k in range(3):
                total += bodies.mass[b] * bodies.twist[b, k] ** 2 + momentum[k] * bodies.twist[b, 3 + k]
    return 0.5 * total


@compiled()
def travel(bodies: Bodies, lever: Array, gravity: Array, time: float) -> Array:
    """Most that a point of each body, its lever (n,) [m] from the centre of mass at most, moves in a time, metres."""
    found = np.empty(len(lever))
    fall = np.sqrt(gravity[0] ** 2 + gravity[1] ** 2 + gravity[2] ** 2) * time
    for b in range(len(lever)):
        speed, spin = 0.0, 0.0
        for k in range(3):
            speed += bodies.twist[b, k] ** 2
            spin += bodies.twist[b, 3 + k] ** 2
        found[b] = (np.sqrt(speed) + np.sqrt(spin) * lever[b] + (fall if bodies.moving[b] else 0.0)) * time
    return found


@compiled()
def displace(bodies: Bodies, way: Array) -> None:
    """Displace the bodies that move by themselves by (n, 6) metres and radians, in place."""
    now = np.empty((3, 3))
    for b in range(len(way)):
        if bodies.moving[b]:
            for k in range(3):
                bodies.position[b, k] += way[b, k]
            _turned(way[b, 3:], bodies.rotation[b], now)
            _copy(now, bodies.rotation[b])


@compiled()
def place_pieces(
    position: Array, rotation: Array, centre: Array, body: Indices, local: Array, placement: Array
) -> None:
    """Write where all pieces (pieces, 4, 3) are, with the centres of mass and placements in their bodies."""
    for p in range(len(body)):
        b = body[p]
        for row in range(4):
            for k in range(3):
                total = position[b, k] if row == 3 else 0.0
                for j in range(3):
                    part = local[p, row, j] - (centre[b, j] if row == 3 else 0.0)
                    total += rotation[b, k, j] * part
                placement[p, row, k] = total
