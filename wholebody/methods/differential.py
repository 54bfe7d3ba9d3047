"""Differential inverse kinematics iterated until a problem is solved, by tools that make one step.

Goals are soft tasks of the tool and what must hold are hard ones. The measures have a weight that fades, steps are of a
bounded size, and a damping grows while steps go to and fro.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.geometry.proximity import COAL_ACCURACY
from wholebody.methods.control import Control
from wholebody.problem import Problem
from wholebody.solution import TraceEntry
from wholebody.workspace import Workspace

SHARE = 0.5  # of the tolerance: to what everything is met, so that the judge, who rounds otherwise, agrees
REST = 1e-2  # share of the tolerance: a step smaller than this has come to rest
COMFORT = 1e-2  # weight of the measures at the beginning, against goals of weight 1
LEAST = 1e-3  # share of the tolerance: least weight of the measures, which goals then miss by less than the tolerance
REGULAR = 1e-3  # share of the measures' weight: what moving itself costs
DAMPING = 1e-3  # what moving costs once a step goes back on the one before, against goals of weight 1
STIFFER, LOOSER = 4.0, 0.5  # factors on that, after another such step and after any other
MOST_DAMPING = 10.0


class StepError(Exception):
    """A tool found no step; with its words."""


class Stepper(Protocol):
    """A tool, set up for one problem."""

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """One step of the tool.

        Args:
            q: (nq,) the posture.
            weight: of the measures, against goals of weight 1.
            damping: what moving costs.

        Returns:
            The displacement (nv,).

        Raises:
            StepError: the tool found none.
        """


class Settings(NamedTuple):
    """How steps are iterated.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most steps.
        longest: most that a joint or the root moves in one step [rad, m].
        decay: of the measures' weight from one step to the next.
    """

    tolerance: float
    iterations: int
    longest: float
    decay: float


class Iteration:
    """One solve.

    Attributes:
        q: (nq,) the present posture.
        steps: how many were made.
        rested: whether it ended because nothing moves any more.
        failure: the tool's words where it found no step.
        trace: one entry a posture.
    """

    def __init__(
        self, problem: Problem, workspace: Workspace, stepper: Stepper, settings: Settings, control: Control
    ) -> None:
        """Begin at the start, within the limits."""
        self._problem, self._stepper, self._settings, self._control = problem, stepper, settings, control
        self._proximity, self._state = workspace.proximity, workspace.state
        self.q: Array = problem.scene.figure.clamp(problem.start)
        self.trace: list[TraceEntry] = []
        self.steps, self.rested, self.failure = 0, False, ""
        self._damping, self._last = 0.0, np.zeros(problem.scene.model.nv)

    def go(self) -> None:
        """Iterate until everything is met, nothing moves, the tool gives up, or steps or time run out."""
        settings, model = self._settings, self._problem.scene.model
        enough, length = SHARE * settings.tolerance, 0.0
        while True:
            error, violation = self._look()
            self.trace.append(TraceEntry(error, violation, 0.0, length))
            self._control.tell(self.trace[-1])
            if max(error, violation) <= enough and self._apart(enough):
                return
            if self.steps and length <= REST * settings.tolerance:
                self.rested = True
                return
            if self.steps == settings.iterations or self._control.over:
                return
            try:
                move = self._move()
            except StepError as failure:
                self.failure = str(failure)
                return
            moved = self._problem.scene.figure.clamp(np.asarray(pin.integrate(model, self.q, move)))
            length = float(np.abs(pin.difference(model, self.q, moved)).max(initial=0.0))
            self.q = moved

    def _move(self) -> Array:
        """The tool's displacement (nv,), no longer than it may be; the damping goes by its direction."""
        settings = self._settings
        weight = max(COMFORT * settings.decay**self.steps, LEAST * settings.tolerance)
        self.steps += 1
        move = self._stepper.step(self.q, weight, max(REGULAR * weight, self._damping))
        if not np.isfinite(move).all():
            raise StepError("a displacement that is not a number")
        move = move * min(1.0, settings.longest / max(float(np.abs(move).max(initial=0.0)), settings.longest))
        back = float(move @ self._last) < 0.0
        self._damping = min(max(STIFFER * self._damping, DAMPING), MOST_DAMPING) if back else LOOSER * self._damping
        self._last = move
        return move

    def _look(self) -> tuple[float, float]:
        """The largest error of a goal and of a constraint, metres or radians."""
        state = self._state.update(self.q)
        errors, violations = [0.0], [0.0]
        for goal in self._problem.goals:
            error = np.atleast_1d(goal.error(state))
            angular = np.broadcast_to(goal.angular, error.shape)
            errors += [float(np.linalg.norm(error[angular])), float(np.linalg.norm(error[~angular]))]
        for term in self._problem.constraints:
            value = np.atleast_1d(term.value(state))
            violations.append(float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0)))
        return max(errors), max(violations)

    def _apart(self, tolerance: float) -> bool:
        """Whether all pairs keep their clearance."""
        clearances = self._problem.clearances
        near = self._proximity.query(self._state, float(clearances.max(initial=0.0)))
        return bool((near.distance >= clearances[near.number] - tolerance - COAL_ACCURACY).all())
