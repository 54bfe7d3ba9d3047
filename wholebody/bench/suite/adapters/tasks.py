"""What pink and mink share: tasks of the same names, and one `solve_ik` a step, whose QPs are solved by DAQP."""

from __future__ import annotations

from typing import Any

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import Tool
from wholebody.bench.suite.adapters.loop import posture_costs
from wholebody.methods.differential import TOOL, StepError
from wholebody.problem import Problem
from wholebody.tasks.residuals import PlacementResidual


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
        """The task of a goal."""
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
