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

Bodies with joints, and what something moved pushes, are settled after they have moved, when their energy and the work
on them are known: their velocities are scaled likewise. Joints without contacts keep their energy exactly.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.dynamics.contact_kernel import join
from wholebody.dynamics.motion_kernel import angular_momentum, invert

LARGEST = 1.05  # of s: an island with joints that hardly moves is not made to move by what rounding left
FREE, FIXED, DRIVEN = 0, 1, 2  # islands that touch nothing else, something fixed, something that is moved


@compiled(inner=True)
def _kinetic(mass: float, rotation: Array, inertia: Array, twist: Array, turning: Array) -> float:
    angular_momentum(rotation, inertia, twist[3:], turning)
    total = 0.0
    for k in range(3):
        total += mass * twist[k] * twist[k] + twist[3 + k] * turning[k]
    return 0.5 * total


@compiled(inner=True)
def _islands(
    bodies: Indices,
    impulse: Array,
    contacts: int,
    moving: Mask,
    given: Mask,
    pushed: Mask,
    root: Indices,
    kind: Indices,
) -> None:
    """Write which bodies a contact pushes, the island of each, and what the islands touch; see `restrain`."""
    bearing, count = np.empty(len(bodies), dtype=np.intp), 0
    kind[:], pushed[:] = FREE, False
    for c in range(len(bodies)):
        if c < contacts and impulse[c, 0] <= 0.0:
            continue
        bearing[count] = c
        count += 1
        if c < contacts:
            for side in range(2):
                pushed[bodies[c, side]] = moving[bodies[c, side]]
    join(bearing[:count], bodies, moving, root)
    for c in bearing[:count]:
        for side in range(2):
            own, other = bodies[c, side], bodies[c, 1 - side]
            if moving[own] and not moving[other]:
                kind[root[own]] = max(kind[root[own]], DRIVEN if given[other] else FIXED)
            elif moving[own] and own == other:  # a joint to the world
                kind[root[own]] = max(kind[root[own]], FIXED)


@compiled()
def restrain(
    bodies: Indices,
    impulse: Array,
    rate: Array,
    target: Array,
    unsolved: float,
    moving: Mask,
    given: Mask,
    jointed: Mask,
    mass: Array,
    inertia: Array,
    position: Array,
    rotation: Array,
    before: Array,
    twist: Array,
    fall: Array,
    jammed: Mask,
) -> None:
    """Scale velocities down where an island gained energy.

    Islands with joints, and those that something moved pushes, are settled after they have moved: see `settle`.

    Args:
        bodies: (m, 2) of all points, those of joints at the end.
        impulse: (m, 3) of the program.
        rate: (m, 3) of the points after it, m/s.
        target: (k,) least rates along the normals of the contact points, m/s.
        unsolved: how much a rate may be off, m/s.
        moving: (n,) bodies that move by themselves and do not sleep.
        given: (n,) bodies that are moved.
        jointed: (n,) bodies with joints.
        mass: (n,).
        inertia: (n, 3, 3) in the bodies.
        position: (n, 3) centres of mass.
        rotation: (n, 3, 3).
        before: (n, 6) velocities before the step.
        twist: (n, 6) after its program; changed in place.
        fall: (3,) gravity times the time of the step, m/s.
        jammed: (k,) room: points that bear something of islands that something moved pushes, where a rate is off.
    """
    count, contacts = len(moving), len(target)
    root, kind = np.empty(count, dtype=np.intp), np.empty(count, dtype=np.intp)
    chosen, off = np.empty(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    _islands(bodies, impulse, contacts, moving, given, chosen, root, kind)
    for c in range(contacts):
        jammed[c] = False
        if impulse[c, 0] > 0.0 and abs(rate[c, 0] - target[c]) > unsolved:
            off[root[bodies[c, 0] if moving[bodies[c, 0]] else bodies[c, 1]]] = True
    for c in range(contacts):
        if impulse[c, 0] > 0.0:
            island = root[bodies[c, 0] if moving[bodies[c, 0]] else bodies[c, 1]]
            jammed[c] = off[island] and kind[island] == DRIVEN
    for b in range(count):
        if jointed[b]:
            kind[root[b]] = DRIVEN
    gain, turning = np.zeros(count), np.empty(3)
    for b in range(count):
        if chosen[b] and kind[root[b]] != DRIVEN:
            lifted = 0.0
            for k in range(3):
                lifted -= mass[b] * fall[k] * twist[b, k]
            after = _kinetic(mass[b], rotation[b], inertia[b], twist[b], turning)
            gain[root[b]] += after + lifted - _kinetic(mass[b], rotation[b], inertia[b], before[b], turning)
    for island in range(count):
        if gain[island] > 0.0:
            _scale(
                island, kind[island] == FREE, gain[island], 1.0, root, chosen, mass, inertia, position, rotation, twist,
                fall,
            )  # fmt: skip


@compiled()
def settle(
    bodies: Indices,
    impulse: Array,
    work: Array,
    contacts: int,
    moving: Mask,
    given: Mask,
    jointed: Mask,
    mass: Array,
    inertia: Array,
    position: Array,
    rotation: Array,
    twist: Array,
    old_position: Array,
    old_rotation: Array,
    old_twist: Array,
    gravity: Array,
) -> None:
    """Scale the velocities of islands with joints, and of those that something moved pushes, after a step.

    Afterwards they have no more energy than before the step and the work on them, and joints without contacts neither
    less.

    Args:
        bodies: (m, 2) of all points, those of joints after the `contacts` of contacts.
        impulse: (m, 3) of the program.
        work: (m,) of what is moved at each point, joules.
        contacts: how many points are those of contacts.
        moving: (n,) bodies that move by themselves and do not sleep.
        given: (n,) bodies that are moved.
        jointed: (n,) bodies with joints.
        mass: (n,).
        inertia: (n, 3, 3) in the bodies.
        position: (n, 3) centres of mass after the step.
        rotation: (n, 3, 3).
        twist: (n, 6) changed in place.
        old_position: (n, 3) before the step.
        old_rotation: (n, 3, 3).
        old_twist: (n, 6).
        gravity: (3,) m/s2.
    """
    count = len(moving)
    root, kind = np.empty(count, dtype=np.intp), np.empty(count, dtype=np.intp)
    pushed, linked = np.empty(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    _islands(bodies, impulse, contacts, moving, given, pushed, root, kind)
    gain, touched, turning = np.zeros(count), np.zeros(count, dtype=np.bool_), np.empty(3)
    for c in range(len(bodies)):
        if c >= contacts or impulse[c, 0] > 0.0:
            gain[root[bodies[c, 0] if moving[bodies[c, 0]] else bodies[c, 1]]] -= work[c]
    for b in range(count):
        if moving[b]:
            linked[root[b]] |= jointed[b]
            touched[root[b]] |= pushed[b]
            gain[root[b]] += _kinetic(mass[b], rotation[b], inertia[b], twist[b], turning)
            gain[root[b]] -= _kinetic(mass[b], old_rotation[b], inertia[b], old_twist[b], turning)
            for k in range(3):
                gain[root[b]] -= mass[b] * gravity[k] * (position[b, k] - old_position[b, k])
    still = np.zeros(3)
    for island in range(count):
        keeps = linked[island] and not touched[island]
        if keeps or (gain[island] > 0.0 and (linked[island] or kind[island] == DRIVEN)):
            _scale(
                island, kind[island] == FREE, gain[island], LARGEST if keeps else 1.0, root, moving, mass, inertia,
                position, rotation, twist, still,
            )  # fmt: skip


@compiled(inner=True)
def _scale(
    island: int,
    free: bool,
    excess: float,
    most: float,
    root: Indices,
    chosen: Mask,
    mass: Array,
    inertia: Array,
    position: Array,
    rotation: Array,
    twist: Array,
    fall: Array,
) -> None:
    """Take an energy from an island, by a share `s` of at most `most`; other arguments as in `restrain`."""
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
            share = min(most, max(0.0, (-linear + np.sqrt(root_of)) / (2.0 * square)))
    for b in range(len(root)):
        if chosen[b] and root[b] == island:
            _seen(b, free, position, twist, centre, whole, own)
            for k in range(6):
                twist[b, k] -= (1.0 - share) * own[k]


@compiled(inner=True)
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


@compiled(inner=True)
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
            angular_momentum(rotation[b], inertia[b], twist[b, 3:], column)
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
                angular_momentum(rotation[b], inertia[b], spin, column)
                for k in range(3):
                    gathered[k, i] += column[k] - mass[b] * lever[k] * lever[i]
                gathered[i, i] += mass[b] * square
    inverse = np.empty((3, 3))
    invert(gathered, inverse)
    for row in range(3):
        for k in range(3):
            whole[3 + row] += inverse[row, k] * turning[k]
