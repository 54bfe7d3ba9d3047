"""Other postures to begin from when the first start leads to a local minimum."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wholebody.methods.qp.quadratic_program import Array
from wholebody.problem import Problem

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure

SPREADS = (0.3, 0.6, 1.0)  # share of each joint's range that a start may leave the first one by, in turn
AT_LIMIT = 0.02  # rad: nearer to its limit than this a joint counts as at it
BEND = 0.3  # rad: by which it is then moved off
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
    if count:
        # straight limbs at their limits hide what bending them would do: begin with all of them a little bent
        yield figure.clamp(pin.integrate(model, start, np.clip(_inward(start, figure), lower, upper)))
    for number in range(count - 1):
        spread = SPREADS[number % len(SPREADS)]
        move = rng.uniform(-0.5, 0.5, model.nv) * spread * span
        yield figure.clamp(pin.integrate(model, start, np.clip(move, lower, upper)))


def _inward(start: Array, figure: Figure) -> Array:
    """Displacement (nv,) that moves joints at a limit off it."""
    move = np.zeros(figure.model.nv)
    limits = figure.limits
    value = start[limits.idx_q]
    move[limits.idx_v[value < limits.lower + AT_LIMIT]] = BEND
    move[limits.idx_v[value > limits.upper - AT_LIMIT]] = -BEND
    return move
