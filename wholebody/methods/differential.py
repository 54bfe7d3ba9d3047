"""Differential inverse kinematics iterated until a problem is solved, by tools that make one step."""

from __future__ import annotations

import threading
import time
from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import goal_errors, largest_violation
from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.methods.control import Control
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.tasks.checks import values_and_rows

REST = 1e-2  # share of the tolerance: a smaller step counts as convergence
MEASURES = 1e-2  # weight of the measures at the beginning, against goals of weight 1
LEAST = 1e-3  # share of the tolerance: least weight of the measures, which goals then miss by less than the tolerance
REGULAR = 1e-3  # share of the measures' weight: weight of the motion itself
DAMPING = 1e-3  # weight of the motion after a step opposed to the previous one, against goals of weight 1
STIFFER, LOOSER = 4.0, 0.5  # factors on that, after another such step and after any other
MOST_DAMPING = 10.0
NEGLIGIBLE = 1e-4  # m, rad: a constraint violated by less than this is no reason to prefer an earlier posture


class Stopwatch(threading.local):
    """Adds up the time that this thread spends within it: `seconds` so far, wall time."""

    def __init__(self) -> None:
        self.seconds = self._began = 0.0

    def __enter__(self) -> None:
        """Begin to count."""
        self._began = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        """Add what went by."""
        self.seconds += time.perf_counter() - self._began


TOOL = Stopwatch()
"""Runs while a tool computes, so that its time is told apart from what states problems to it and judges its steps."""


def held(problem: Problem, state: State, q: Array, tolerance: float) -> Array:
    """The posture (nq,) near q, within limits, where stated equalities hold: a few of Newton's least motions."""
    equal = [term for term in problem.stated if np.array_equal(term.lower, term.upper)]
    for _ in range(4 if equal else 0):
        found = [(term, *values_and_rows(term, term.value, state.update(q))) for term in equal]
        missed = np.concatenate([value - term.lower for term, value, _ in found])
        if not np.abs(missed).max() > tolerance:
            break
        step = np.linalg.lstsq(np.concatenate([rows for *_, rows in found]), -missed, rcond=1e-6)[0]
        q = problem.scene.figure.clamp(np.asarray(pin.integrate(state.model, q, step)))
    return q


class StepError(Exception):
    """A tool found no step; the message is the tool's."""


class Stepper(Protocol):
    """A tool, set up for one problem."""

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """Displacement (nv,) of one step of the tool from q (nq,), measures weighted against 1; `StepError` if none."""


class Settings(NamedTuple):
    """How steps are iterated."""

    tolerance: float  # metres and radians to which goals and constraints are met
    iterations: int  # most steps
    longest: float  # most that a joint or the root moves in one step [rad, m]
    decay: float  # of the measures' weight from one step to the next
    # whether the answer is the best posture of all, in place of the last one: for tools that may go in and do not lead
    # out again
    best: bool = False
    least: int = 0  # fewest steps before the goals count as met, for tools that evade what comes
    negligible: float = NEGLIGIBLE  # m, rad: see there


class Iteration:
    """One solve.

    Attributes:
        q: (nq,) the present posture.
        steps: how many were made.
        met: whether everything is met.
        converged: whether nothing moves any more.
        failure: the tool's message if it found no step.
        trace: one entry a posture.
    """

    def __init__(
        self, problem: Problem, workspace: Workspace, stepper: Stepper, settings: Settings, control: Control
    ) -> None:
        self.problem, self._stepper, self._settings, self.control = problem, stepper, settings, control
        self._proximity, self.state = workspace.proximity, workspace.state
        self.q: Array = problem.scene.figure.clamp(problem.start)
        self.trace: list[TraceEntry] = []
        self.steps, self.met, self.converged, self.failure = 0, False, False, ""
        self._damping, self._last = 0.0, np.zeros(problem.scene.model.nv)
        self._best, self._best_rank = self.q, (np.inf, np.inf)

    def go(self) -> None:
        """Iterate until everything is met, nothing moves, the tool fails, or steps or time run out."""
        self._iterate()
        if self._settings.best:
            self.q = self._best

    def _iterate(self) -> None:
        settings, model = self._settings, self.problem.scene.model
        # of the tolerance, to which goals and constraints are met: the assessment rounds differently
        enough, length = 0.5 * settings.tolerance, 0.0
        while True:
            error, violation = self.look(self.state.update(self.q))
            self.trace.append(TraceEntry(error, violation, 0.0, length))
            self.control.tell(self.trace[-1])
            if self._settings.best:
                self._rank(error, violation)
            early, near = self.steps < settings.least, max(error, violation) <= enough
            if not early and near and self.clearance_violation(self.q) <= enough + COAL_ACCURACY:
                self.met = True
                return
            if self.steps and not early and length <= REST * settings.tolerance:
                self.converged = True
                return
            if self.steps == settings.iterations or (self.steps and self.control.over):  # a frame gets on in any case
                return
            try:
                moved = self.moved(self._move())
            except StepError as failure:
                self.failure = str(failure)
                return
            length = float(np.abs(pin.difference(model, self.q, moved)).max(initial=0.0))
            self.q = moved

    def _move(self) -> Array:
        """The tool's displacement (nv,), cut to the longest step; its direction sets the damping of the next one."""
        settings = self._settings
        weight = max(MEASURES * settings.decay**self.steps, LEAST * settings.tolerance)
        self.steps += 1
        move = self._stepper.step(self.q, weight, max(REGULAR * weight, self._damping))
        if not np.isfinite(move).all():
            raise StepError("a displacement that is not a number")
        move = move * min(1.0, settings.longest / max(float(np.abs(move).max(initial=0.0)), settings.longest))
        back = float(move @ self._last) < 0.0
        self._damping = min(max(STIFFER * self._damping, DAMPING), MOST_DAMPING) if back else LOOSER * self._damping
        self._last = move
        return move

    def moved(self, step: Array) -> Array:
        """Where a step (nv,) leads, within limits; `StepError` if nowhere."""
        return self.problem.scene.figure.clamp(np.asarray(pin.integrate(self.problem.scene.model, self.q, step)))

    def clearance_violation(self, q: Array) -> float:
        """By what the worst pair is nearer than its clearance at a posture (nq,) [m]."""
        clearances = self.problem.clearances
        near = self._proximity.query(self.state.update(q).data, float(clearances.max(initial=0.0)))
        return float((clearances[near.number] - near.distance).max(initial=0.0))

    def _rank(self, error: float, violation: float) -> None:
        """Keep the present posture if it is the best so far: least broken, then nearest; of equal ones the last."""
        broken = max(violation, self.clearance_violation(self.q))
        rank = (max(broken, self._settings.tolerance, self._settings.negligible), error)
        if rank <= self._best_rank:
            self._best, self._best_rank = self.q, rank

    def look(self, state: State) -> tuple[float, float]:
        """The largest error of a goal and of a constraint at a state, metres or radians."""
        distance, angle, _ = goal_errors(self.problem, state)
        return max(distance, angle), largest_violation(self.problem, state)
