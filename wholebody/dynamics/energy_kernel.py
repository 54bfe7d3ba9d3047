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
from wholebody.dynamics.motion_kernel import Bodies, angular_momentum, invert
from wholebody.dynamics.solve_kernel import join

FREE, FIXED, DRIVEN = 0, 1, 2  # islands that touch nothing else, something fixed, something that is moved


@compiled(inner=True)
def _kinetic(b: int, bodies: Bodies, rotation: Array, twist: Array, turning: Array) -> float:
    """Kinetic energy of a body with a rotation (3, 3) and velocities (6,), joules."""
    angular_momentum(rotation, bodies.inertia[b], twist[3:], turning)
    total = 0.0
    for k in range(3):
        total += bodies.mass[b] * twist[k] * twist[k] + twist[3 + k] * turning[k]
    return 0.5 * total


@compiled(inner=True)
def _islands(
    points: Indices, impulse: Array, contacts: int, bodies: Bodies, movable: Mask
) -> tuple[Indices, Indices, Mask]:
    """The island (n,) of each body, what that touches, and which bodies a contact pushes; see `restrain`."""
    count = len(bodies.mass)
    root, kind = np.empty(count, dtype=np.intp), np.full(count, FREE, dtype=np.intp)
    pushed, moving = np.zeros(count, dtype=np.bool_), bodies.moving
    bearing, number = np.empty(len(points), dtype=np.intp), 0
    for c in range(len(points)):
        if c < contacts and impulse[c, 0] <= 0.0:
            continue
        bearing[number] = c
        number += 1
        if c < contacts:
            for side in range(2):
                pushed[points[c, side]] = moving[points[c, side]]
    join(bearing[:number], points, movable, root)  # what yields passes energy from one body to another
    for c in bearing[:number]:
        for side in range(2):
            own, other = points[c, side], points[c, 1 - side]
            if moving[own] and not moving[other]:
                kind[root[own]] = max(kind[root[own]], DRIVEN if bodies.given[other] else FIXED)
            elif moving[own] and own == other:  # a joint to the world
                kind[root[own]] = max(kind[root[own]], FIXED)
    return root, kind, pushed


@compiled(inner=True)
def _owner(points: Indices, c: int, bodies: Bodies, root: Indices) -> int:
    a, b = points[c, 0], points[c, 1]
    return int(root[a if bodies.moving[a] else b])


@compiled()
def restrain(
    points: Indices,
    impulse: Array,
    off: Mask,
    bodies: Bodies,
    movable: Mask,
    before: Array,
    fall: Array,
    jammed: Mask,
) -> None:
    """Scale velocities down where an island gained energy, and write which points are jammed.

    Islands with joints, and those that something moved pushes, are settled after they have moved: see `settle`.
    `points` (m, 2) and `impulse` (m, 3) are of all points, joints last; `off` (k,) contact points whose rates the
    program did not reach; `movable` (n,) what it moves; `before` (n, 6) velocities; `fall` (n, 3) what weight added,
    m/s; `jammed` (k,) room for contact points that bear something of pushed islands where a rate is off.
    """
    root, kind, pushed = _islands(points, impulse, len(off), bodies, movable)
    _find_jammed(points, impulse, off, bodies, root, kind, jammed)
    count, twist = len(root), bodies.twist
    for b in range(count):
        if bodies.jointed[b]:
            kind[root[b]] = DRIVEN
    gain, turning = np.zeros(count), np.empty(3)
    for b in range(count):
        if pushed[b] and kind[root[b]] != DRIVEN:
            lifted = 0.0
            for k in range(3):
                lifted -= bodies.mass[b] * fall[b, k] * twist[b, k]
            after = _kinetic(b, bodies, bodies.rotation[b], twist[b], turning)
            gain[root[b]] += after + lifted - _kinetic(b, bodies, bodies.rotation[b], before[b], turning)
    inside = np.empty(count, dtype=np.bool_)
    for island in range(count):
        if gain[island] > 0.0:
            _choose(pushed, root, island, inside)
            _take(inside, kind[island] == FREE, gain[island], 1.0, bodies, fall)


@compiled()
def settle(
    points: Indices,
    impulse: Array,
    work: Array,
    contacts: int,
    bodies: Bodies,
    movable: Mask,
    before: tuple[Array, Array, Array],
    gravity: Array,
) -> None:
    """Scale velocities of islands with joints, or pushed, to the energy before the step and the work (m,) on them."""
    # The first `contacts` points are contacts; `before` are positions, rotations and velocities.
    root, kind, pushed = _islands(points, impulse, contacts, bodies, movable)
    count, moving = len(root), bodies.moving
    linked, touched = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    gain, turning = np.zeros(count), np.empty(3)
    position, rotation, twist = before
    for c in range(len(points)):
        if c >= contacts or impulse[c, 0] > 0.0:
            gain[_owner(points, c, bodies, root)] -= work[c]
    for b in range(count):
        if moving[b]:
            linked[root[b]] |= bodies.jointed[b]
            touched[root[b]] |= pushed[b]
            gain[root[b]] += _kinetic(b, bodies, bodies.rotation[b], bodies.twist[b], turning)
            gain[root[b]] -= _kinetic(b, bodies, rotation[b], twist[b], turning)
            for k in range(3):
                gain[root[b]] -= bodies.mass[b] * gravity[k] * (bodies.position[b, k] - position[b, k])
    still, inside = np.zeros((count, 3)), np.empty(count, dtype=np.bool_)
    for island in range(count):
        keeps = linked[island] and not touched[island]
        if keeps or (gain[island] > 0.0 and (linked[island] or kind[island] == DRIVEN)):
            _choose(moving, root, island, inside)
            # an island with joints that hardly moves is not made to move by what rounding left
            _take(inside, kind[island] == FREE, gain[island], 1.05 if keeps else 1.0, bodies, still)


@compiled(inner=True)
def _find_jammed(
    points: Indices, impulse: Array, off: Mask, bodies: Bodies, root: Indices, kind: Indices, jammed: Mask
) -> None:
    unsolved = np.zeros(len(root), dtype=np.bool_)
    for c in range(len(off)):
        if impulse[c, 0] > 0.0 and off[c]:
            unsolved[_owner(points, c, bodies, root)] = True
    for c in range(len(off)):
        island = _owner(points, c, bodies, root)
        jammed[c] = impulse[c, 0] > 0.0 and unsolved[island] and kind[island] == DRIVEN


@compiled(inner=True)
def _choose(among: Mask, root: Indices, island: int, inside: Mask) -> None:
    """Write which bodies (n,) of an island are among others."""
    for b in range(len(root)):  # in loops: numba's array functions load scipy.linalg
        inside[b] = among[b] and root[b] == island


@compiled(inner=True)
def _take(inside: Mask, free: bool, excess: float, most: float, bodies: Bodies, fall: Array) -> None:
    """Take an energy from an island, the bodies `inside` (n,), by a share `s` of at most `most`."""
    whole, centre = np.zeros(6), np.zeros(3)
    if free:
        _as_one(inside, bodies, centre, whole)
    # the energy of s is that of w, and with the other part of the velocities: s^2 square + s linear
    square, linear = 0.0, 0.0
    own, turning = np.empty(6), np.empty(3)
    for b in range(len(inside)):
        if not inside[b]:
            continue
        _seen(b, bodies, centre, whole, own)
        square += _kinetic(b, bodies, bodies.rotation[b], own, turning)
        for k in range(3):
            linear -= bodies.mass[b] * fall[b, k] * own[k]
    rest = excess - square - linear  # s^2 square + s linear + rest is to be zero, and is `excess` for s = 1
    share, root_of = 0.0, linear * linear - 4.0 * square * rest
    if square > 0.0 and root_of > 0.0:
        share = min(most, max(0.0, (-linear + np.sqrt(root_of)) / (2.0 * square)))
    for b in range(len(inside)):
        if not inside[b]:
            continue
        _seen(b, bodies, centre, whole, own)
        for k in range(6):
            bodies.twist[b, k] -= (1.0 - share) * own[k]


@compiled(inner=True)
def _seen(b: int, bodies: Bodies, centre: Array, whole: Array, own: Array) -> None:
    """Write the velocities (6,) of a body less those of the motion `whole` (6,) about `centre` (3,)."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        carried = whole[3 + i] * (bodies.position[b, j] - centre[j]) - whole[3 + j] * (
            bodies.position[b, i] - centre[i]
        )
        own[k] = bodies.twist[b, k] - whole[k] - carried
        own[3 + k] = bodies.twist[b, 3 + k] - whole[3 + k]


@compiled(inner=True)
def _as_one(inside: Mask, bodies: Bodies, centre: Array, whole: Array) -> None:
    """Write the centre of mass (3,) of an island, and its motion (6,) as one body with the same momentum."""
    total, turning, column, spin = 0.0, np.zeros(3), np.empty(3), np.zeros(3)
    for b in range(len(inside)):
        if not inside[b]:
            continue
        total += bodies.mass[b]
        for k in range(3):
            centre[k] += bodies.mass[b] * bodies.position[b, k]
            whole[k] += bodies.mass[b] * bodies.twist[b, k]
    for k in range(3):
        centre[k] /= total
        whole[k] /= total
    gathered, inverse, lever = np.zeros((3, 3)), np.empty((3, 3)), np.empty(3)
    for b in range(len(inside)):
        if not inside[b]:
            continue
        mass, twist = bodies.mass[b], bodies.twist[b]
        angular_momentum(bodies.rotation[b], bodies.inertia[b], twist[3:], column)
        square = 0.0
        for k in range(3):
            lever[k] = bodies.position[b, k] - centre[k]
            square += lever[k] * lever[k]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            turning[k] += column[k] + mass * (lever[i] * twist[j] - lever[j] * twist[i])
        for i in range(3):
            spin[:] = 0.0
            spin[i] = 1.0
            angular_momentum(bodies.rotation[b], bodies.inertia[b], spin, column)
            for k in range(3):
                gathered[k, i] += column[k] - mass * lever[k] * lever[i]
            gathered[i, i] += mass * square
    invert(gathered, inverse)
    for row in range(3):
        for k in range(3):
            whole[3 + row] += inverse[row, k] * turning[k]
