"""Newton steps towards equations: at each the least motion that meets them to first order (eqs. 5 to 7).

The previous state of the objective 1/2 |x - x0|^2 is the last iterate, so the multipliers vanish at the solution, the
KKT matrix [D, -J'; -J, 0] is exact there, and convergence is quadratic. Goals that are far are asked for in pieces
(B8); a step that does not near them is damped (B7), which leads to least squares where goals conflict.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.methods.newton.course import Course
from wholebody.methods.newton.inequalities import FREE, Inequalities, Kind, inequalities
from wholebody.methods.newton.linear_algebra.base import LinearSystem, SingularSystemError

Array = NDArray[np.float64]

HARD_DAMPING = 1e-10  # of what must hold: redundant equations are tolerated at this loss of accuracy
GOAL_DAMPING = 1e-7  # of goals, far above, so that they give way first
FIRST_DAMPING = 1e-5  # what a failed step begins with
MOST_DAMPING = 1e4
GOOD, POOR = 0.75, 0.25
AMPLIFIED, ENOUGH = 6.0, 1.0
DAMPING_UP, DAMPING_DOWN = 8.0, 0.1
HARD_SHARE = 1e-6  # of the squared damping goes to what must hold, which only conflicts among that need
PULL = 0.3  # m or rad: of a goal farther away, a step asks for this much; larger = fewer steps, more of them failed
LARGEST_TURN = 0.35  # change of Euler parameters in a step, twice that in radians; beyond it the linearisation is idle
FUNNEL = 0.5  # m or rad of equations that a step may leave for a metre of goal; larger = longer steps, more to mend
WIDEST = 0.5  # m or rad of equations that any step may leave
MEND = 0.7  # share of the funnel from which a step only mends; larger = fewer such steps, more damped ones
MENDING_DAMPING = 0.03  # of goals in such a step: they stay where they are, but not at any price
NARROW = 0.7  # what is left of the funnel after a step that only mended
WORTH = 0.05  # share of the promised progress that a step must make
STAGNANT = 1e-6  # relative progress below which steps count as none
PATIENCE = 12  # such steps in a row before the nearest point counts as found
REFUSALS = 6  # times in a row that a step is made anew because it runs into something; after that it is shortened
SHORTENINGS = 8  # halvings of a step whose way is not free before it counts as failed
SYSTEMS = 25  # most linear systems a step, while inequalities come and go
NEAR = 1e-2  # m or rad: errors below which the damping of equations is made good by the last multipliers
MENDING = 30  # most steps that only mend what must hold, where the goals were not met


class Reached(NamedTuple):
    """Where the iteration ended.

    Attributes:
        x: (7 n,) the variables.
        met: whether all equations hold to the tolerance.
        hard: largest error of what must hold.
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


def reach(
    course: Course,
    x: Array,
    *,
    tolerance: float,
    iterations: int,
    kind: Kind = "slack",
    goal_tolerance: float | None = None,
) -> Reached:
    """Meet all equations from x (7 n,), or come as near as goes.

    Args:
        course: the equations.
        x: where to begin.
        tolerance: metres and radians.
        iterations: most of them.
        kind: how inequalities are dealt with.
        goal_tolerance: of the goals, where it is another.
    """
    run = _Run(course, x, tolerance, tolerance if goal_tolerance is None else goal_tolerance, kind)
    run.iterate(iterations, goals=True, pulls=True)
    if run.stationary and not run.met and len(run.objective):
        run.iterate(iterations, goals=True, pulls=False)
    if run.hard > tolerance and len(run.goal_rows):
        stationary = run.stationary
        run.iterate(MENDING, goals=False, pulls=False)
        run.stationary = stationary if run.hard <= tolerance else run.stationary
    return Reached(run.x, run.met, run.hard, run.goal, tuple(run.residuals), run.systems, run.stationary)


class _Run:
    """State of one iteration."""

    def __init__(self, course: Course, x: Array, tolerance: float, goal_tolerance: float, kind: Kind) -> None:
        self.course, self.kind = course, kind
        self.tolerance, self.goal_tolerance = tolerance, goal_tolerance
        self._begin(course.retract(x))
        self.residuals = [max(self.hard, self.goal)]
        self.systems, self.stationary = 0, False

    @property
    def met(self) -> bool:
        """Whether all equations hold to their tolerances."""
        return self.hard <= self.tolerance and self.goal <= self.goal_tolerance

    def _begin(self, x: Array) -> None:
        """Take the equations as they are now, at x."""
        self.course.arrive(x)
        self.system, self.algebra = self.course.system, self.course.algebra
        self.goal_rows = np.flatnonzero(self.system.goal)
        self.objective = np.flatnonzero(self.system.objective)
        self.one_sided = np.flatnonzero(self.system.inequality)
        self._move(x, None)
        self.multiplier = np.zeros(len(self.residual))
        self.state: Inequalities = inequalities(self.kind, self.residual[self.one_sided])

    def _move(self, x: Array, residual: Array | None) -> None:
        self.x = x
        self.residual = self.system.residual(x) if residual is None else residual
        self.values = self.system.values(x)
        error = np.abs(self._error(self.residual))
        self.goal = float(error[self.goal_rows].max(initial=0.0))
        error[self.goal_rows] = 0.0
        self.hard = float(error.max(initial=0.0))

    def _error(self, residual: Array) -> Array:
        error: Array = residual.copy()
        error[self.one_sided] = np.minimum(residual[self.one_sided], 0.0)
        error[self.objective] = 0.0
        return error

    def iterate(self, iterations: int, *, goals: bool, pulls: bool) -> None:
        """Step until everything holds, nothing moves any more, or the iterations are spent."""
        damping, share, pull, stagnant = 0.0, 1.0, PULL, 0
        self.stationary = False
        least = sum(self._norms(self.residual))
        refused = 0
        funnel = max(min(FUNNEL * self._norms(self.residual)[1], WIDEST), self.tolerance)
        for _ in range(iterations):
            if (self.met if goals else self.hard <= self.tolerance) and self.state.finished():
                return
            before = self._norms(self.residual)
            try:
                mend = not goals or (self.goal > self.goal_tolerance and before[0] > MEND * funnel)
                step = self._step(
                    damping, share, 0.0 if mend else min(1.0, pull / max(self.goal, 1e-300)), goals, pulls
                )
                asked = before[0] + min(pull, self.goal) if not mend else np.inf
                while self._motion(step) > AMPLIFIED * asked and damping < ENOUGH:
                    damping = max(FIRST_DAMPING, damping * DAMPING_UP)
                    step = self._step(damping, share, min(1.0, pull / max(self.goal, 1e-300)), goals, pulls)
            except SingularSystemError:
                step = np.zeros_like(self.x)
            length = min(1.0, LARGEST_TURN / max(_largest_turn(step), 1e-300)) * self.state.share()
            if np.isfinite(self.course.longest):
                length = min(length, self.course.longest / max(self._motion(step), 1e-300))
            trial = self.course.retract(self.x + length * step)
            if refused < REFUSALS and self.course.runs_into():
                refused += 1  # what was run into is an equation now: the step is made anew from where it began
                self.residuals.append(self.residuals[-1])
                self._begin(self.x)
                continue
            refused = 0
            halvings = 0
            while halvings < SHORTENINGS and not self.course.passes():
                halvings, length = halvings + 1, 0.5 * length
                trial = self.course.retract(self.x + length * step)
            found = self.system.residual(trial)
            after = self._norms(found)
            promised = self._norms(self.residual + length * self.system.pattern.times(self.values, step))
            better = self._better(before, after, promised, 0.0 if mend else funnel) or not self.state.finished()
            if halvings == SHORTENINGS or not better:
                self.residuals.append(self.residuals[-1])
                if damping >= MOST_DAMPING:
                    self.stationary = True
                    return
                damping = max(FIRST_DAMPING, damping * DAMPING_UP)
                share, pull = max(0.5 * share, 0.05), max(0.5 * pull, 1e-3)
                continue
            if mend and after[1] >= before[1]:
                funnel = max(NARROW * funnel, self.tolerance)
            nearer = sum(after) < (1.0 - STAGNANT) * least
            least = min(least, sum(after))
            stagnant = 0 if nearer or not self.state.finished() else stagnant + 1
            if self.course.arrive(trial):
                self._begin(trial)
            else:
                self._move(trial, None)
                self.state.accept(length, self.residual[self.one_sided])
            self.residuals.append(max(self.hard, self.goal))
            gain = before[1] - promised[1]
            if mend or before[1] - after[1] >= GOOD * gain:
                damping = damping * DAMPING_DOWN if damping > FIRST_DAMPING else 0.0
            elif before[1] - after[1] < POOR * gain:
                damping = max(FIRST_DAMPING, damping * DAMPING_UP)
            share, pull = min(1.0, 2.0 * share), min(PULL, 2.0 * pull)
            if stagnant >= PATIENCE:
                self.stationary = True
                return

    def _step(self, damping: float, share: float, pull: float, goals: bool, pulls: bool) -> Array:
        """The step of one iteration; inequalities come and go until the linear solution agrees with them."""
        asked = self.residual * share
        asked[self.goal_rows] = self.residual[self.goal_rows] * min(pull, share)
        diagonal = np.full(len(asked), HARD_DAMPING + HARD_SHARE * damping * damping)
        softness = (GOAL_DAMPING if pull else MENDING_DAMPING) + damping if goals else FREE
        diagonal[self.goal_rows] = softness / self.system.share[self.goal_rows] ** 2
        asked[self.objective] = pulls * self.residual[self.objective] / (1.0 + damping / FIRST_DAMPING)
        if damping == 0.0 and goals and max(self.hard, self.goal) < NEAR:
            base = np.where(self.system.goal, GOAL_DAMPING, HARD_DAMPING)
            asked -= np.where(self.system.objective | self.system.inequality, 0.0, base) * self.multiplier
        diagonal[self.objective] = 1.0 / self.system.stiffness[self.objective] if pulls else FREE
        gradient = np.zeros_like(self.x)
        rows, phi = self.one_sided, self.residual[self.one_sided]
        base = diagonal[rows]
        at = np.zeros_like(self.x)
        self.state.begin(phi)
        for _ in range(SYSTEMS):
            wanted, extra = self.state.rows(phi)
            asked[rows], diagonal[rows] = wanted, base + extra
            system = LinearSystem(self.values, self.system.weight, diagonal, gradient, asked)
            step, y = self.algebra.solve(system)
            self.systems += 1
            self.multiplier = y
            if not len(rows):
                return step
            change = self.system.pattern.times(self.values, step)[rows]
            share, again = self.state.correct(phi + change, y[rows])
            at = at + share * (step - at)
            if not again:
                break
        return at

    def _norms(self, residual: Array) -> tuple[float, float]:
        """Norms of the errors of what must hold, and of the goals."""
        error = self._error(residual)
        goal = error[self.goal_rows] * self.system.share[self.goal_rows]
        error[self.goal_rows] = 0.0
        return sqrt(float(error @ error)), sqrt(float(goal @ goal))

    def _motion(self, step: Array) -> float:
        """About the longest way of any part of a body in a step, metres: the weights of turns are squared sizes."""
        bodies = (step * np.sqrt(self.system.weight)).reshape(-1, 7)
        return float(np.sqrt((bodies * bodies).sum(axis=1).max(initial=0.0)))

    def _better(
        self, before: tuple[float, float], after: tuple[float, float], promised: tuple[float, float], funnel: float
    ) -> bool:
        """Whether a step nears the goals without leaving the funnel, or mends what must hold (Gould and Toint 2010)."""
        hard, goal = after
        if not np.isfinite(hard + goal):
            return False
        if hard + goal <= 0.1 * self.tolerance:
            return True
        gain = before[1] - promised[1]
        if hard <= funnel and gain > 0.0 and before[1] - goal >= WORTH * gain:
            return True
        return hard < 0.9 * before[0]


def _largest_turn(step: Array) -> float:
    turn = step.reshape(-1, 7)[:, 3:]
    return float(np.sqrt((turn * turn).sum(axis=1).max(initial=0.0)))
