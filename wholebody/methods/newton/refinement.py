"""Minimises the measures subject to the equations, from a state that satisfies the equations.

Each round makes one step in which the motion has little weight against the measures, and returns to the equations by
Newton steps. It is kept if the measures decreased; otherwise the next round is half as long. With the Jacobians alone,
convergence is linear, so the steps are accelerated; a round whose accelerated step does not lower the measures is
repeated with the step itself.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import UndefinedTermError
from wholebody.methods.acceleration import Anderson
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
    best, least, share, system = run.x, measure(run.x), 1.0, run.system
    memory = Anderson()
    step: Array | None = None  # of the model at the best state, once it is known
    for _ in range(ROUNDS):
        fast: Array | None = None
        if step is None:
            try:
                step = run.step(0.0, 1.0, 1.0, True, "lower", MOTION)
            except SingularSystemError:
                break
            fast = memory.propose(step)
        way = step if fast is None else fast
        length = (share if fast is None else 1.0) * run.length(way)
        trial = active_system.retract(run.x + length * way)
        if active_system.runs_into():
            run.begin(best)
            step = None
            memory.reset()
            continue
        trial, length, free = run.shorten(trial, way, length)
        free = free and run.advance(trial, length)
        if free:
            run.iterate(BACK, goals=True, measures="keep")
        value = _measured(active_system, measure, run.x)
        change = least - value
        if free and run.met and change > ROUNDING * abs(least):
            memory.record(run.x - best)
            moved = float(np.abs(run.x - best).max())
            best, least, step = run.x, value, None
            if run.system is not system:  # other contacts: what was remembered is of other equations
                system = run.system
                memory.reset()
            if fast is None:
                share = min(1.0, LONGER * share)
            if moved < tolerance:
                break
            continue
        memory.reset()
        run.begin(best)
        if run.system is not system:
            system, step = run.system, None
        if fast is None:
            if share < SHORTEST or (free and run.met and change > -ROUNDING * abs(least)):
                break
            share *= SHORTER
    return best, len(run.residuals) - 1


def _measured(active_system: ActiveSystem, measure: Callable[[Array], float], x: Array) -> float:
    """The measures at x (7 n,); infinite where one of one's own is not finite there."""
    try:
        return measure(x)
    except UndefinedTermError as error:
        active_system.control.step_back(error)
        return np.inf
