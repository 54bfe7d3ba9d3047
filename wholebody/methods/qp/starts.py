"""Other postures to begin from when the first start leads to a local minimum."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from wholebody.methods.qp.quadratic_program import Array
from wholebody.problem import Problem

SPREADS = (0.3, 0.6, 1.0)  # share of each joint's range that a start may leave the first one by, in turn
ROOT_SPREAD = 0.2  # m and rad, likewise, for joints without limits


def restarts(problem: Problem, start: Array, rng: np.random.Generator, count: int) -> Iterator[Array]:
    """Postures within limits, farther and farther from the start.

    Args:
        problem: whose bounds are kept: frozen joints stay where they are.
        start: (nq,).
        rng: where the randomness comes from.
        count: how many.
    """
    figure, model = problem.scene.figure, problem.scene.model
    lower, upper = figure.tangent_bounds(start)
    span = np.where(np.isfinite(upper - lower), upper - lower, ROOT_SPREAD)
    state = problem.lineariser().state.update(start)
    for bound in problem.bounds:
        low, high = bound.bounds(state, None)
        lower, upper = np.maximum(lower, low), np.minimum(upper, high)
    for number in range(count):
        spread = SPREADS[number % len(SPREADS)]
        move = rng.uniform(-0.5, 0.5, model.nv) * spread * span
        yield figure.clamp(pin.integrate(model, start, np.clip(move, lower, upper)))
