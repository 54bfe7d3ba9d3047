"""Differential inverse kinematics iterated until a problem is solved: what pink and mink leave to their users.

The loop is that of our adapter to placo: goals as soft tasks and what must hold as hard ones, the measures by a weight
that fades, steps of a bounded size, and a damping that grows while steps go to and fro.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.geometry.proximity import COAL_ACCURACY
from wholebody.methods.base import SolvingTracker, UnsupportedTermError, named_terms, refusal
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress
from wholebody.problem import Problem
from wholebody.solution import Solution, TraceEntry
from wholebody.tasks import Displacement, Effort, Hold
from wholebody.workspace import Workspace

STEP = (
    0.025  # rad, m: most that a joint or the root moves in one iteration; twice that leaves pink no solution more often
)
NEAR = 0.1  # m: pairs nearer than this have a row, where a tool has such a setting
GAIN = 1.0  # share of what is free of a gap that may be used up in one iteration; with less, held feet cannot come back
ITERATIONS = 200  # most, where nothing else is said
SHARE = 0.5  # of the tolerance: to what everything is met, so that the judge, who rounds otherwise, agrees
REST = 1e-2  # share of the tolerance: a step smaller than this has come to rest
COMFORT = 1e-2  # weight of the measures at the beginning, against goals of weight 1
DECAY = 0.6  # of that weight from one iteration to the next
LEAST = 1e-3  # share of the tolerance: least weight of the measures
REGULAR = 1e-3  # share of the measures' weight: what moving itself costs
DAMPING, STIFFER, LOOSER, MOST_DAMPING = 1e-3, 4.0, 0.5, 10.0  # of steps that go back on the one before


class StepError(Exception):
    """A tool found no step; with its words."""


class Pull(NamedTuple):
    """A measure as a weighted squared distance from a posture.

    Attributes:
        reference: (nq,) that posture.
        weights: (nv,) from 0 to 1.
    """

    reference: Array
    weights: Array


class Stepper(ABC):
    """A tool, set up for one problem."""

    @abstractmethod
    def begin(self) -> None:
        """State the problem's present goals, constraints and places of objects by the tool's classes."""

    @abstractmethod
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


class Loop(ABC):
    """A tool as a method: refuses what it cannot express, builds its model, and iterates its steps.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most steps.
    """

    name: str

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        """Take a budget."""
        if not 1e-10 <= tolerance <= 0.1:
            raise InputError(f"tolerance is {tolerance}; give metres from 1e-10 to 0.1")
        self.tolerance, self.iterations = tolerance, ITERATIONS if iterations is None else iterations
        self._built: tuple[Problem, Stepper] | None = None

    @abstractmethod
    def takes(self, term: Any) -> str | None:
        """None for a term that the tool can express, else why not, in a few words (or nothing)."""

    @abstractmethod
    def build(self, problem: Problem) -> Stepper:
        """Build the tool's model of a problem.

        Raises:
            InputError: the tool has no joint or shape of a kind that is needed.
        """

    def prepare(self, problem: Problem) -> None:
        """Build what a solve needs.

        Raises:
            InputError: the tool cannot express the problem, or its scene changed after it was stated.
        """
        problem.check_fresh()
        refused = self._unsupported(problem)
        if refused:
            raise UnsupportedTermError(self.name, refused)
        if self._built is None or self._built[0] is not problem:
            self._built = (problem, self.build(problem))

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture.

        Args:
            problem: what is asked.
            progress: see `wholebody.methods.control.Progress`.

        Raises:
            InputError: the tool cannot express the problem, or its scene changed after it was stated.
        """
        began = time.perf_counter()
        self.prepare(problem)
        assert self._built is not None
        with problem.lend() as workspace, Control(None, progress) as control:
            run = _Run(problem, workspace, self._built[1], self, control)
            run.go()
        failure = f"{self.name} gave up at step {run.steps} ({run.failure})" if run.failure else ""
        ending = Ending(run.q, run.rested, run.steps, tuple(run.trace), f"in {run.steps} steps", "steps", failure)
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control, began=began)

    def accepts(self, problem: Problem) -> str | None:
        """None where the tool can express all terms; else the sentence that names those that it cannot."""
        return refusal(self.name, self._unsupported(problem))

    def tracker(self, problem: Problem, dt: float) -> SolvingTracker:
        """What follows the goals of a problem by solving every step anew."""
        return SolvingTracker(self, problem, dt)

    def _unsupported(self, problem: Problem) -> list[str]:
        refused = []
        for where, term in named_terms(problem):
            reason = self.takes(term)
            if reason is not None:
                refused.append(where + (f" ({reason})" if reason else ""))
        return refused


def pulls(problem: Problem) -> list[Pull]:
    """The measures, with weights of at most 1."""
    found = []
    for measure in problem.measures:
        if isinstance(measure, (Effort, Displacement)):
            weights = measure.distance.weights
            found.append(Pull(measure.distance.reference, measure.weight * weights / max(float(weights.max()), 1e-12)))
    return found


def kept_apart(problem: Problem) -> list[tuple[int, int, float]]:
    """Pairs that can move against each other, as two pieces and the clearance asked of them [m].

    A foot that a hard task holds stands on the floor as it does at the start. Its pair and its task would ask for the
    same to first order and for different things to second order, which leaves a program no solution.
    """
    pieces = problem.scene.geometry.geometryObjects
    still = {0}
    for term in problem.constraints:
        if isinstance(term, Hold) and term.relative_to is None and term.orientation:
            still.add(term.residual.place.joint)
    pairs = zip(problem.scene.geometry.collisionPairs, problem.clearances.tolist(), strict=True)
    return [
        (pair.first, pair.second, clearance)
        for pair, clearance in pairs
        if not {pieces[pair.first].parentJoint, pieces[pair.second].parentJoint} <= still
    ]


class _Run:
    """One solve: the present posture, and how it ended."""

    def __init__(
        self, problem: Problem, workspace: Workspace, stepper: Stepper, method: Loop, control: Control
    ) -> None:
        self._problem, self._stepper, self._method, self._control = problem, stepper, method, control
        self._state, self._proximity = workspace.state, workspace.proximity
        self.q: Array = problem.scene.figure.clamp(problem.start)
        self.trace: list[TraceEntry] = []
        self.steps, self.rested, self.failure = 0, False, ""
        self._damping, self._last = 0.0, np.zeros(problem.scene.model.nv)
        stepper.begin()

    def go(self) -> None:
        """TraceEntry until everything is met, nothing moves, the tool gives up or the steps run out."""
        enough = SHARE * self._method.tolerance
        length = 0.0
        while True:
            error, violation = self._look()
            self.trace.append(TraceEntry(error, violation, 0.0, length))
            self._control.tell(self.trace[-1])
            if self._control.over:
                return
            if max(error, violation) <= enough and self._apart(enough):
                return
            if self.steps and length <= REST * self._method.tolerance:
                self.rested = True
                return
            if self.steps == self._method.iterations:
                return
            try:
                moved = self._moved()
            except StepError as failure:
                self.failure = str(failure)
                return
            length = float(np.abs(pin.difference(self._problem.scene.model, self.q, moved)).max(initial=0.0))
            self.q = moved

    def _moved(self) -> Array:
        weight = max(COMFORT * DECAY**self.steps, LEAST * self._method.tolerance)
        self.steps += 1
        move = self._stepper.step(self.q, weight, max(REGULAR * weight, self._damping))
        if not np.isfinite(move).all():
            raise StepError("a displacement that is not a number")
        move = move * min(1.0, STEP / max(float(np.abs(move).max(initial=0.0)), STEP))
        back = float(move @ self._last) < 0.0
        self._damping = min(max(STIFFER * self._damping, DAMPING), MOST_DAMPING) if back else LOOSER * self._damping
        self._last = move
        scene = self._problem.scene
        return scene.figure.clamp(np.asarray(pin.integrate(scene.model, self.q, move)))

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
