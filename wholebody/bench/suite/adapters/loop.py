"""pink and mink as methods: steps of differential inverse kinematics, iterated as our method placo iterates its own."""

from __future__ import annotations

from abc import ABC
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array, with_values
from wholebody.bench.suite.adapters.base import Outside
from wholebody.figures.figure import Figure
from wholebody.methods import differential
from wholebody.methods.base import named_terms
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress
from wholebody.methods.differential import Iteration, Settings
from wholebody.problem import Problem
from wholebody.solution import Solution


class PostureCost(NamedTuple):
    """A measure as a squared distance from a posture (nq,), with weights (nv,) from 0 to 1."""

    reference: Array
    weights: Array


class Stepper(differential.Stepper, Protocol):
    """A tool, set up for one problem."""

    def begin(self, room: float) -> None:
        """State the problem as it is now; `room` is what pairs keep beyond clearances [m] beside moving things."""


class Loop(Outside[Stepper], ABC):
    """A tool as a method: refuses what it cannot express, builds its model, and iterates its steps.

    `kinds`: terms that the tool can express, besides holds of whole frames. `longest`: most that anything moves in one
    step, radians and shares of the figure's size. `margin`: most that a pair keeps beyond its clearance, as a share of
    the size: less fits into narrower gaps, more is against what linearised rows leave out. `out`: share of the room
    beside things that move that a pair which lacks it gains in one step.
    """

    longest: ClassVar[float] = 0.05
    margin: ClassVar[float] = 7e-4
    out: ClassVar[float] = 0.1
    kinds: ClassVar[tuple[type, ...]] = (
        wb.CenterOfMass, wb.Displacement, wb.Effort, wb.Frame, wb.Freeze, wb.Orientation, wb.Point, wb.Posture,
        wb.Relative, wb.StepLimit,
    )  # fmt: skip

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        """Take a budget."""
        super().__init__(tolerance, iterations)
        self._places: Array | None = None
        self._kept = 0.0

    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """All but the start, which alone needs no other model."""
        return problem.scene, problem.goals, problem.constraints, problem.bounds, problem.measures, problem.clearances

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture; InputError where the tool cannot express the problem, or its scene changed."""
        stepper, room = self.ready(problem), self._room(problem)
        longest = self.longest * max(1.0, size(problem.scene.figure))  # the tool bounds turns and lengths apart
        most = 200 if self.iterations is None else self.iterations  # most, where nothing else is said
        # The weight of the measures fades to 0.6 from one iteration to the next.
        settings = Settings(self.tolerance, most, longest, 0.6, best=True)
        if room:
            # Where things move, rows keep what is beyond a clearance, and ask for the goal beside it.
            settings = with_values(settings, best=False, least=min(10, most))
        with Control(None, progress) as control, problem.borrow() as workspace:
            stepper.begin(room)
            run = Iteration(problem, workspace, stepper, settings, control)
            run.go()
        failure = f"{self.name} gave up at step {run.steps} ({run.failure})" if run.failure else ""
        ending = Ending(run.q, run.converged, run.steps, tuple(run.trace), f"in {run.steps} steps", "steps", failure)
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)

    def _room(self, problem: Problem) -> float:
        """What to keep beyond clearances because things move [m]: as far as one moved since the last solve, or more."""
        places = np.array([piece.placement.translation for piece in problem.scene.geometry.geometryObjects])
        before, self._places = self._places, places
        if before is None or before.shape != places.shape:
            return self._kept
        moved = float(np.linalg.norm(places - before, axis=1).max(initial=0.0))
        # Where things move, pairs keep 2 cm beyond their clearances, pink's default, and 1.5 times as
        # far as a thing moved in a frame.
        self._kept = max(self._kept, 0.02, 1.5 * moved) if moved else self._kept
        return self._kept

    def unsupported(self, problem: Problem) -> list[str]:
        """What the tool cannot express, each with the reason where it is not plain."""
        refused = []
        for where, term in named_terms(problem):
            if isinstance(term, wb.Hold):
                refused += [] if term.orientation else [f"{where} (its hard tasks hold whole frames)"]
            elif not isinstance(term, self.kinds):
                refused.append(where)
        return refused


def placements(problem: Problem) -> Array:
    """Placements (n, 4, 4) of all pieces in what carries them."""
    return np.array([piece.placement.homogeneous for piece in problem.scene.geometry.geometryObjects])


def posture_costs(problem: Problem) -> list[PostureCost]:
    """The measures, with weights of at most 1."""
    found = []
    for measure in problem.measures:
        if isinstance(measure, (wb.Effort, wb.Displacement)):
            weights = measure.distance.weights
            share = measure.weight / max(float(weights.max()), 1e-12)
            found.append(PostureCost(measure.distance.reference, share * weights))
    return found


def size(figure: Figure) -> float:
    """Length of the longest chain of joints and frames from the root, metres: lengths are shares of it."""
    model = figure.model
    there = np.zeros(model.njoints)
    for index in range(1, model.njoints):
        parent = model.parents[index]
        here = model.jointPlacements[index].translation if parent else np.zeros(3)  # where it stands is no length
        there[index] = there[parent] + float(np.linalg.norm(here))
    tips = [there[frame.parentJoint] + float(np.linalg.norm(frame.placement.translation)) for frame in model.frames]
    return max([*there, *tips], default=0.0) or 1.0


def margins(problem: Problem, most: float) -> Array:
    """What each pair keeps beyond its clearance (pairs,) [m]: at most so much, and no more than the start allows."""
    found = np.full(len(problem.clearances), most)
    if most <= 0.0:
        return found
    share = 0.5  # of the room that a pair has at the start: most of its margin
    reach = float(problem.clearances.max(initial=0.0)) + most / share
    with problem.borrow() as workspace:
        near = workspace.near(problem.scene.figure.clamp(problem.start), reach)
        room = near.distance - problem.clearances[near.number]
        found[near.number] = np.clip(share * room, 0.0, most)
    # Tools have a class for each value: margins that differ by less than a quarter of the largest are one.
    return np.floor(4.0 * found / most) * most / 4.0


def longest_moves(figure: Figure, longest: float) -> Array:
    """Most that each degree of freedom moves in one step (nv,), radians and metres."""
    model, found = figure.model, np.full(figure.model.nv, longest)
    for joint in list(model.joints)[1:]:
        if joint.shortname().startswith("JointModelP"):
            found[joint.idx_v] = longest * size(figure)
    return found


class Pair(NamedTuple):
    """Two pieces, the clearance asked of them and the margin beyond it [m]."""

    first: int
    second: int
    clearance: float
    margin: float


def kept_apart(problem: Problem, margin: float, held: bool = True) -> list[Pair]:
    """Pairs that can move against each other, with margins of at most `margin` metres."""
    # The pair of a held foot and the floor would leave a program no solution: both differ to second order.
    pieces = problem.scene.geometry.geometryObjects
    still = {0}
    for term in problem.constraints:
        if held and isinstance(term, wb.Hold) and term.relative_to is None and term.orientation:
            still.add(term.residual.place.joint)
    pairs = zip(
        problem.scene.geometry.collisionPairs,
        problem.clearances.tolist(),
        margins(problem, margin).tolist(),
        strict=True,
    )
    return [
        Pair(pair.first, pair.second, clearance, margin)
        for pair, clearance, margin in pairs
        if not {pieces[pair.first].parentJoint, pieces[pair.second].parentJoint} <= still
    ]
