"""Goals and constraints of a problem as equations of bodies; terms of users' classes by their rows in the tangent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.newton.batches import HARD, ONE_SIDED, EquationSet, Role, Unit
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.measures import FigureObjective
from wholebody.methods.newton.own_rows import constraint_rows, goal_rows
from wholebody.methods.newton.quaternions import axes_along
from wholebody.methods.newton.system import ActiveSystem
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Goal
from wholebody.tasks.checks import undefined
from wholebody.tasks.frame import PlacementResidual


def state_equations(problem: Problem, state: State) -> None:
    """Build all equations of a problem once, to find unsupported terms; the state is moved to the start."""
    bodies = FigureBodies(problem.scene.figure, problem.start)
    goal_equations(problem, bodies, problem.goals)
    constraint_equations(problem, bodies)
    bound_equations(problem, bodies, state)


def goal_equations(problem: Problem, bodies: FigureBodies, goals: Sequence[Goal]) -> EquationSet:
    """Equations of goals."""
    result = EquationSet()
    for number, goal in enumerate(goals):
        label, role = f"goals[{number}], {type(goal).__name__}", Role(goal.weight)
        if isinstance(goal, tasks.Point):
            point = _local(bodies, goal.place.frame).act(goal.resolved_offset)
            result.coincide(bodies.index(goal.place.joint), -1, label, point, goal.resolved_target, role)
        elif isinstance(goal, (tasks.Frame, tasks.Orientation, tasks.Relative)):
            _placement(result, bodies, goal.residual, label, role)
        elif isinstance(goal, tasks.Axis) and goal.toward is None:
            ours = axes_along(_local(bodies, goal.place.frame).rotation @ goal.basis[2])
            result.turn(bodies.index(goal.place.joint), -1, label, ours, axes_along(goal.resolved_target), 2, role)
        else:
            depends = None
            if isinstance(goal, tasks.Posture):  # each joint on itself
                joint = np.repeat(np.arange(bodies.model.njoints), bodies.model.nvs)
                depends = joint[goal.dofs][:, None] == joint
            result.add(goal_rows(bodies, goal, label, depends), role)
    return result


def constraint_equations(problem: Problem, bodies: FigureBodies) -> EquationSet:
    """Equations of constraints."""
    result = EquationSet()
    for number, term in enumerate(problem.constraints):
        label = f"constraints[{number}], {type(term).__name__}"
        if isinstance(term, tasks.Hold):
            _placement(result, bodies, term.residual, label)
        elif isinstance(term, tasks.Plane):
            place, body = np.array(_local(bodies, term.place.frame).translation), bodies.index(term.place.joint)
            role = ONE_SIDED if term.side == "above" else HARD
            result.slide(-1, body, label, term.resolved_normal, place, term.height, role)
        else:
            for rows, role in zip(constraint_rows(bodies, term, label), (HARD, ONE_SIDED), strict=True):
                if rows is not None:
                    result.add(rows, role)
    return result


def bound_equations(problem: Problem, bodies: FigureBodies, state: State) -> EquationSet:
    """Equations of bounds; the state is moved to the problem's start."""
    result = EquationSet()
    for number, bound in enumerate(problem.bounds):
        if isinstance(bound, tasks.Freeze):
            _frozen(result, bodies, bound, state.update(problem.start))
        elif not isinstance(bound, tasks.StepLimit):  # a solve has no time step, so a step limit bounds nothing
            raise UnsupportedTermError(
                "newton", [f"bounds[{number}], {type(bound).__name__} (it takes Freeze and StepLimit)"]
            )
    return result


def _placement(
    equations: EquationSet, bodies: FigureBodies, residual: PlacementResidual, label: str, role: Role = HARD
) -> None:
    """The residual of one frame in another: a point that coincides, and axes that agree."""
    ends = _local(bodies, residual.base.frame) * residual.placement, _local(bodies, residual.place.frame)
    a, b = bodies.index(residual.base.joint), bodies.index(residual.place.joint)
    equations.place(a, b, label, ends, role, (residual.position, residual.orientation))


def _frozen(equations: EquationSet, bodies: FigureBodies, bound: tasks.Freeze, state: State) -> None:
    """Joints that keep their placement relative to their parent at a state."""
    figure, model = bodies.figure, bodies.model
    for name in figure.joint_names(bound.joints):
        law = figure.followers.get(name)  # one that follows is frozen by the one that leads it
        joint = figure.joint_id(name if law is None else law.joint)
        parent = int(model.parents[joint])
        here = state.data.oMi[parent].actInv(state.data.oMi[joint])
        a, b, label = bodies.index(parent), bodies.index(joint), f"Freeze, {name!r}"
        # of a revolute joint, whose own equations leave only this rotation, two of the three rows are redundant
        moves = model.joints[joint].nv > 1 or not model.joints[joint].shortname().startswith("JointModelR")
        equations.place(a, b, label, (here, pin.SE3.Identity()), HARD, (moves, True))


def _local(bodies: FigureBodies, frame: int) -> Any:
    """Placement of a frame in its body."""
    return bodies.model.frames[frame].placement


class FigureSystem(ActiveSystem):
    """A problem's equations, renewed from posture to posture: every iterate is a posture."""

    objective: FigureObjective

    def __init__(self, problem: Problem, workspace: Workspace, algebra: str, *, yielding: bool = False) -> None:
        """Build the equations; with `yielding`, the violation of the constraints replaces the goals."""
        self.problem, self.workspace, self._yielding = problem, workspace, yielding
        self.bodies = bodies = FigureBodies(problem.scene.figure, problem.start)
        held = [Unit(bodies.names), bodies.limits, *bodies.equations.batches()]
        held += bound_equations(problem, bodies, workspace.state).batches()
        if not yielding:
            held += constraint_equations(problem, bodies).batches()
        objective = FigureObjective(problem, bodies, workspace.state)
        super().__init__(held, bodies.weight, algebra, [bodies], objective)
        self._find_contacts(problem.clearances, workspace, bodies.data)
        self._own = tuple(filter(is_own, problem.measures))
        self.own_terms = any(map(is_own, (*problem.goals, *problem.constraints, *problem.measures)))
        self.retarget()
        self.arrive(self.variables(problem.start))

    def variables(self, q: Array) -> Array:
        """Move to the posture q (nq,); returns its variables."""
        self.q = self.bodies.q = q
        self._here = self.bodies.variables(q)
        if self.contacts is not None:
            self.contacts.measure(self.bodies.data)
        return self._here

    def posture(self, x: Array) -> Array:
        """The posture (nq,) of the bodies x (7 n,)."""
        return self.q if x is self._here else self.bodies.posture(x)

    def defined(self, q: Array) -> bool:
        """Whether all terms of one's own are finite at a posture (nq,)."""
        problem, state = self.problem, self.workspace.state.update(q)
        return undefined((*problem.goals, *problem.constraints, *problem.measures), state) is None

    def retarget(self) -> None:
        """Update to the problem's new goals."""
        problem = self.problem
        if any(map(is_own, problem.goals)):
            self.bodies.state_of(problem.start)  # where they are asked for their rows: a step may have been taken back
        if self._yielding:
            asked = constraint_equations(problem, self.bodies).batches()
            for batch in asked:
                batch.role = batch.role if batch.role.one_sided else Role(weight=1.0)
        else:
            asked = goal_equations(problem, self.bodies, problem.goals).batches()
        self.aim(asked)

    def arrive(self, x: Array) -> bool:
        """Renew limits, measures and contacts at x; returns whether the pattern changed."""
        x = self.retract(x)
        if self._own and (error := undefined(self._own, self.workspace.state.update(self.q))) is not None:
            raise error  # measures are read where a step ends, not within it
        return super().arrive(x)

    def _projected(self, x: Array) -> Array:
        x = x.copy()
        self.bodies.retract(x)
        self.q = self.bodies.q
        return x
