"""From a place that meets the equations to the least of the measures among such places.

Each round makes one step with the least motion counting little against the measures, comes back to the equations by
Newton steps, and is kept if the measures fell; else the next one goes half as far. With the Jacobians alone,
convergence is linear.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wholebody.arrays import Array
from wholebody.methods.newton.iteration import Iteration
from wholebody.methods.newton.linear_algebra.base import SingularSystemError
from wholebody.methods.newton.system import ActiveSystem

ROUNDS = 40  # most of them
LONGER, SHORTER = 1.3, 0.5  # what a step's share is multiplied by after a round that served, and one that did not
FINER = 0.1  # of the tolerances, to which a round comes back: what is missed would look like lower measures
MOTION = 1e-2  # factor of the least motion; smaller = faster, less sure where nothing else says which way
SHORTEST = 0.02  # of a step that does not lower the measures, before the last place counts as the least
BACK = 6  # most Newton steps back to the equations
ROUNDING = 1e-13  # relative change of the measures that says nothing


def polish(
    active_system: ActiveSystem, x: Array, measure: Callable[[Array], float], *, tolerance: float
) -> tuple[Array, int]:
    """Lower the measures from x (7 n,), where all equations hold.

    Args:
        active_system: the equations.
        x: where to begin.
        measure: what the measures are at variables (7 n,).
        tolerance: of the equations; a round that moves nothing by more, metres and radians, is the last.

    Returns:
        The variables, and how many iterations it took.
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
