"""The impulses of a figure's contacts and joint limits, as a compiled loop over velocities of joints and things."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled, with_loops
from wholebody.dynamics.solve_kernel import FAST, Limits, along_way

LIMITS = Limits(1e-6, 1000)  # m/s, sweeps: with 300 a rod that rests on two boxes rolls on by 3e-3 rad/s


def impulses(jacobian: Array, inverse: Array, speed: Array, friction: Array, target: Array) -> tuple[Array, Array]:
    """Impulses (m, 3) and the change (n,) of velocities by them, see `solve`; `inverse` (n, n) is that of the inertia.

    Only few of many points bear anything. So the program is that of points that would come too fast, then with those
    that come too fast after it.
    """
    impulse, change = np.zeros((len(target), 3)), np.zeros(len(inverse))
    chosen, coming = np.zeros(len(target), dtype=bool), speed[::3] < target - LIMITS.tolerance
    while (coming & ~chosen).any():
        chosen |= coming
        rows, part = np.repeat(chosen, 3), impulse[chosen]
        moves = jacobian[rows]
        change = solve(moves, moves @ inverse, speed[rows], friction[chosen], target[chosen], part, LIMITS)
        impulse[chosen] = part
        coming = speed[::3] + jacobian[::3] @ change < target - LIMITS.tolerance
    return impulse, change


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _rate(row: int, jacobian: Array, change: Array) -> float:
    total = 0.0
    for k in range(len(change)):
        total += jacobian[row, k] * change[k]
    return total


@compiled(error_model="numpy", fastmath=FAST, inline="always")
def _push(row: int, one: float, two: float, three: float, response: Array, change: Array) -> None:
    """Change all velocities by an impulse at the point of three rows."""
    for k in range(len(change)):
        change[k] += response[row, k] * one + response[row + 1, k] * two + response[row + 2, k] * three


@compiled(error_model="numpy", fastmath=FAST)
def solve(
    jacobian: Array, response: Array, speed: Array, friction: Array, target: Array, impulse: Array, limits: Limits
) -> Array:
    """Find the impulses along the axes of m points, by the method of `solve_kernel`, both axes of friction together.

    At every point 0 <= p_n is complementary to u_n - target >= 0, and p_t is at most friction p_n against the sliding.
    Returns the change (n,) of the velocities of joints and things by the impulses.

    Args:
        jacobian: (3 m, n) velocities at the points by those of joints and things: along the normal, then two tangents.
        response: (3 m, n) change of the latter by unit impulses.
        speed: (3 m,) the former without impulses, m/s.
        friction: (m,).
        target: (m,) least velocities along the normals, m/s.
        impulse: (m, 3) from which it starts, N s; changed in place.
        limits: where it ends.
    """
    count = len(friction)
    before, way = np.zeros((count, 3)), np.zeros((count, 3))
    change, mobility = np.zeros(jacobian.shape[1]), np.zeros((count, 4))
    for c in range(count):
        row = 3 * c
        # with a bound of the mobility along any tangent
        crossed = _rate(row + 1, jacobian, response[row + 2])
        one, two = _rate(row + 1, jacobian, response[row + 1]), _rate(row + 2, jacobian, response[row + 2])
        mobility[c, 0], mobility[c, 1] = _rate(row, jacobian, response[row]), max(one, two) + abs(crossed)
        mobility[c, 2], mobility[c, 3] = (
            _rate(row + 1, jacobian, response[row]), _rate(row + 2, jacobian, response[row]),
        )  # fmt: skip
        _push(row, impulse[c, 0], impulse[c, 1], impulse[c, 2], response, change)
    last, calm = np.inf, 0
    for sweep in range(limits.sweeps):
        largest, square = 0.0, 0.0
        for c in range(count):
            before[c, 0], before[c, 1], before[c, 2] = impulse[c, 0], impulse[c, 1], impulse[c, 2]
        for number in range(count):
            c = number if sweep % 2 == 0 else count - 1 - number
            row, own, side, held = 3 * c, mobility[c, 0], mobility[c, 1], impulse[c, 0]
            if own <= 1e-12:
                continue
            now = max(0.0, held + (target[c] - speed[row] - _rate(row, jacobian, change)) / own)
            if now == 0.0 and held == 0.0:
                continue
            step, one, two = now - held, 0.0, 0.0
            # one step along both axes; 0 where nothing moves along them
            if friction[c] > 0.0 and side > 1e-12:
                one = speed[row + 1] + _rate(row + 1, jacobian, change) + mobility[c, 2] * step
                two = speed[row + 2] + _rate(row + 2, jacobian, change) + mobility[c, 3] * step
                one, two = impulse[c, 1] - one / side, impulse[c, 2] - two / side
                size, bound = np.sqrt(one * one + two * two), friction[c] * now
                if size > bound:
                    one, two = one * (bound / size), two * (bound / size)
                one, two = one - impulse[c, 1], two - impulse[c, 2]
            impulse[c, 0] = now
            impulse[c, 1] += one
            impulse[c, 2] += two
            largest = max(largest, abs(step) * own, max(abs(one), abs(two)) * side)
            square += step * step * own + (one * one + two * two) * side
            _push(row, step, one, two, response, change)
        calm = calm + 1 if largest < limits.tolerance else 0
        if calm == 2 or sweep == limits.sweeps - 1:
            break
        share, last = square / last, square
        for c in range(count):
            step, one, two = along_way(share, way[c], impulse[c], before[c])
            if step != 0.0 or one != 0.0 or two != 0.0:
                _push(3 * c, step, one, two, response, change)
    return change


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """The loop."""
    solve(np.eye(3), np.eye(3), np.zeros(3), np.zeros(1), np.zeros(1), np.zeros((1, 3)), Limits(1.0, 1))
