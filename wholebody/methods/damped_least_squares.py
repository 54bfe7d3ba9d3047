"""Damped least squares, which ignores contacts: docs/theory/damped_least_squares.md has the equations.

The damping is that of Sugihara 2011 (eq. 19). Equalities have priority, and goals act in their null space (Nakamura,
Hanafusa and Yoshikawa 1987), whose projector is not damped (Baerlocher and Boulic 2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from wholebody.assessment.posture import goal_errors
from wholebody.base.arrays import Array
from wholebody.base.fields import Checked
from wholebody.figures.state import State
from wholebody.methods.base import (
    DAMPING,
    Iterations,
    TimeLimit,
    Tolerance,
    UnsupportedTermError,
    named_terms,
    unseen,
)
from wholebody.methods.conclusion import Descends, Ending
from wholebody.methods.control import Control
from wholebody.methods.differential import Iteration, Settings, StepError
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import values
from wholebody.tasks.bounds import allowed
from wholebody.tasks.checks import undefined, values_and_rows

RANK = 1e-8  # squared singular values below this share of the largest count as zero


@dataclass(frozen=True)
class DampedLeastSquares(Checked, Descends):
    """Damped least squares, the textbook method: goals and equalities, limits by clamping, without contacts.

    Takes every goal, and constraints that are equalities (`Hold`, `Plane` with side "on"); bounds such as `Freeze` too.
    Inequalities (`Balance`, `ReachCones`, `Plane` with side "above") are refused by name, but for those that a person
    has by default: they are left to the assessment. Measures are reported, not
    minimised: each step is the least motion, and there is one start. It may end in penetration, and then reports it.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most steps.
        damping: remaining damping when the goals are met [m, rad]; more is steadier near singular postures, less
            converges faster.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None, it
            ends after four seconds of processor time.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> wb.solve(problem, wb.methods.DampedLeastSquares(damping=1e-2)).method
        'dls'
    """

    name = "dls"
    tolerance: Tolerance = 1e-5
    iterations: Iterations = 300
    damping: Annotated[float, DAMPING] = 1e-3
    time_limit: TimeLimit = None

    def _check_terms(self, problem: Problem) -> None:
        refused = [
            f"constraints[{number}], {type(term).__name__} (it is no equality)"
            for number, term in enumerate(problem.stated)
            if not np.array_equal(term.lower, term.upper)
        ]
        if refused:
            raise UnsupportedTermError(self.name, refused)

    def _unseen(self, problem: Problem) -> tuple[str, ...]:
        """See `Descends._unseen`: contacts, what people have by default, and stated measures."""
        measures = [where for where, _ in named_terms(problem) if where.startswith("measures")]
        return (*unseen(problem, lambda term: False, contacts=True), *measures)

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`; contacts are ignored."""
        self._check_terms(problem)
        settings = Settings(self.tolerance, self.iterations, longest=1e9, decay=1.0, best=True, negligible=0.0)
        descent = _Descent(problem, workspace, _Least(problem, workspace.state, self.damping), settings, control)
        descent.go()
        return Ending(
            descent.q, descent.met or descent.converged, descent.steps, tuple(descent.trace),
            f"in {descent.steps} steps", unit="steps",
        )  # fmt: skip


class _Descent(Iteration):
    """Steps until goals and equalities are met; contacts do not count."""

    def look(self, state: State) -> tuple[float, float]:
        """See `Iteration.look`; of the constraints the stated ones count."""
        held = [term.lower - values(term, "value", term.value(state)) for term in self.problem.stated]
        distance, angle, _ = goal_errors(self.problem, state)
        return max(distance, angle), float(np.abs(np.hstack([np.zeros(1), *held])).max())

    def clearance_violation(self, q: Array) -> float:
        """None."""
        return 0.0

    def moved(self, step: Array) -> Array:
        """Where a step (nv,), or a half of it or less, leads; StepError if a term is not finite on all of it."""
        problem = self.problem
        asked = (*problem.goals, *problem.stated, *problem.bounds, *problem.measures)
        for _ in range(12):
            moved = super().moved(step)
            error = undefined(asked, self.state.update(moved))
            if error is None:
                return moved
            self.control.step_back(error)
            step = 0.5 * step
        raise StepError(str(error))


class _Least(NamedTuple):
    """Steps of a problem, at the present state."""

    problem: Problem
    state: State
    damping: float

    def step(self, *_: object) -> Array:
        """Displacement (nv,), within the limits."""
        problem, state = self.problem, self.state
        equal = [(term, *values_and_rows(term, term.value, state)) for term in problem.stated]
        asked = [(goal.weight**0.5, *values_and_rows(goal, goal.error, state)) for goal in problem.goals]
        none = np.zeros((0, state.model.nv))
        held = np.hstack([np.zeros(0), *(term.lower - value for term, value, _ in equal)])
        of_held = np.vstack([none, *(rows for *_, rows in equal)])
        wanted = np.hstack([np.zeros(0), *(-root * error for root, error, _ in asked)])
        of_wanted = np.vstack([none, *(root * rows for root, _, rows in asked)])
        lower, upper = allowed(problem.bounds, problem.scene.figure.limits, state, None)
        free, stopped = upper > lower, np.zeros(state.model.nv)
        while True:  # every round stops one more joint, so the loop ends
            full: Array = stopped.copy()
            full[free] = _prioritised(
                of_held[:, free], held - of_held @ stopped, of_wanted[:, free], wanted - of_wanted @ stopped,
                self.damping,
            )  # fmt: skip
            over = free & ((full < lower) | (full > upper))
            if not over.any():
                return full
            stopped[over] = np.clip(full, lower, upper)[over]
            free &= ~over


def _prioritised(of_held: Array, held: Array, of_wanted: Array, wanted: Array, damping: float) -> Array:
    """Least motion (n,) that corrects the equalities, and then the goals in the null space of the equalities."""
    if not len(held):
        return _damped(of_wanted, wanted, damping)
    first = _damped(of_held, held, damping)
    square = of_held @ of_held.T
    value, vector = np.linalg.eigh(square)
    kept = value > RANK * max(float(value.max(initial=0.0)), RANK)
    basis = (vector[:, kept] / np.sqrt(value[kept])).T @ of_held  # orthonormal rows that span those of the equalities
    within = of_wanted - (of_wanted @ basis.T) @ basis
    second = _damped(within, wanted - of_wanted @ first, damping)
    return np.asarray(first + second - basis.T @ (basis @ second))


def _damped(jacobian: Array, error: Array, damping: float) -> Array:
    """``J' (J J' + lambda^2 I)^-1 e`` (n,) with Sugihara's damping."""
    if not len(error):
        return np.zeros(jacobian.shape[1])
    square = jacobian @ jacobian.T
    square[np.diag_indices_from(square)] += 0.5 * float(error @ error) + damping**2
    return np.asarray(jacobian.T @ np.linalg.solve(square, error))
