"""The impulses of a figure's contacts and joint limits, as a compiled loop over a dense matrix of mobilities."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled, with_loops
from wholebody.dynamics.solve_kernel import FAST, along_way


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _push(row: int, one: float, two: float, three: float, mobility: Array, velocity: Array) -> None:
    """Change all velocities by an impulse at the point of three rows; the matrix is symmetric, and read by rows."""
    for k in range(len(velocity)):
        velocity[k] += mobility[row, k] * one + mobility[row + 1, k] * two + mobility[row + 2, k] * three


@compiled(error_model="numpy", fastmath=FAST)
def solve(mobility: Array, velocity: Array, friction: Array, target: Array, most: int, tolerance: float) -> Array:
    """Impulses (m, 3) along the axes of m points, by the method of `solve_kernel`, both axes of friction together.

    At every point 0 <= p_n is complementary to u_n - target >= 0, and p_t is at most friction p_n against the sliding.

    Args:
        mobility: (3 m, 3 m) change of the velocities by unit impulses.
        velocity: (3 m,) without impulses, m/s: along the normal, then two tangents. It becomes that with them.
        friction: (m,).
        target: (m,) least velocities along the normals, m/s.
        most: sweeps over all points.
        tolerance: change of all velocities at which it ends, in two sweeps, one each way, m/s.
    """
    count = len(friction)
    impulse, before, way = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    last, calm = np.inf, 0
    for sweep in range(most):
        largest, square = 0.0, 0.0
        for c in range(count):
            before[c, 0], before[c, 1], before[c, 2] = impulse[c, 0], impulse[c, 1], impulse[c, 2]
        for number in range(count):
            c = number if sweep % 2 == 0 else count - 1 - number
            row = 3 * c
            own, held = mobility[row, row], impulse[c, 0]
            now = max(0.0, held + (target[c] - velocity[row]) / own)
            if own <= 1e-12 or (now == 0.0 and held == 0.0):
                continue
            step, one, two = now - held, 0.0, 0.0
            # one step along both axes, with a bound of the mobility along any; 0 where nothing moves along them
            side = max(mobility[row + 1, row + 1], mobility[row + 2, row + 2]) + abs(mobility[row + 1, row + 2])
            if friction[c] > 0.0 and side > 1e-12:
                one = impulse[c, 1] - (velocity[row + 1] + mobility[row + 1, row] * step) / side
                two = impulse[c, 2] - (velocity[row + 2] + mobility[row + 2, row] * step) / side
                size, bound = np.sqrt(one * one + two * two), friction[c] * now
                if size > bound:
                    one, two = one * (bound / size), two * (bound / size)
                one, two = one - impulse[c, 1], two - impulse[c, 2]
            impulse[c, 0] = now
            impulse[c, 1] += one
            impulse[c, 2] += two
            largest = max(largest, abs(step) * own, max(abs(one), abs(two)) * side)
            square += step * step * own + (one * one + two * two) * side
            _push(row, step, one, two, mobility, velocity)
        calm = calm + 1 if largest < tolerance else 0
        if calm == 2 or sweep == most - 1:
            break
        share, last = square / last, square
        for c in range(count):
            step, one, two = along_way(share, way[c], impulse[c], before[c])
            if step != 0.0 or one != 0.0 or two != 0.0:
                _push(3 * c, step, one, two, mobility, velocity)
    return impulse


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """The loop."""
    solve(np.eye(3), np.zeros(3), np.zeros(1), np.zeros(1), 1, 1e-9)
