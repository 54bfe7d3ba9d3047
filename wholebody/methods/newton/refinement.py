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
from wholebody.methods.newton.settings import REFINEMENT
from wholebody.methods.newton.system import ActiveSystem


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
    run = Iteration(active_system, x, REFINEMENT.finer * tolerance, REFINEMENT.finer * tolerance, "slack")
    run.iterate(REFINEMENT.back, goals=True, measures="keep")
    if not run.met:
        return x, 0
    descent = _Descent(run, measure, tolerance)
    for _ in range(REFINEMENT.rounds):
        if not descent.lower():
            break
    return descent.best, len(run.residuals) - 1


class _Descent:
    """A descent of measures along the equations.

    Attributes:
        best: (7 n,) the state with the least measures.
    """

    def __init__(self, run: Iteration, measure: Callable[[Array], float], tolerance: float) -> None:
        self._run, self._measure, self._tolerance = run, measure, tolerance
        self.best, self._least = run.x, measure(run.x)
        self._share, self._memory, self._system = 1.0, Anderson(), run.system
        self._step: Array | None = None  # of the model at the best state, once it is known

    def lower(self) -> bool:
        """Make one round; False where no further one would lower the measures."""
        run, fast = self._run, None
        if self._step is None:
            try:
                self._step = run.step(0.0, 1.0, 1.0, True, "lower", REFINEMENT.motion)
            except SingularSystemError:
                return False
            fast = self._memory.propose(self._step)
        way, share = (self._step, self._share) if fast is None else (fast, 1.0)
        length = share * run.length(way)
        trial = run.active_system.retract(run.x + length * way)
        if run.active_system.runs_into():
            run.begin(self.best)
            self._step = None
            self._memory.reset()
            return True
        trial, length, free = run.shorten(trial, way, length)
        free = free and run.advance(trial, length)
        if free:
            run.iterate(REFINEMENT.back, goals=True, measures="keep")
        value, rounding = self._measured(), 1e-13 * abs(self._least)
        change = self._least - value
        met = free and run.met
        if met and change > rounding:
            return self._keep(value, fast is None)
        self._memory.reset()
        run.begin(self.best)
        if run.system is not self._system:
            self._system, self._step = run.system, None
        if fast is not None:
            return True
        if self._share < REFINEMENT.shortest or (met and change > -rounding):
            return False
        self._share *= REFINEMENT.shorter
        return True

    def _keep(self, value: float, plain: bool) -> bool:
        """Take the state of the iteration, with the measures `value`; `plain` steps may become longer."""
        run = self._run
        self._memory.record(run.x - self.best)
        moved = float(np.abs(run.x - self.best).max())
        self.best, self._least, self._step = run.x, value, None
        if run.system is not self._system:  # other contacts: what was remembered is of other equations
            self._system = run.system
            self._memory.reset()
        if plain:
            self._share = min(1.0, REFINEMENT.longer * self._share)
        return moved >= self._tolerance

    def _measured(self) -> float:
        """The measures at the iteration's state; infinite where one of one's own is not finite there."""
        try:
            return self._measure(self._run.x)
        except UndefinedTermError as error:
            self._run.active_system.control.step_back(error)
            return np.inf
