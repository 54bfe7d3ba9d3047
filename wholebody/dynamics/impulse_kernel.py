"""The impulses of a figure's contacts and joint limits, as a compiled loop over a dense matrix of mobilities."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled


@compiled()
def solve(mobility: Array, velocity: Array, friction: Array, target: Array, most: int, tolerance: float) -> Array:
    """Impulses (m, 3) along the axes of m points, by Gauss and Seidel's method with projection.

    At every point 0 <= p_n is complementary to u_n - target >= 0, and p_t is at most friction p_n against the sliding.

    Args:
        mobility: (3 m, 3 m) change of the velocities by unit impulses.
        velocity: (3 m,) without impulses, m/s: along the normal, then two tangents. It becomes that with them.
        friction: (m,).
        target: (m,) least velocities along the normals, m/s.
        most: sweeps over all points.
        tolerance: change of all velocities in a sweep at which it ends, m/s.
    """
    count = len(friction)
    impulse = np.zeros((count, 3))
    for _ in range(most):
        largest = 0.0
        for c in range(count):
            for axis in range(3):
                row = 3 * c + axis
                own = mobility[row, row]
                if own <= 1e-12:
                    continue
                wanted = target[c] if axis == 0 else 0.0
                before = impulse[c, axis]
                after = before + (wanted - velocity[row]) / own
                if axis == 0:
                    after = max(0.0, after)
                else:
                    other = impulse[c, 3 - axis]
                    bound = np.sqrt(max(0.0, (friction[c] * impulse[c, 0]) ** 2 - other * other))
                    after = min(max(after, -bound), bound)
                change = after - before
                if change != 0.0:
                    impulse[c, axis] = after
                    largest = max(largest, abs(change) * own)
                    for k in range(3 * count):
                        velocity[k] += mobility[k, row] * change
        if largest < tolerance:
            break
    return impulse


@lru_cache(maxsize=1)
def compiled_kernel() -> SimpleNamespace:
    """Compile or load the loop."""
    solve(np.eye(3), np.zeros(3), np.zeros(1), np.zeros(1), 1, 1e-9)
    return SimpleNamespace(solve=solve)
