"""The Newton iteration: each step is the least motion that meets the equations to first order (eqs. 5 to 7).

The previous state of the objective 1/2 |x - x0|^2 is the last iterate, so the multipliers vanish at the solution, the
KKT matrix [D, -J'; -J, 0] is exact there, and convergence is quadratic. Steps towards distant goals aim at intermediate
targets (B8). A step that does not reduce the errors, or moves far more than its target, is damped, which leads to least
squares if goals conflict.
"""

from __future__ import annotations

from math import sqrt
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import UndefinedTermError
from wholebody.methods.newton.inequalities import FREE, Inequalities, Kind, inequalities
from wholebody.methods.newton.linear_algebra.base import LinearSystem, SingularSystemError
from wholebody.methods.newton.system import ActiveSystem
from wholebody.solution import TraceEntry

Measures = Literal["lower", "keep", "ignore"]

HARD_DAMPING = 1e-10  # of joints and constraints: redundant equations are tolerated at this loss of accuracy
GOAL_DAMPING = 1e-7  # of goals, far larger, so that they give way first
FIRST_DAMPING = 1e-5  # first damping after a failed step
MOST_DAMPING = 1e4
GOOD, POOR = 0.75, 0.25  # shares of the predicted reduction above and below which the damping falls and rises
AMPLIFIED = 6.0  # motion per metre of target beyond which a step is damped: the equations are nearly singular there
FAR = 0.05  # m or rad: goal error from which that is tested; nearer, the measures may move more than the goals
ENOUGH = 1.0  # largest damping
DAMPING_UP, DAMPING_DOWN = 8.0, 0.1
HARD_SHARE = 1e-6  # of the squared damping applies to constraints, for conflicts among them
ERROR_CLAMP = 0.3  # m or rad: largest reduction of a goal's error in a step; larger = fewer steps, more of them fail
LARGEST_TURN = 0.35  # change of Euler parameters in a step, half the radians; a linearisation is useless beyond it
FUNNEL = 0.5  # m or rad of violation allowed for a metre of goal; larger = longer steps, more to restore
WIDEST = 0.5  # m or rad: largest violation allowed after any step
RESTORE_ABOVE = 0.7  # share of the funnel from which a step only restores; larger = fewer such steps, more damped ones
RESTORING_DAMPING = 0.03  # of goals in such a step: they keep their errors, but may give way
NARROW = 0.7  # factor on the funnel after such a step
WORTH = 0.05  # least ratio of actual to predicted reduction of a step
RESTORED = 0.2  # the same for a step that only restores the constraints
STAGNANT = 1e-6  # relative reduction below which a step counts as no progress
LEAST_PROGRESS = 0.1  # the same in frames
STALLED = 1  # number of steps with less reduction than that after which a frame ends
PATIENCE = 12  # number of steps without progress in a row after which the iteration counts as converged
REFUSALS = 6  # times in a row that a step is repeated because of a new contact; after that it is shortened
SHORTENINGS = 8  # halvings of a step whose motion is not free before it counts as failed
SYSTEMS = 25  # most linear systems a step, while the active set changes
NEAR = 1e-2  # m or rad: errors below which the last multipliers compensate the damping of equations


class Iteration:
    """State of one iteration."""

    def __init__(
        self, active_system: ActiveSystem, x: Array, tolerance: float, goal_tolerance: float, kind: Kind
    ) -> None:
        self.active_system, self.kind = active_system, kind
        self.tolerance, self.goal_tolerance = tolerance, goal_tolerance
        self.begin(active_system.retract(x))
        self.residuals = [max(self.hard, self.goal)]
        self.systems, self.stationary = 0, False
        self.least_damping = 0.0

    @property
    def met(self) -> bool:
        """Whether all equations hold to their tolerances."""
        return self.hard <= self.tolerance and self.goal <= self.goal_tolerance

    def begin(self, x: Array) -> None:
        """Use the present equations at x."""
        self.active_system.arrive(x)
        self.system, self.algebra = self.active_system.system, self.active_system.algebra
        self.share = np.ones(len(self.system.goal)) if self.active_system.even else self.system.share
        self.goal_rows = np.flatnonzero(self.system.goal)
        self.objective = np.flatnonzero(self.system.objective)
        self.one_sided = np.flatnonzero(self.system.inequality)
        self._move(x, None)
        self.multiplier = np.zeros(len(self.residual))
        self.state: Inequalities = inequalities(self.kind, self.residual[self.one_sided])

    def mark(self) -> tuple[Array, tuple[Array, ...], bool]:
        """The present state, for `go_back`."""
        return self.x, self.active_system.path, self.stationary

    def go_back(self, mark: tuple[Array, tuple[Array, ...], bool]) -> None:
        """Begin again at an earlier state."""
        x, self.active_system.path, self.stationary = mark
        self.begin(x)

    def _move(self, x: Array, residual: Array | None) -> None:
        residual = self.system.residual(x) if residual is None else residual
        values = self.system.values(x)
        self.x, self.residual, self.values = x, residual, values
        self.hard, self.goal = self.system.largest_errors(self.residual)

    def _error(self, residual: Array) -> Array:
        error: Array = residual.copy()
        error[self.one_sided] = np.minimum(residual[self.one_sided], 0.0)
        error[self.objective] = 0.0
        return error

    def iterate(self, iterations: int, *, goals: bool, measures: Measures, early_exit: bool = False) -> None:
        """Step until everything holds, nothing moves any more, or the iterations are spent.

        Args:
            iterations: most iterations.
            goals: whether goals are pursued.
            measures: minimised, kept from growing, or ignored.
            early_exit: end at the first step that gains little, as in a frame whose goal lies inside something.
        """
        damping, share, clamp, stagnant = self.least_damping, 1.0, ERROR_CLAMP, 0
        self.stationary = False
        least = sum(self._norms(self.residual))
        refused = 0
        funnel = max(min(FUNNEL * self._norms(self.residual)[1], WIDEST), self.tolerance)
        for _ in range(iterations):
            if (self.met if goals else self.hard <= self.tolerance) and self.state.finished():
                return
            if self.active_system.control.over:
                return
            self.active_system.control.tell(TraceEntry(self.goal, self.hard, 0.0, 0.0))
            before = self._norms(self.residual)
            try:
                restore = not goals or (self.goal > self.goal_tolerance and before[0] > RESTORE_ABOVE * funnel)
                step = self.step(
                    damping, share, 0.0 if restore else min(1.0, clamp / max(self.goal, 1e-300)), goals, measures
                )
                asked = before[0] + min(clamp, self.goal) if self.goal > FAR and not restore else np.inf
                while self._motion(step) > AMPLIFIED * asked and damping < ENOUGH:
                    damping = max(FIRST_DAMPING, damping * DAMPING_UP)
                    step = self.step(damping, share, min(1.0, clamp / max(self.goal, 1e-300)), goals, measures)
            except SingularSystemError:
                step = np.zeros_like(self.x)
            length = self.length(step)
            trial = self.active_system.retract(self.x + length * step)
            if refused < REFUSALS and self.active_system.runs_into():
                refused += 1  # the new contact is an inequality now: repeat the step from its start
                self.residuals.append(self.residuals[-1])
                self.begin(self.x)
                continue
            refused = 0
            trial, length, free = self.shorten(trial, step, length)
            after = self._norms_at(trial)
            promised = self._norms(self.residual + length * self.system.pattern.times(self.values, step))
            better = self._better(before, after, promised, 0.0 if restore else funnel) or not self.state.finished()
            if not (free and better and sum(after) < np.inf and self.advance(trial, length)):
                self.residuals.append(self.residuals[-1])
                if damping >= MOST_DAMPING:
                    self.stationary = True
                    return
                stagnant += early_exit
                if early_exit and stagnant > STALLED:
                    return
                damping = max(FIRST_DAMPING, damping * DAMPING_UP)
                share, clamp = max(0.5 * share, 0.05), max(0.5 * clamp, 1e-3)
                continue
            if restore and after[1] >= before[1]:
                funnel = max(NARROW * funnel, self.tolerance)
            nearer = sum(after) < (1.0 - (LEAST_PROGRESS if early_exit else STAGNANT)) * least
            least = min(least, sum(after))
            stagnant = 0 if nearer or not self.state.finished() else stagnant + 1
            gain = before[1] - promised[1]
            if restore or before[1] - after[1] >= GOOD * gain:
                damping = max(damping * DAMPING_DOWN if damping > FIRST_DAMPING else 0.0, self.least_damping)
            elif gain > self.goal_tolerance and before[1] - after[1] < POOR * gain:
                damping = max(FIRST_DAMPING, damping * DAMPING_UP)
            share, clamp = min(1.0, 2.0 * share), min(ERROR_CLAMP, 2.0 * clamp)
            if stagnant >= PATIENCE:
                self.stationary = True
                return
            if early_exit and stagnant > STALLED:
                return

    def length(self, step: Array) -> float:
        """Share of a step (7 n,) for which the linearisation is valid and which the active system allows."""
        length = min(1.0, LARGEST_TURN / max(largest_turn(step), 1e-300)) * self.state.share()
        if np.isfinite(self.active_system.longest):
            length = min(length, self.active_system.longest / max(self._motion(step), 1e-300))
        return length

    def shorten(self, trial: Array, step: Array, length: float) -> tuple[Array, float, bool]:
        """The trial and its length, halved until the motion to it is free; and whether it is."""
        for _ in range(SHORTENINGS):
            if self.active_system.passes():
                return trial, length, True
            length *= 0.5
            trial = self.active_system.retract(self.x + length * step)
        return trial, length, self.active_system.passes()

    def advance(self, trial: Array, length: float) -> bool:
        """Accept a trial, which is this share of the last step, and evaluate its equations.

        False, and nothing changes, where a term of one's own is not finite there.
        """
        here = self.x
        try:
            if self.active_system.arrive(trial):
                self.begin(trial)
            else:
                self._move(trial, None)
                self.state.accept(length, self.residual[self.one_sided])
        except UndefinedTermError as error:
            self.active_system.control.step_back(error)
            self.begin(here)
            return False
        self.residuals.append(max(self.hard, self.goal))
        return True

    def step(
        self, damping: float, share: float, goal_share: float, goals: bool, measures: Measures, proximity: float = 1.0
    ) -> Array:
        """The step of one iteration; the active set changes until the linear solution agrees with it.

        Args:
            damping: of the goals; its square applies to constraints.
            share: of the constraints' errors that the step corrects.
            goal_share: share of the goals' errors that the step corrects.
            goals: whether goals are pursued at all.
            measures: minimised, kept from growing, or ignored.
            proximity: factor of the least motion, against the measures.
        """
        asked = self.residual * share
        asked[self.goal_rows] = self.residual[self.goal_rows] * min(goal_share, share)
        diagonal = np.full(len(asked), HARD_DAMPING + HARD_SHARE * damping * damping)
        softness = (GOAL_DAMPING if goal_share else RESTORING_DAMPING) + damping if goals else FREE
        diagonal[self.goal_rows] = softness / self.share[self.goal_rows] ** 2
        asked[self.objective] = 0.0
        if measures == "lower":
            asked[self.objective] = self.residual[self.objective] / (1.0 + damping / FIRST_DAMPING)
        if damping == 0.0 and goals and max(self.hard, self.goal) < NEAR:
            base = np.where(self.system.goal, GOAL_DAMPING, HARD_DAMPING)
            asked -= np.where(self.system.objective | self.system.inequality, 0.0, base) * self.multiplier
        diagonal[self.objective] = FREE if measures == "ignore" else 1.0 / self.system.stiffness[self.objective]
        gradient = np.zeros_like(self.x)
        rows, phi = self.one_sided, self.residual[self.one_sided]
        base = diagonal[rows]
        at = np.zeros_like(self.x)
        self.state.begin(phi)
        for _ in range(SYSTEMS):
            wanted, extra = self.state.rows(phi)
            asked[rows], diagonal[rows] = wanted, base + extra
            system = LinearSystem(self.values, proximity * self.system.weight, diagonal, gradient, asked)
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

    def _norms_at(self, x: Array) -> tuple[float, float]:
        """The same at the variables x (7 n,); infinite where a term of one's own is not finite there."""
        try:
            return self._norms(self.system.residual(x))
        except UndefinedTermError as error:
            self.active_system.control.step_back(error)
            return np.inf, np.inf

    def _norms(self, residual: Array) -> tuple[float, float]:
        """Norms of the errors of the constraints, and of the goals."""
        error = self._error(residual)
        goal = error[self.goal_rows] * self.share[self.goal_rows]
        error[self.goal_rows] = 0.0
        return sqrt(float(error @ error)), sqrt(float(goal @ goal))

    def _motion(self, step: Array) -> float:
        """Approximate largest motion of a part of a body in a step, metres; weights of rotations are squared sizes."""
        bodies = (step * np.sqrt(self.system.weight)).reshape(-1, 7)
        return float(np.sqrt((bodies * bodies).sum(axis=1).max(initial=0.0)))

    def _better(
        self, before: tuple[float, float], after: tuple[float, float], promised: tuple[float, float], funnel: float
    ) -> bool:
        """Whether a step reduces goal errors in the funnel, or restores the constraints (Gould and Toint 2010)."""
        hard, goal = after
        if not hard + goal < np.inf:  # nor NaN
            return False
        if hard + goal <= 0.1 * self.tolerance:
            return True
        gain = before[1] - promised[1]
        bend = min(before[1] * before[1], WIDEST)  # violation of curved equations after a full step towards the goals
        if hard <= max(funnel, bend) and gain > 0.0 and before[1] - goal >= WORTH * gain:
            return True
        restored = before[0] - hard >= RESTORED * max(before[0] - promised[0], 0.0) and hard < before[0]
        return restored and (before[0] > self.tolerance or goal <= before[1])


def largest_turn(step: Array) -> float:
    """Largest change of a body's Euler parameters in a step (7 n,)."""
    turn = step.reshape(-1, 7)[:, 3:]
    return float(np.sqrt((turn * turn).sum(axis=1).max(initial=0.0)))
