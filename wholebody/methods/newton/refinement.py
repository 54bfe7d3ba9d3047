"""Minimises the measures subject to the equations, from a state that satisfies the equations.

Each round makes one step in which the motion has little weight against the measures, and returns to the equations by
Newton steps. It is kept if the measures decreased; otherwise the next round is half as long. With the Jacobians alone,
convergence is linear.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wholebody.arrays import Array
from wholebody.methods.newton.iteration import Iteration
from wholebody.methods.newton.linear_algebra.base import SingularSystemError
from wholebody.methods.newton.system import ActiveSystem

ROUNDS = 40  # most rounds
LONGER, SHORTER = 1.3, 0.5  # factors on the length of a step after a round that was kept, and one that was not
FINER = 0.1  # of the tolerances, to which a round returns to the equations: larger errors would lower the measures
MOTION = 1e-2  # weight of the motion; smaller = faster, less stable for degrees of freedom without measures
SHORTEST = 0.02  # least length of a step; if shorter ones do not lower the measures, the last state is the minimum
BACK = 6  # most Newton steps back to the equations
ROUNDING = 1e-13  # relative change of the measures that is rounding


def refine(
    active_system: ActiveSystem, x: Array, measure: Callable[[Array], float], *, tolerance: float
) -> tuple[Array, int]:
    """Lower the measures from x (7 n,), where all equations hold.

    Args:
        active_system: the equations.
        x: the start.
        measure: the measures as a function of the variables (7 n,).
        tolerance: of the equations; a round that moves nothing by more, metres and radians, is the last.

    Returns:
        The variables, and the number of iterations.
    """
    run = Iteration(active_system, x, FINER * tolerance, FINER * tolerance, "slack")
    run.iterate(BACK, goals=True, measures="keep")
    if not run.met:
        return x, 0
    best, least, share = run.x, measure(run.x), 1.0
    for _ in range(ROUNDS):
        try:
            step = run.step(0.0, 1.0, 1.0, True, "lower", MOTION)
        except SingularSystemError:
            break
        length = share * run.length(step)
        trial = active_system.retract(run.x + length * step)
        if active_system.runs_into():
            run.begin(best)
            continue
        trial, length, free = run.shorten(trial, step, length)
        if free:
            run.advance(trial, length)
            run.iterate(BACK, goals=True, measures="keep")
        value = measure(run.x)
        change = least - value
        if free and run.met and change > ROUNDING * abs(least):
            moved = float(np.abs(run.x - best).max())
            best, least, share = run.x, value, min(1.0, LONGER * share)
            if moved < tolerance:
                break
        else:
            if share < SHORTEST or (free and run.met and change > -ROUNDING * abs(least)):
                break
            share *= SHORTER
            run.begin(best)
    return best, len(run.residuals) - 1
