"""pink and mink as methods: steps of differential inverse kinematics, iterated as our method placo iterates its own."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple, Protocol

import wholebody as wb
from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.methods import differential
from wholebody.methods.base import SolvingTracker, UnsupportedTermError, named_terms, refusal
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress
from wholebody.methods.differential import Iteration, Settings
from wholebody.problem import Problem
from wholebody.solution import Solution

STEP = 0.025  # rad, m: most that anything moves in one iteration; twice that leaves pink no solution more often
NEAR = 0.1  # m: pairs nearer than this have a row, where a tool has such a setting
GAIN = 1.0  # share of what is free of a gap that may be used up in one iteration; with less, held feet cannot come back
ITERATIONS = 200  # most, where nothing else is said
DECAY = 0.6  # of the measures' weight from one iteration to the next


class Pull(NamedTuple):
    """A measure as a weighted squared distance from a posture.

    Attributes:
        reference: (nq,) that posture.
        weights: (nv,) from 0 to 1.
    """

    reference: Array
    weights: Array


class Stepper(differential.Stepper, Protocol):
    """A tool, set up for one problem."""

    def begin(self) -> None:
        """State the problem's present goals, constraints and places of objects by the tool's classes."""


class Loop(ABC):
    """A tool as a method: refuses what it cannot express, builds its model, and iterates its steps.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most steps.
        kinds: terms that the tool can express, besides holds of whole frames.
    """

    name: str
    kinds: ClassVar[tuple[type, ...]] = (
        wb.CenterOfMass, wb.Displacement, wb.Effort, wb.Frame, wb.Freeze, wb.Orientation, wb.Point, wb.Posture,
        wb.Relative, wb.StepLimit,
    )  # fmt: skip

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        """Take a budget."""
        if not 1e-10 <= tolerance <= 0.1:
            raise InputError(f"tolerance is {tolerance}; give metres from 1e-10 to 0.1")
        self.tolerance, self.iterations = tolerance, ITERATIONS if iterations is None else iterations
        self._built: tuple[Problem, Stepper] | None = None

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
        stepper, settings = self._built[1], Settings(self.tolerance, self.iterations, STEP, DECAY)
        with problem.borrow() as workspace, Control(None, progress) as control:
            stepper.begin()
            run = Iteration(problem, workspace, stepper, settings, control)
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
        """What the tool cannot express, each with the reason where it is not plain."""
        refused = []
        for where, term in named_terms(problem):
            if isinstance(term, wb.Hold):
                refused += [] if term.orientation else [f"{where} (its hard tasks hold whole frames)"]
            elif not isinstance(term, self.kinds):
                refused.append(where)
        return refused


def pulls(problem: Problem) -> list[Pull]:
    """The measures, with weights of at most 1."""
    found = []
    for measure in problem.measures:
        if isinstance(measure, (wb.Effort, wb.Displacement)):
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
        if isinstance(term, wb.Hold) and term.relative_to is None and term.orientation:
            still.add(term.residual.place.joint)
    pairs = zip(problem.scene.geometry.collisionPairs, problem.clearances.tolist(), strict=True)
    return [
        (pair.first, pair.second, clearance)
        for pair, clearance in pairs
        if not {pieces[pair.first].parentJoint, pieces[pair.second].parentJoint} <= still
    ]
