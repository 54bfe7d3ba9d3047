"""Newton steps until the equations hold, or their error is as small as possible."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.arrays import Array
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.iteration import Iteration
from wholebody.methods.newton.system import ActiveSystem

FRAME_ITERATIONS = 12  # most iterations of one frame; a farther goal is followed over several frames
RESTORATIONS = 30  # most steps that only restore the constraints, after the goals were not met
GOAL_DAMPING = 1e-2  # of goals out of reach, so that they give way to constraints by 1e8, not 1e3; larger = slower


class FeasibilityResult(NamedTuple):
    """The end of the iteration.

    Attributes:
        x: (7 n,) the variables.
        met: whether all equations hold to the tolerance.
        hard: largest error of a joint or constraint.
        goal: largest error of the goals.
        residuals: largest error before each iteration, and at the end.
        systems: linear systems solved.
        stationary: whether no further progress is possible.
    """

    x: Array
    met: bool
    hard: float
    goal: float
    residuals: tuple[float, ...]
    systems: int
    stationary: bool

    @property
    def iterations(self) -> int:
        """Newton iterations."""
        return len(self.residuals) - 1


def satisfy(
    active_system: ActiveSystem,
    x: Array,
    *,
    tolerance: float,
    iterations: int,
    kind: Kind = "slack",
    goal_tolerance: float | None = None,
    early_exit: bool = False,
    improve_goals: bool = False,
) -> FeasibilityResult:
    """Satisfy all equations from x (7 n,), or reduce their error as far as possible.

    Args:
        active_system: the equations.
        x: the start.
        tolerance: metres and radians.
        iterations: most iterations.
        kind: treatment of inequalities.
        goal_tolerance: of the goals, if it differs.
        improve_goals: go on from where goals out of reach pulled the constraints open and these were restored, with
            goals that give way; the end is nearer to the goals then.
        early_exit: end at the first steps that gain little, and do not minimise the error of goals that are not met.
    """
    run = Iteration(active_system, x, tolerance, tolerance if goal_tolerance is None else goal_tolerance, kind)
    run.iterate(iterations, goals=True, measures="lower", early_exit=early_exit)
    if not early_exit and run.stationary and not run.met and len(run.objective):
        run.iterate(iterations, goals=True, measures="ignore")
    if run.hard > tolerance and len(run.goal_rows):
        stationary = run.stationary
        run.iterate(RESTORATIONS, goals=False, measures="ignore")
        run.stationary = stationary if run.hard <= tolerance else run.stationary
        if improve_goals and run.hard <= tolerance and not run.met:
            _improve_goals(run, iterations, tolerance)
    return FeasibilityResult(run.x, run.met, run.hard, run.goal, tuple(run.residuals), run.systems, run.stationary)


def _improve_goals(run: Iteration, iterations: int, tolerance: float) -> None:
    """Lower the error of goals out of reach, from a state that meets the constraints; it stays if that fails."""
    best, goal, stationary = run.x, run.goal, run.stationary
    run.least_damping = GOAL_DAMPING
    run.iterate(iterations, goals=True, measures="ignore")
    if run.hard > tolerance:
        run.iterate(RESTORATIONS, goals=False, measures="ignore")
    if run.hard > tolerance or run.goal > goal:
        run.begin(best)
    run.stationary = stationary
