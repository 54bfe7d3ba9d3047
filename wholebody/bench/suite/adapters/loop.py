"""pink and mink as methods: steps of differential inverse kinematics, iterated as our method placo iterates its own.

Both have tasks of the same names, and one `solve_ik` a step, whose QPs are solved by DAQP.
"""

from __future__ import annotations

from abc import ABC
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array, with_values
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import Outside, Tool
from wholebody.figures.figure import Figure
from wholebody.methods import differential
from wholebody.methods.base import named_terms
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress
from wholebody.methods.differential import TOOL, Iteration, Settings, StepError
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.tasks.frame import PlacementResidual


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
        wb.CenterOfMass, wb.tasks.Displacement, wb.Effort, wb.Frame, wb.Freeze, wb.Orientation, wb.Point, wb.Posture,
        wb.Relative, wb.tasks.StepLimit,
    )  # fmt: skip

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
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
        ending = with_values(ending, left_out=self.leaves_out(problem))
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)

    def _room(self, problem: Problem) -> float:
        """What to keep beyond clearances because things move [m]: as far as one moved since the last solve, or more."""
        places = np.array([piece.placement.translation for piece in problem.scene.geometry.geometryObjects])
        before, self._places = self._places, places
        if before is None or before.shape != places.shape:
            return self._kept
        moved = float(np.linalg.norm(places - before, axis=1).max(initial=0.0))
        # Where things move, pairs keep pink's default of 2 cm, and 1.5 times as far as a thing moved in a frame.
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
        if isinstance(measure, (wb.Effort, wb.tasks.Displacement)):
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


class TaskStepper:
    """One problem in tasks of a package: goals soft, measures soft with a weight that fades, the rest as a tool can.

    What differs: how classes are told a frame, or a point in its axes; a task of joints at a posture (nq,) with costs
    (nv,); the configuration at a posture; a placement turned as another one at a place, and that of a residual; and
    further arguments of `solve_ik` for what is held, the degrees of freedom that stay, and pairs.
    """

    _named: Any
    _joints: Any
    _at: Any
    _target: Any
    _keeping: Any

    def __init__(self, problem: Problem, package: Any) -> None:
        self._problem, self._package, self._tasks = problem, package, package.tasks

    def _configured(self, q: Array) -> Any:
        raise NotImplementedError

    def begin(self, room: float) -> None:
        """Make the tasks anew; `room` is what pairs keep beyond their clearances."""
        problem = self._problem
        self._points: list[tuple[Any, tuple[str, ...], Array]] = []
        self._soft = [self._goal(goal) for goal in problem.goals]
        frozen = {dof for bound in problem.bounds if isinstance(bound, wb.Freeze)
                  for dof in problem.scene.figure.dofs(bound.joints).tolist()}  # fmt: skip
        self._kept = self._keeping([term.residual for term in problem.constraints if isinstance(term, wb.Hold)], frozen)
        costs = (self._joints(cost.reference, np.sqrt(cost.weights)) for cost in posture_costs(problem))
        self._measures = [(task, np.array(task.cost)) for task in costs]

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """One `solve_ik`, with a time step of one second."""
        with TOOL:
            configuration = self._configured(q)
        for task, name, place in self._points:
            task.set_target(self._at(configuration.get_transform_frame_to_world(*name), place))
        for task, share in self._measures:
            task.cost = weight**0.5 * share
        asked = [*self._soft, *(task for task, _ in self._measures)]
        try:
            with TOOL:
                velocity = self._package.solve_ik(
                    configuration, asked, 1.0, solver="daqp", damping=damping, **self._kept
                )
        except self._package.exceptions.NoSolutionFound as error:
            raise StepError(f"{type(error).__name__}: its program has no solution") from None
        return np.asarray(velocity, dtype=float)

    def _goal(self, goal: Any) -> Any:
        cost = goal.weight**0.5
        if isinstance(goal, wb.Point):
            name = self._named(goal.place, goal.resolved_offset)
            task = self._tasks.FrameTask(*name, position_cost=cost, orientation_cost=0.0)
            self._points.append((task, name, np.array(goal.resolved_target)))
        elif isinstance(goal, wb.CenterOfMass):
            task = self._tasks.ComTask(cost=np.array([cost, cost, cost if goal.axes == "xyz" else 0.0]))
            task.set_target(np.array((*goal.resolved_target, 0.0)[:3]))
        elif isinstance(goal, wb.Posture):
            costs = np.zeros(self._problem.scene.model.nv)
            costs[np.asarray(goal.dofs)] = cost
            task = self._joints(goal.resolved_target, costs)
        else:
            task = self._placement(goal.residual, cost)
        return task

    def _placement(self, residual: PlacementResidual, cost: float) -> Any:
        """A task that a frame is where it belongs, in the world or in another frame."""
        costs = {"position_cost": cost * residual.position, "orientation_cost": cost * residual.orientation}
        name = self._named(residual.place)
        if residual.base.frame:
            task = self._tasks.RelativeFrameTask(*name, *self._named(residual.base), **costs)
        else:
            task = self._tasks.FrameTask(*name, **costs)
        task.set_target(self._target(residual))
        return task


class TaskTool(Tool):
    """One `solve_ik` and `integrate_inplace` a step; feet are hard tasks.

    What differs: how classes are told a kind of frame, a task of the posture, and a placement at a place (3,).
    """

    _kind: tuple[str, ...] = ()
    _posture_task: Any
    _there: Any
    _package: Any
    _configuration: Any
    _kept: dict[str, Any]

    def begin(self, track: Track) -> None:
        """State the reach and what stays, at the start of a track."""
        self.reset(track.start)
        self._reach = self._frame(track.tip, 1.0, 0.0)
        posture = self._posture_task()
        posture.set_target(self._configuration.q)
        self._soft, self._feet = [self._reach, posture], [self._frame(foot, 1.0, 1.0) for foot in track.feet]
        for task in self._feet:
            task.set_target_from_configuration(self._configuration)

    def _frame(self, name: str, position: float, orientation: float) -> Any:
        return self._package.tasks.FrameTask(name, *self._kind, position_cost=position, orientation_cost=orientation)

    def step(self, target: Array) -> None:
        """Move one step."""
        self._reach.set_target(self._there(target))
        try:
            velocity = self._package.solve_ik(
                self._configuration,
                self._soft,
                SETTING.dt,
                solver="daqp",
                damping=SETTING.posture_cost**2,
                **self._kept,
            )
        except self._package.exceptions.NoSolutionFound:
            self.failures += 1
            return
        self._configuration.integrate_inplace(velocity, SETTING.dt)
