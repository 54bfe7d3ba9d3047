"""Rows of joints, as compiled loops: a joint point is one point of each of two bodies that stay together."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.dynamics.motion_kernel import invert


@compiled()
def place(
    bodies: Indices, anchor: Array, world: Mask, position: Array, rotation: Array, lever: Array, off: Array
) -> None:
    """Write where joint points are.

    Args:
        bodies: (j, 2) A and B; twice B for a joint to the world.
        anchor: (j, 2, 3) in the body's axes, from the centre of mass; that of the world is in the world.
        world: (j,) joints to the world.
        position: (n, 3) centres of mass.
        rotation: (n, 3, 3).
        lever: (j, 2, 3) room for the anchors from the centres of mass, along the world's axes.
        off: (j, 3) room for the point of B seen from that of A.
    """
    for c in range(len(bodies)):
        for k in range(3):
            off[c, k] = 0.0
        for side in range(2):
            body, sign = bodies[c, side], 1.0 if side == 1 else -1.0
            fixed = side == 0 and world[c]
            for k in range(3):
                total = anchor[c, side, k]
                if not fixed:
                    total = 0.0
                    for i in range(3):
                        total += rotation[body, k, i] * anchor[c, side, i]
                lever[c, side, k] = total
                off[c, k] += sign * (total if fixed else total + position[body, k])


@compiled()
def write_rows(
    bodies: Indices,
    world: Mask,
    lever: Array,
    inverse_mass: Array,
    inverse_inertia: Array,
    jacobian: Array,
    response: Array,
    mobility: Array,
    effective_mass: Array,
) -> None:
    """Write what the program needs of every joint point, whose rows are along the world's axes.

    Args:
        bodies: (j, 2).
        world: (j,).
        lever: (j, 2, 3).
        inverse_mass: (n,) zero for bodies that joints do not move.
        inverse_inertia: (n, 3, 3) along the world's axes.
        jacobian: (j, 3, 2, 6) room.
        response: (j, 3, 2, 6) room.
        mobility: (j, 2) room; zero where nothing moves.
        effective_mass: (j, 3, 3) room for the inverse of J M^-1 J^T; zero where nothing moves.
    """
    gram = np.zeros((3, 3))
    for c in range(len(bodies)):
        for side in range(2):
            body, sign = bodies[c, side], 1.0 if side == 1 else -1.0
            if side == 0 and world[c]:
                sign = 0.0
            for row in range(3):
                for k in range(6):
                    jacobian[c, row, side, k] = 0.0
                i, j = (row + 1) % 3, (row + 2) % 3
                jacobian[c, row, side, row] = sign
                # the point's velocity along e is v . e + w . (r x e)
                jacobian[c, row, side, 3 + i] = sign * lever[c, side, j]
                jacobian[c, row, side, 3 + j] = -sign * lever[c, side, i]
                for k in range(3):
                    response[c, row, side, k] = inverse_mass[body] * jacobian[c, row, side, k]
                    total = 0.0
                    for i in range(3):
                        total += inverse_inertia[body, k, i] * jacobian[c, row, side, 3 + i]
                    response[c, row, side, 3 + k] = total
        for row in range(3):
            for other in range(3):
                gram[row, other] = 0.0
                for side in range(2):
                    for k in range(6):
                        gram[row, other] += jacobian[c, row, side, k] * response[c, other, side, k]
        largest = max(gram[0, 0], gram[1, 1], gram[2, 2])
        mobility[c, 0], mobility[c, 1] = largest, largest
        effective_mass[c] = 0.0
        if largest > 0.0:
            invert(gram, effective_mass[c])
