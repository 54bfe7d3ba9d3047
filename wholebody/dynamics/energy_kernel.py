"""The energy of a step, as compiled loops: what a program that is solved to a tolerance adds is taken away again.

With the velocities v before a step and v+ after its program, bodies on which a contact acts move by h v+, so their
energy changes by

    (v+^T M v+ - v^T M v) / 2 - h m g . v+ = p^T u - p^T J_g v_g - (v+ - v)^T M (v+ - v) / 2.

The laws of contact make p^T u at most zero, and p^T J_g v_g is the work of the bodies whose motion is given. A program
whose velocities u are wrong by its tolerance can add a little. Bodies that bear each other, an island, then get the
velocities

    v+ <- w + s (v+ - w),        0 <= s <= 1,

with the greatest s that adds no energy. w is zero for an island that rests on something fixed; for one that touches
nothing fixed it is the motion that the whole of it has as one rigid body, so momentum stays. Every u is scaled by s, so
what kept pieces apart still does.
"""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Array, Indices, Mask
from wholebody.compiled import compiled

FREE, FIXED, DRIVEN = 0, 1, 2  # an island that touches nothing else, something fixed, something that is moved


@compiled()
def momentum(rotation: Array, inertia: Array, spin: Array, result: Array) -> None:
    """Write the angular momentum R I R^T w (3,) of a body about its centre of mass."""
    local, turned = np.empty(3), np.empty(3)
    for i in range(3):
        local[i] = rotation[0, i] * spin[0] + rotation[1, i] * spin[1] + rotation[2, i] * spin[2]
    for i in range(3):
        turned[i] = inertia[i, 0] * local[0] + inertia[i, 1] * local[1] + inertia[i, 2] * local[2]
    for i in range(3):
        result[i] = rotation[i, 0] * turned[0] + rotation[i, 1] * turned[1] + rotation[i, 2] * turned[2]


@compiled()
def _kinetic(mass: float, rotation: Array, inertia: Array, twist: Array, turning: Array) -> float:
    momentum(rotation, inertia, twist[3:], turning)
    total = 0.0
    for k in range(3):
        total += mass * twist[k] * twist[k] + twist[3 + k] * turning[k]
    return 0.5 * total


@compiled()
def restrain(
    root: Indices,
    kind: Indices,
    chosen: Mask,
    mass: Array,
    inertia: Array,
    position: Array,
    rotation: Array,
    before: Array,
    twist: Array,
    fall: Array,
) -> None:
    """Scale velocities down where an island gained energy.

    Args:
        root: (n,) the island of each body.
        kind: (n,) `FREE`, `FIXED` or `DRIVEN` for each island.
        chosen: (n,) bodies on which a contact acts, of islands that nothing drives.
        mass: (n,).
        inertia: (n, 3, 3) in the bodies.
        position: (n, 3) centres of mass.
        rotation: (n, 3, 3).
        before: (n, 6) velocities before the step.
        twist: (n, 6) after its program; changed in place.
        fall: (3,) gravity times the time of the step, m/s.
    """
    count = len(root)
    gain, turning = np.zeros(count), np.empty(3)
    for b in range(count):
        if chosen[b]:
            lifted = 0.0
            for k in range(3):
                lifted -= mass[b] * fall[k] * twist[b, k]
            after = _kinetic(mass[b], rotation[b], inertia[b], twist[b], turning)
            gain[root[b]] += after + lifted - _kinetic(mass[b], rotation[b], inertia[b], before[b], turning)
    for island in range(count):
        if gain[island] > 0.0:
            _scale(
                island, kind[island] == FREE, gain[island], root, chosen, mass, inertia, position,
                rotation, twist, fall,
            )  # fmt: skip


@compiled()
def _scale(
    island: int,
    free: bool,
    excess: float,
    root: Indices,
    chosen: Mask,
    mass: Array,
    inertia: Array,
    position: Array,
    rotation: Array,
    twist: Array,
    fall: Array,
) -> None:
    """Take an energy from an island; arguments as in `restrain`."""
    whole, centre, spin = np.zeros(6), np.zeros(3), np.zeros(3)
    if free:
        _as_one(island, root, chosen, mass, inertia, position, rotation, twist, centre, whole, spin)
    # the energy of s is that of w, and with the other part of the velocities: s^2 square + s linear
    square, linear = 0.0, 0.0
    own, turning = np.empty(6), np.empty(3)
    for b in range(len(root)):
        if chosen[b] and root[b] == island:
            _seen(b, free, position, twist, centre, whole, own)
            square += _kinetic(mass[b], rotation[b], inertia[b], own, turning)
            for k in range(3):
                linear -= mass[b] * fall[k] * own[k]
    rest = excess - square - linear  # s^2 square + s linear + rest is to be zero, and is `excess` for s = 1
    share = 0.0
    if square > 0.0:
        root_of = linear * linear - 4.0 * square * rest
        if root_of > 0.0:
            share = min(1.0, max(0.0, (-linear + np.sqrt(root_of)) / (2.0 * square)))
    for b in range(len(root)):
        if chosen[b] and root[b] == island:
            _seen(b, free, position, twist, centre, whole, own)
            for k in range(6):
                twist[b, k] -= (1.0 - share) * own[k]


@compiled()
def _seen(b: int, free: bool, position: Array, twist: Array, centre: Array, whole: Array, own: Array) -> None:
    """Write the velocities (6,) of a body seen from the island that moves as one."""
    for k in range(6):
        own[k] = twist[b, k]
    if free:
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            carried = whole[3 + i] * (position[b, j] - centre[j]) - whole[3 + j] * (position[b, i] - centre[i])
            own[k] -= whole[k] + carried
            own[3 + k] -= whole[3 + k]


@compiled()
def _as_one(
    island: int,
    root: Indices,
    chosen: Mask,
    mass: Array,
    inertia: Array,
    position: Array,
    rotation: Array,
    twist: Array,
    centre: Array,
    whole: Array,
    spin: Array,
) -> None:
    """Write the centre of mass (3,) of an island, and its motion (6,) as one body with the same momentum."""
    total, turning, column = 0.0, np.zeros(3), np.empty(3)
    for b in range(len(root)):
        if chosen[b] and root[b] == island:
            total += mass[b]
            for k in range(3):
                centre[k] += mass[b] * position[b, k]
                whole[k] += mass[b] * twist[b, k]
    for k in range(3):
        centre[k] /= total
        whole[k] /= total
    gathered = np.zeros((3, 3))
    lever = np.empty(3)
    for b in range(len(root)):
        if chosen[b] and root[b] == island:
            momentum(rotation[b], inertia[b], twist[b, 3:], column)
            square = 0.0
            for k in range(3):
                lever[k] = position[b, k] - centre[k]
                square += lever[k] * lever[k]
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                turning[k] += column[k] + mass[b] * (lever[i] * twist[b, j] - lever[j] * twist[b, i])
            for i in range(3):
                spin[:] = 0.0
                spin[i] = 1.0
                momentum(rotation[b], inertia[b], spin, column)
                for k in range(3):
                    gathered[k, i] += column[k] - mass[b] * lever[k] * lever[i]
                gathered[i, i] += mass[b] * square
    determinant = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        determinant += gathered[0, k] * (gathered[1, i] * gathered[2, j] - gathered[1, j] * gathered[2, i])
    for row in range(3):  # by cofactors: numba's solver loads scipy.linalg
        for other in range(3):
            i, j = (other + 1) % 3, (other + 2) % 3
            k, m = (row + 1) % 3, (row + 2) % 3
            cofactor = gathered[i, k] * gathered[j, m] - gathered[i, m] * gathered[j, k]
            whole[3 + row] += cofactor / determinant * turning[other]
