"""Damped least squares, which ignores contacts: docs/theory/damped_least_squares.md has the equations.

The damping is that of Sugihara 2011 (eq. 19). Equalities have priority, and goals act in their null space (Nakamura,
Hanafusa and Yoshikawa 1987), whose projector is not damped (Baerlocher and Boulic 2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import goal_errors
from wholebody.base.arrays import Array
from wholebody.base.fields import Checked
from wholebody.figures.state import State
from wholebody.methods.base import DAMPING, Iterations, TimeLimit, Tolerance, UnsupportedTermError
from wholebody.methods.conclusion import Descends, Ending
from wholebody.methods.control import Control
from wholebody.methods.differential import REST
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
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

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`; contacts are ignored."""
        self._check_terms(problem)
        descent = _Descent(problem, self, workspace.state, control)
        converged = descent.run()
        return Ending(
            descent.best, converged, descent.steps, tuple(descent.trace), f"in {descent.steps} steps", unit="steps",
            caveat="this method sees neither contacts nor what people have by default",
        )  # fmt: skip


class _Descent:
    """One descent: the best posture so far, and its trace."""

    def __init__(self, problem: Problem, method: DampedLeastSquares, state: State, control: Control) -> None:
        self._problem, self._method, self._state, self._control = problem, method, state, control
        self.best: Array = problem.scene.figure.clamp(problem.start)
        self.trace: list[TraceEntry] = []
        self.steps = 0

    def run(self) -> bool:
        """Descend; true if it converged or the goals are met, false if the iterations ran out."""
        problem, method = self._problem, self._method
        # of the tolerance, to which goals and equalities are met: the assessment rounds differently
        enough = 0.5 * method.tolerance
        q, step, best = self.best, 0.0, (np.inf, np.inf)
        for _ in range(method.iterations + 1):
            self._state.update(q)
            held = [term.lower - values(term, "value", term.value(self._state)) for term in problem.stated]
            distance, angle, _ = goal_errors(problem, self._state)
            violation, error = float(np.abs(np.hstack([np.zeros(1), *held])).max()), max(distance, angle)
            self.trace.append(TraceEntry(error, violation, 0.0, step))
            self._control.tell(self.trace[-1])
            if (max(violation, enough), error) < best:
                best, self.best = (max(violation, enough), error), q
            if max(violation, error) <= enough:
                return True
            if self.steps and step <= REST * method.tolerance:
                return True
            if self.steps == method.iterations or (self.steps and self._control.over):  # a frame gets on in any case
                break
            moved = self._moved(q, self._step())
            if moved is None:
                return False
            step = float(np.abs(pin.difference(problem.scene.model, q, moved)).max(initial=0.0))
            q = moved
            self.steps += 1
        return False

    def _moved(self, q: Array, way: Array) -> Array | None:
        """Where a way (nv,), or a half of it or less, leads from q (nq,); None if a term is not finite on all of it."""
        problem = self._problem
        asked = (*problem.goals, *problem.stated, *problem.bounds, *problem.measures)
        # of a step to where a term of one's own is not finite, before the descent ends
        for _ in range(12):
            moved = problem.scene.figure.clamp(np.asarray(pin.integrate(problem.scene.model, q, way)))
            error = undefined(asked, self._state.update(moved))
            if error is None:
                return moved
            self._control.step_back(error)
            way = 0.5 * way
        return None

    def _step(self) -> Array:
        """Displacement (nv,), within the limits."""
        problem, state = self._problem, self._state
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
                self._method.damping,
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
