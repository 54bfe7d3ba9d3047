"""All frames of a fit at once: the errors of every frame, and the accelerations between them.

Gauss-Newton on the sum of the costs of all frames and of squared accelerations. The accelerations couple each frame
with the next two, so the matrix is banded and a step takes a time linear in the number of frames.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.linalg import LinAlgError, solveh_banded

from wholebody.base.arrays import Array, Mask
from wholebody.motion.posture_fit import Fitter, Goals

ACCELERATION = 1e-4
"""Weight of an acceleration, metres per radian a second squared: 900 rad/s² weigh as much as 90 mm."""

ROOT_ACCELERATION = 1e-4
"""Weight of an acceleration of the root, metres per metre (or radian) a second squared."""

CONE = 3.0
"""Weight of an angle outside of a reach cone, metres per radian."""

HELD = 1e6
"""Stiffness that keeps a joint at its limit during a step, square metres per squared radian."""

CORRECTIONS = 3
"""Most solutions of one step in which more joints are kept at their limits."""

DAMPING, WORSE, TRIALS = 3e-3, 10.0, 4
"""First damping, square metres per squared radian, its factor after a step that makes the sum greater, and most trials.

Where errors are left, their curvature is about the error times a limb's length, and Gauss-Newton leaves it out."""

PART, OVERLAP = 600, 60
"""Frames that are solved together, and by how many two parts overlap: memory grows with the first."""


def smooth(
    fitter: Fitter, q: Array, goals: Callable[[int], Goals], dt: float, iterations: int, told: Callable[[], None]
) -> Array:
    """The postures (n, nq) of least sum, by descent from q.

    Args:
        fitter: of the figure.
        q: (n, nq) where the descent begins, within the limits.
        goals: of each frame.
        dt: seconds from frame to frame.
        iterations: at most.
        told: called after each iteration.
    """
    if len(q) < 3:
        return q
    damping = DAMPING
    for _ in range(iterations):
        q, damping = _iteration(fitter, q, goals, dt, damping)
        told()
    return q


def _iteration(
    fitter: Fitter, q: Array, goals: Callable[[int], Goals], dt: float, damping: float
) -> tuple[Array, float]:
    """Better postures, and the damping for the next iteration."""
    model, count, size = fitter.model, len(q), fitter.model.nv
    weights = np.full(size, (ACCELERATION / dt**2) ** 2)
    if fitter.figure.root == "free":
        weights[:6] = (ROOT_ACCELERATION / dt**2) ** 2
    gradients, blocks = np.empty((count, size)), np.empty((count, size, size))
    before = np.empty(count)
    for k in range(count):
        gradients[k], blocks[k], before[k] = fitter.quadratic(q[k], goals(k), CONE)
    a = _second_differences(model, q)
    pulled = weights * a
    gradients[:-2] += pulled
    gradients[1:-1] -= 2.0 * pulled
    gradients[2:] += pulled
    lower, upper = (np.array(ends) for ends in zip(*(fitter.bounds(posture) for posture in q), strict=True))
    least = before.sum() + 0.5 * float((weights * a * a).sum())
    for _ in range(TRIALS):
        step = _bounded(blocks, gradients, weights, lower, upper, damping)
        trial = np.array([fitter.figure.clamp(pin.integrate(model, *pair)) for pair in zip(q, step, strict=True)])
        a = _second_differences(model, trial)
        cost = sum(fitter.cost(trial[k], goals(k), CONE) for k in range(count))
        if cost + 0.5 * float((weights * a * a).sum()) <= least:
            return trial, damping / WORSE
        damping *= WORSE
    return q, damping


def _second_differences(model: pin.Model, q: Array) -> Array:
    """(n - 2, nv) displacement to the next frame plus that to the one before."""
    found = np.empty((len(q) - 2, model.nv))
    for k in range(1, len(q) - 1):
        found[k - 1] = pin.difference(model, q[k], q[k + 1]) + pin.difference(model, q[k], q[k - 1])
    return found


def _bounded(blocks: Array, gradients: Array, weights: Array, lower: Array, upper: Array, damping: float) -> Array:
    """The step (n, nv) within bounds; those that it would exceed are met, and the rest is solved again."""
    fixed: Mask = np.zeros(gradients.shape, dtype=bool)
    at = np.zeros_like(gradients)
    step = at
    for _ in range(CORRECTIONS):
        step = _in_parts(blocks, gradients, weights, fixed, at, damping)
        beyond = ((step < lower) | (step > upper)) & ~fixed
        if not beyond.any():
            break
        fixed |= beyond
        at = np.where(fixed, np.clip(step, lower, upper), at)
    clipped: Array = np.clip(step, lower, upper)
    return clipped


def _in_parts(blocks: Array, gradients: Array, weights: Array, fixed: Mask, at: Array, damping: float) -> Array:
    """The step of all frames, from parts that overlap; in the middle of an overlap they are joined smoothly."""
    count = len(gradients)
    step, total = np.zeros_like(gradients), np.zeros(count)
    first = 0
    while True:
        last = min(count, first + PART)
        frames = slice(first, last)
        share = np.ones(last - first)
        if first:
            share[:OVERLAP] = np.linspace(0.0, 1.0, OVERLAP)
        if last < count:
            share[-OVERLAP:] = np.minimum(share[-OVERLAP:], np.linspace(1.0, 0.0, OVERLAP))
        part = _solved(blocks[frames], gradients[frames], weights, fixed[frames], at[frames], damping)
        step[frames] += share[:, None] * part
        total[frames] += share
        if last == count:
            return step / total[:, None]
        first = last - OVERLAP


def _solved(blocks: Array, gradients: Array, weights: Array, fixed: Mask, at: Array, damping: float) -> Array:
    """Solution of the banded system; what is fixed is held at its value."""
    count, size = gradients.shape
    stiff = np.where(fixed, HELD, 0.0)
    band = np.zeros((2 * size + 1, count * size))  # row d has the entries (i + d, i), as scipy's lower form
    for offset in range(size):
        diagonal = np.zeros((count, size))
        diagonal[:, : size - offset] = np.diagonal(blocks, offset, axis1=1, axis2=2)
        band[offset] = diagonal.ravel()
    own, one, two = np.zeros(count), np.zeros(count), np.zeros(count)
    own[:-2] += 1.0
    own[1:-1] += 4.0
    own[2:] += 1.0
    one[:-2] -= 2.0
    one[1:-1] -= 2.0
    two[:-2] = 1.0
    band[0] += (own[:, None] * weights + stiff + damping).ravel()
    band[size] += (one[:, None] * weights).ravel()
    band[2 * size] += (two[:, None] * weights).ravel()
    right = (stiff * at - gradients).ravel()
    try:
        found: Array = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    except LinAlgError:  # never where weights are finite and the damping is positive
        return np.zeros_like(gradients)
    return found.reshape(count, size)
