"""The Newton iteration: each step is the least motion that meets the equations to first order (eqs. 5 to 7)."""

from __future__ import annotations

from math import sqrt
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import UndefinedTermError
from wholebody.methods.newton.inequalities import FREE, Inequalities, Kind, inequalities
from wholebody.methods.newton.linear_algebra import LinearSystem, SingularSystemError
from wholebody.methods.newton.settings import FRAMES, STEPS
from wholebody.methods.newton.system import ActiveSystem
from wholebody.solution import TraceEntry

Measures = Literal["lower", "keep", "ignore"]


class _Trust:
    """How far the next step is trusted, from what became of the last ones.

    Attributes:
        damping: of the goals; its square applies to constraints.
        share: of the constraints' errors that a step corrects.
        clamp: largest reduction of a goal's error in a step, metres or radians.
        funnel: violation of constraints up to which a step may reduce the goals' errors, metres or radians.
    """

    def __init__(self, least_damping: float, funnel: float) -> None:
        self.damping, self.funnel = least_damping, funnel
        self.share, self.clamp = 1.0, STEPS.error_clamp
        self._least = least_damping

    def raise_damping(self) -> None:
        """After a step that failed, or is too long."""
        self.damping = max(STEPS.first_damping, self.damping * STEPS.damping_up)

    def fail(self) -> None:
        """After a step that was not taken."""
        self.raise_damping()
        self.share, self.clamp = max(0.5 * self.share, 0.05), max(0.5 * self.clamp, 1e-3)

    def succeed(self, ratio: float) -> None:
        """After a step with this ratio of the actual to the predicted reduction of the goals' errors."""
        if ratio >= 0.75:
            lower = STEPS.damping_down * self.damping if self.damping > STEPS.first_damping else 0.0
            self.damping = max(lower, self._least)
        elif ratio < 0.25:
            self.raise_damping()
        self.share, self.clamp = min(1.0, 2.0 * self.share), min(STEPS.error_clamp, 2.0 * self.clamp)


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
        self.anchor: Array | None = None  # (7 n,) from where the motion is measured while measures are lowered
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
        self._move(x)
        self.state: Inequalities = inequalities(self.kind, self.residual[self.one_sided])

    def mark(self) -> tuple[Array, tuple[Array, ...], bool]:
        """The present state, for `go_back`."""
        return self.x, self.active_system.path, self.stationary

    def go_back(self, mark: tuple[Array, tuple[Array, ...], bool]) -> None:
        """Begin again at an earlier state."""
        x, self.active_system.path, self.stationary = mark
        self.begin(x)

    def _move(self, x: Array) -> None:
        residual = self.system.residual(x)
        values = self.system.values(x) if self.active_system.own_terms else None
        self.x, self.residual, self._values = x, residual, values
        self.hard, self.goal = self.system.largest_errors(self.residual)

    @property
    def values(self) -> Array:
        """Values (nnz,) of the Jacobian here; asked for when a step needs them, as a frame's last state has none."""
        if self._values is None:
            self._values = self.system.values(self.x)
        return self._values

    def _error(self, residual: Array) -> Array:
        error: Array = residual.copy()
        error[self.one_sided] = np.minimum(residual[self.one_sided], 0.0)
        error[self.objective] = 0.0
        return error

    def iterate(self, iterations: int, *, goals: bool, measures: Measures, early_exit: bool = False) -> None:
        """Step until convergence, stagnation or the iteration limit; `early_exit`: also until a step gains little."""
        self.stationary, active, norms = False, self.active_system, self._norms(self.residual)
        trust = _Trust(self.least_damping, max(STEPS.funnel * min(norms[1], 1.0), self.tolerance))
        least, stagnant = sum(norms), 0
        enough = FRAMES.least_progress if early_exit else STEPS.least_progress
        patience = FRAMES.patience if early_exit else STEPS.patience
        begun, most = self.x, FRAMES.time_share if early_exit else 1.0
        for tried in range(iterations):
            over = active.control.over or active.control.spent > most
            # a frame gets on if it can: its budget ends it after a step, or three that failed, or at twice as much
            late = over and (self.x is not begun or tried >= 3 or (tried and active.control.spent > 2.0 * most))
            holds = (self.met if goals else self.hard <= self.tolerance) and self.state.finished()
            if holds or active.control.reason or late:
                return
            active.control.tell(TraceEntry(self.goal, self.hard, 0.0, 0.0))
            before = self._norms(self.residual)
            far = self.goal > self.goal_tolerance and before[0] > trust.funnel
            restore = not goals or far
            step = self._trusted_step(trust, before[0], restore, goals, measures)
            length = self.length(step)
            trial = active.retract(self.x + length * step)
            if active.runs_into():  # the new contact is an inequality now: repeat the step from its start
                self.residuals.append(self.residuals[-1])
                self.begin(self.x)
                continue
            trial, length, free = self.shorten(trial, step, length)
            after = self._norms_at(trial)
            promised = self._norms(self.residual + length * self.system.pattern.times(self.values, step))
            better = self._better(before, after, promised, 0.0 if restore else trust.funnel)
            if free and sum(after) < np.inf and (better or not self.state.finished()) and self.advance(trial, length):
                progress = sum(after) < (1.0 - enough) * least or not self.state.finished()
                least, stagnant = min(least, sum(after)), 0 if progress else stagnant + 1
                trust.succeed(self._ratio(before[1], after[1], promised[1], restore))
            else:
                self.residuals.append(self.residuals[-1])
                if trust.damping >= STEPS.most_damping:
                    self.stationary = True
                    return
                stagnant += early_exit
                trust.fail()
            if stagnant >= patience:
                self.stationary = not early_exit
                return

    def _trusted_step(
        self, trust: _Trust, violation: float, restore: bool, goals: bool, measures: Measures
    ) -> Array:  # fmt: skip
        """The step (7 n,), damped until it is not far longer than what it corrects; zero where that fails."""
        share = 0.0 if restore else min(1.0, trust.clamp / max(self.goal, 1e-300))
        most = np.inf
        if self.goal > STEPS.far and not restore:
            most = STEPS.amplified * (violation + min(trust.clamp, self.goal))
        try:
            step = self.step(trust.damping, trust.share, share, goals, measures)
            while self._motion(step) > most and trust.damping < 1.0 and not self.active_system.control.over:
                trust.raise_damping()
                step = self.step(trust.damping, trust.share, share, goals, measures)
        except SingularSystemError:
            return np.zeros_like(self.x)
        return step

    def _ratio(self, before: float, after: float, promised: float, restore: bool) -> float:
        """Actual over predicted reduction of the goals' errors; 1 where that says nothing of the damping."""
        gain = before - promised
        if restore or before - after >= 0.75 * gain:
            return 1.0
        return (before - after) / gain if gain > self.goal_tolerance else 0.5

    def length(self, step: Array) -> float:
        """Share of a step (7 n,) for which the linearisation is valid and which the active system allows."""
        length = min(1.0, STEPS.largest_turn / max(largest_turn(step), 1e-300)) * self.state.share()
        if np.isfinite(self.active_system.longest):
            length = min(length, self.active_system.longest / max(self._motion(step), 1e-300))
        return length

    def shorten(self, trial: Array, step: Array, length: float) -> tuple[Array, float, bool]:
        """The trial and its length, halved until the motion to it is free; and whether it is."""
        for _ in range(8):
            if self.active_system.passes():
                return trial, length, True
            length *= 0.5
            trial = self.active_system.retract(self.x + length * step)
        return trial, length, self.active_system.passes()

    def advance(self, trial: Array, length: float) -> bool:
        """Accept a trial, this share of the last step; false, and nothing changes, where a term is not finite."""
        here = self.x
        try:
            if self.active_system.arrive(trial):
                self.begin(trial)
            else:
                self._move(trial)
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

        `damping` of the goals, squared for constraints; `share` and `goal_share` of the errors of constraints and
        goals that it corrects; `proximity`: factor of the least motion, against the measures.
        """
        asked = self.residual * share
        asked[self.goal_rows] = self.residual[self.goal_rows] * min(goal_share, share)
        diagonal = np.full(len(asked), STEPS.hard_damping + STEPS.hard_share * damping * damping)
        softness = STEPS.goal_damping + damping if goals else FREE
        diagonal[self.goal_rows] = softness / self.share[self.goal_rows] ** 2
        asked[self.objective] = 0.0
        if measures == "lower":
            asked[self.objective] = self.residual[self.objective] / (1.0 + damping / STEPS.first_damping)
        diagonal[self.objective] = FREE if measures == "ignore" else 1.0 / self.system.stiffness[self.objective]
        anchor = self.x if self.anchor is None or measures != "lower" else self.anchor
        gradient = self.system.weight * (self.x - anchor)
        rows, phi = self.one_sided, self.residual[self.one_sided]
        base = diagonal[rows]
        at = np.zeros_like(self.x)
        self.state.begin(phi)
        for _ in range(STEPS.systems):
            wanted, extra = self.state.rows(phi)
            asked[rows], diagonal[rows] = wanted, base + extra
            system = LinearSystem(self.values, proximity * self.system.weight, diagonal, gradient, asked)
            step, y = self.algebra.solve(system)
            self.systems += 1
            if not len(rows):
                return step
            change = self.system.pattern.times(self.values, step)[rows]
            share, again = self.state.correct(phi + change, y[rows])
            at = at + share * (step - at)
            if not again or self.active_system.control.over:
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
        if hard <= funnel and gain > 0.0 and before[1] - goal >= STEPS.gain * gain:
            return True
        restored = before[0] - hard >= STEPS.restored * max(before[0] - promised[0], 0.0) and hard < before[0]
        return restored and (before[0] > self.tolerance or goal <= before[1])


def largest_turn(step: Array) -> float:
    """Largest change of a body's Euler parameters in a step (7 n,)."""
    turn = step.reshape(-1, 7)[:, 3:]
    return float(np.sqrt((turn * turn).sum(axis=1).max(initial=0.0)))
