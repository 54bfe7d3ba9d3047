"""One branch of an arm whose closed form holds a joint, as a curve over that joint: see `closed_form_kernel`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.compiled import compiled
from wholebody.methods.qp.closed_form_kernel import BRANCHES, SLACK, Arm, branches, within
from wholebody.methods.qp.dense_kernel import copy


@compiled(error_model="numpy")
def along(
    arm: Arm, goal: Array, limits: tuple[Array, Array], nearest: Array, spacing: float, q: Array
) -> float:  # fmt: skip
    """Go along a branch of an arm with a held joint to the least effort, by golden sections over that joint.

    `goal` and `nearest` as in `branches` and `sampled`; `limits` (n,) each; q (n,) a posture of the branch, written:
    that of the least effort. The effort; inf, with q as it was, where there is none.
    """
    joint, golden = arm.joints[arm.held], 0.5 * (np.sqrt(5.0) - 1.0)
    low, high, best, end = q[joint] - spacing, q[joint] + spacing, np.inf, q.copy()
    at, effort, posture = np.empty(2), np.empty(2), np.empty((2, len(q)))
    at[0], at[1] = high - golden * (high - low), low + golden * (high - low)
    for side in range(2):
        effort[side] = beside(arm, goal, limits, nearest, at[side], q, posture[side])
    while high - low > 1e-6:
        new = 0 if effort[0] <= effort[1] else 1
        if new == 0:
            high, at[1], effort[1] = at[1], at[0], effort[0]
            copy(posture[0], posture[1])
            at[0] = high - golden * (high - low)
        else:
            low, at[0], effort[0] = at[0], at[1], effort[1]
            copy(posture[1], posture[0])
            at[1] = low + golden * (high - low)
        effort[new] = beside(arm, goal, limits, nearest, at[new], q, posture[new])
    for side in range(2):
        if effort[side] < best:
            best = effort[side]
            copy(posture[side], end)
    copy(end, q)
    return best


@compiled(error_model="numpy")
def beside(
    arm: Arm, goal: Array, limits: tuple[Array, Array], nearest: Array, value: float, q: Array, posture: Array
) -> float:  # fmt: skip
    """Effort of the branch nearest to q (n,), written, where the held joint has a value; inf if over a radian off."""
    found, best, chosen = np.empty((1, BRANCHES, len(q))), np.inf, -1
    branches(arm, goal, np.array([value]), found)
    for b in range(BRANCHES):
        effort, away = within(found[0, b], limits[0], limits[1], nearest, SLACK), 0.0
        for i in range(len(q)):
            away = max(away, abs(found[0, b, i] - q[i]))
        if effort < np.inf and away < min(best, 1.0):
            best, chosen, most = away, b, effort
    if chosen < 0:
        return np.inf
    copy(found[0, chosen], posture)
    return most
