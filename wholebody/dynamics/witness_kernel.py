"""Which witness points of contacts bear nothing that the ends of their patches do not bear, as a compiled loop.

The load of a face on a face has many solutions at its ends and at a witness point between them, and the program finds
that of the points that it visits first: the witness point under the centre of a box bore all of it, and friction at a
single point does not turn or stop a box that spins. So the ends alone bear it, as between boxes in Bullet,
MuJoCo and ODE. A witness point that is an end itself has no other row, and stays.
"""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled


@compiled()
def needed(contact: Indices, count: int, normal: Array, point: Array, gap: Array, within: float) -> Mask:
    """All points (m,) but the witness points between ends of their patch that touch when they do.

    First come the witness points of all `count` contacts, then the ends, sorted by contact. Ends count whose gap is
    larger than that of the witness point by no more than `within` [m].
    """
    found, first, arm = np.ones(len(contact), dtype=np.bool_), count, np.empty((len(contact) - count, 3))
    while first < len(contact):
        c, arms, last = contact[first], 0, first
        while last < len(contact) and contact[last] == c:
            if gap[last] - gap[c] <= within:
                for k in range(3):
                    arm[arms, k] = point[last, k] - point[c, k]
                arms += 1
            last += 1
        found[c] = not _surrounded(arm[:arms], normal[c])
        first = last
    return found


@compiled(inner=True)
def _surrounded(arm: Array, normal: Array) -> bool:
    """Whether the origin is between points (k, 3) of a plane: seen from it, each has another half a turn on or more."""
    for one in arm:
        found = False
        for other in arm:
            cross, dot, square, other_square = 0.0, 0.0, 0.0, 0.0
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                cross += normal[k] * (one[i] * other[j] - one[j] * other[i])
                dot += one[k] * other[k]
                square += one[k] * one[k]
                other_square += other[k] * other[k]
            straight = 1e-3 * np.sqrt(square * other_square)  # on a line with the origin, but for coal's accuracy
            if cross < -straight or (cross <= straight and dot < 0.0):
                found = True
                break
        if not found:
            return False
    return len(arm) > 0
