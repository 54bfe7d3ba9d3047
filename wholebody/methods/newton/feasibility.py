"""Newton steps until the equations hold, or their error is as small as possible."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.iteration import Iteration
from wholebody.methods.newton.settings import ENDINGS, FRAMES
from wholebody.methods.newton.system import ActiveSystem


class FeasibilityResult(NamedTuple):
    """The end of the iteration."""

    x: Array  # (7 n,) the variables
    met: bool  # whether all equations hold to the tolerance
    hard: float  # largest error of a joint or constraint, and of the goals
    goal: float
    residuals: tuple[float, ...]  # largest error before each iteration, and at the end
    systems: int  # linear systems solved
    stationary: bool  # whether no further progress is possible

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
    thorough: bool = False,
) -> FeasibilityResult:
    """Satisfy all equations from x (7 n,) to tolerances [m, rad], or reduce their error as far as possible."""
    # `early_exit`: ends at little gain. `thorough`: also from nearby, and where far goals pulled constraints open.
    run = Iteration(active_system, x, tolerance, tolerance if goal_tolerance is None else goal_tolerance, kind)
    far = run.goal
    run.iterate(iterations, goals=True, measures="lower", early_exit=early_exit)
    if not early_exit and run.stationary and not run.met and len(run.objective):
        run.iterate(iterations, goals=True, measures="ignore")
    improve_goals = thorough and not early_exit
    _restore(run, iterations, improve_goals)
    stuck = run.goal > (1.0 - FRAMES.least_progress) * far if early_exit else run.stationary
    late = early_exit and active_system.control.spent > FRAMES.time_share
    if thorough and stuck and not late and not run.met:
        _leave_saddle(run, 1 if early_exit else ENDINGS.nudges, iterations, improve_goals)
    return FeasibilityResult(run.x, run.met, run.hard, run.goal, tuple(run.residuals), run.systems, run.stationary)


def _restore(run: Iteration, iterations: int, improve_goals: bool) -> None:
    """Meet the constraints that goals out of reach pulled open."""
    if run.hard <= run.tolerance or not len(run.goal_rows):
        return
    stationary = run.stationary
    run.iterate(ENDINGS.restorations, goals=False, measures="ignore")
    run.stationary = stationary if run.hard <= run.tolerance else run.stationary
    if improve_goals and run.hard <= run.tolerance and not run.met:
        _improve_goals(run, iterations, run.tolerance)


def _leave_saddle(run: Iteration, nudges: int, iterations: int, improve_goals: bool) -> None:
    """Continue from nearby states: a stationary one may be a saddle (a straight chain, its goal on its line)."""
    saddle = best = run.mark()
    least, rng = _missed(run), np.random.default_rng(0)
    size = np.sqrt(run.system.weight.reshape(-1, 7))
    size[:, :3] *= size[:, 3:].max(axis=1, keepdims=True)
    size[:, 3:] = 1.0
    run.least_damping = 0.0
    for _ in range(nudges):
        if run.met:
            return
        run.go_back(saddle)
        if not _moved(run, (ENDINGS.nudge * size * rng.normal(size=size.shape)).ravel()):
            continue
        run.iterate(iterations, goals=True, measures="ignore")
        _restore(run, iterations, improve_goals)
        missed = _missed(run)
        if missed < tuple((1.0 - ENDINGS.gain) * value for value in least):
            best, least = run.mark(), missed
    if not run.met:
        run.go_back(best)


def _moved(run: Iteration, step: Array) -> bool:
    """Make a step (7 n,), as far as its motion is free; False where it is not."""
    start, length = run.x, run.length(step)
    trial = run.active_system.retract(start + length * step)
    if run.active_system.runs_into():
        run.begin(start)
        trial = run.active_system.retract(start + length * step)
    trial, length, free = run.shorten(trial, step, length)
    if free:
        run.advance(trial, length)
    return free


def _missed(run: Iteration) -> tuple[float, float]:
    """What to lower: violations above the tolerance first, then the goals' errors."""
    return (run.hard if run.hard > run.tolerance else 0.0), run.goal


def _improve_goals(run: Iteration, iterations: int, tolerance: float) -> None:
    """Lower the error of goals out of reach, from a state that meets the constraints; it stays if that fails."""
    best, goal, stationary = run.mark(), run.goal, run.stationary
    run.least_damping = ENDINGS.goal_damping
    run.iterate(iterations, goals=True, measures="ignore")
    if run.hard > tolerance:
        run.iterate(ENDINGS.restorations, goals=False, measures="ignore")
    if run.hard > tolerance or run.goal > goal:
        run.go_back(best)
    run.stationary = stationary
