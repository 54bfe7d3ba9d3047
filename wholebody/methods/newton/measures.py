"""The measures as rows whose squares are minimised, and their descent: docs/theory/newton.md.

`Anderson` accelerates steps that form a linear sequence (Walker and Ni 2011, type II).
"""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import UndefinedTermError
from wholebody.figures.state import State
from wholebody.methods.newton.batches import OBJECTIVE, Batch
from wholebody.methods.newton.figure_bodies import DisplacementRows, FigureBodies
from wholebody.methods.newton.iteration import Iteration
from wholebody.methods.newton.linear_algebra import SingularSystemError
from wholebody.methods.newton.own_rows import TangentRows, quadratic_model, square_rows
from wholebody.methods.newton.settings import REFINEMENT
from wholebody.methods.newton.system import ActiveSystem
from wholebody.problem import Problem
from wholebody.tasks.base import Measure

DEPTH = 5  # steps remembered; more adds little where a handful of joints settles slowly
STRETCH = 6.0  # an accelerated step is at most this many times the plain one


class Anderson:
    """Remembers plain steps and the displacements actually made."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the past steps: after a rejected step, or far from the goals."""
        self._step: Array | None = None  # whose displacement is not known yet
        self._steps: list[Array] = []
        self._displacements: list[Array] = []

    def propose(self, step: Array) -> Array | None:
        """The accelerated step for the plain one (k,), at most `STRETCH` times as long; None while too little known."""
        self._step = step
        if len(self._steps) < 2:
            return None
        steps, displacements = np.array([*self._steps[-DEPTH:], step]), np.array(self._displacements[-DEPTH:])
        changes = steps[1:] - steps[:-1]
        coefficients = np.linalg.lstsq(changes.T, step, rcond=None)[0]
        fast: Array = step - coefficients @ (displacements + changes)
        longest, size = STRETCH * float(np.abs(step).max()), float(np.abs(fast).max())
        if not isfinite(size):
            return None
        return fast if size <= longest else fast * (longest / size)

    def record(self, displacement: Array) -> None:
        """Remember the displacement (k,) that was made after the last step was proposed."""
        if self._step is not None:
            self._steps.append(self._step)
            self._displacements.append(displacement)
            self._step = None


class Objective:
    """Rows whose squares model measures: one for each degree of freedom, and those of measures that are squares."""

    def __init__(self, state: State, rows: DisplacementRows, measures: Iterable[Measure]) -> None:
        """Take resolved measures, and a state that may be moved."""
        self._state, self._rows, self.measures = state, rows, list(measures)
        self._curved = self.measures  # those that have no rows of their own
        self.squares: list[TangentRows] = []
        self.stiffness = np.full(rows.size, REFINEMENT.stiffness * REFINEMENT.least_stiffness)

    def batches(self) -> list[Batch]:
        """All rows, in the order of their factors."""
        for batch in self.squares:
            batch.role = OBJECTIVE
        return [self._rows, *self.squares]

    def value(self, q: Array) -> float:
        """The measures, with their weights, at the posture q (nq,)."""
        state = self._state.update(q)
        return float(sum(term.weight * term.value(state) for term in self.measures))

    def renew(self, q: Array) -> None:
        """Model the measures at the posture q (nq,)."""
        gradient, curvature = quadratic_model(self._curved, self._state.update(q))
        half = np.maximum(0.5 * curvature, REFINEMENT.least_stiffness)
        self._rows.anchor(q, -0.5 * gradient / half)
        self.stiffness = REFINEMENT.stiffness * half

    @property
    def factors(self) -> Array:
        """(rows,) the present factors on the squares of all rows."""
        return np.append(self.stiffness, np.full(sum(rows.size for rows in self.squares), REFINEMENT.stiffness))


class FigureObjective(Objective):
    """The rows of a problem's measures, among them sums of squares."""

    def __init__(self, problem: Problem, bodies: FigureBodies, state: State) -> None:
        """Take the figure's bodies, and a state that may be moved."""
        super().__init__(state, bodies.displacement(), problem.measures)
        self._curved, self._follows = list[Measure](), True
        for term in self.measures:
            rows = square_rows(bodies, term, type(term).__name__)
            self._curved += [term] if rows is None else []
            self.squares += [] if rows is None else [rows]

    def anchor(self, q: Array) -> None:
        """Use displacements from q (nq,), the last state of a drag, with the measures' second derivatives."""
        super().renew(q)
        self._rows.anchor(q, np.zeros(self._rows.size))
        for rows in self.squares:
            rows.count_from(q)
        self._follows = False

    def follow(self) -> None:
        """Model the measures anew at every posture."""
        for rows in self.squares:
            rows.count_from(None)
        self._follows = True

    def renew(self, q: Array) -> None:
        """Model the measures at the posture q (nq,), unless an anchor is set."""
        if self._follows:
            super().renew(q)


class Refined(NamedTuple):
    """Where a descent of measures ended.

    Attributes:
        x: (7 n,) the variables.
        iterations: how many Newton iterations it took.
        converged: whether no further round would lower the measures; False where the rounds ended first.
    """

    x: Array
    iterations: int
    converged: bool


def refine(
    active_system: ActiveSystem, x: Array, tolerance: float, rounds: int = REFINEMENT.rounds,
    anchor: Array | None = None,
) -> Refined:  # fmt: skip
    """Lower the measures from x (7 n,), where all equations hold.

    With an anchor (7 n,) the measure is the squared motion from there (eq. 1), whose second derivative a step has.
    """
    run = Iteration(active_system, x, REFINEMENT.finer * tolerance, REFINEMENT.finer * tolerance, "slack")
    run.iterate(REFINEMENT.back, goals=True, measures="keep")
    if not run.met:
        return Refined(x, 0, False)
    run.anchor = anchor
    descent = _Descent(run, tolerance)
    converged = any(not descent.lower() for _ in range(rounds))
    return Refined(descent.best, len(run.residuals) - 1, converged)


class _Descent:
    """A descent of measures along the equations; `best` (7 n,) is the state with the least."""

    def __init__(self, run: Iteration, tolerance: float) -> None:
        self._run, self._tolerance, self.best = run, tolerance, run.x
        self._least = self._measured()
        self._share, self._memory, self._system = 1.0, Anderson(), run.system
        self._motion = REFINEMENT.motion if run.anchor is None else 1.0
        self._step: Array | None = None  # of the model at the best state, once it is known

    def lower(self) -> bool:
        """Make one round; False where no further one would lower the measures."""
        run, fast = self._run, None
        if self._step is None:
            try:
                self._step = run.step(0.0, 1.0, 1.0, True, "lower", self._motion)
            except SingularSystemError:
                return False
            fast = self._memory.propose(self._step)
        direction, share = (self._step, self._share) if fast is None else (fast, 1.0)
        length = share * run.length(direction)
        trial = run.active_system.retract(run.x + length * direction)
        if run.active_system.runs_into():
            run.begin(self.best)
            self._step = None
            self._memory.reset()
            return True
        trial, length, free = run.shorten(trial, direction, length)
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
        run, active = self._run, self._run.active_system
        if run.anchor is not None:
            return float(0.5 * (run.system.weight * (run.x - run.anchor)) @ (run.x - run.anchor))
        try:
            value: float = active.objective.value(active.posture(run.x))
            return value
        except UndefinedTermError as error:
            active.control.step_back(error)
            return np.inf
