"""Goals and constraints of a problem as equations of bodies; terms of users' classes by their rows in the tangent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.newton.batches import HARD, ONE_SIDED, Batch, Role
from wholebody.methods.newton.equations import EquationSet, axes_along
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.own_rows import constraint_rows, goal_rows
from wholebody.methods.newton.task_batches import Cone, MassCenter, Toward
from wholebody.problem import Problem
from wholebody.tasks import (
    Axis,
    Balance,
    CenterOfMass,
    Frame,
    Freeze,
    Hold,
    Orientation,
    Plane,
    Point,
    Posture,
    ReachCones,
    Relative,
    StepLimit,
)  # fmt: skip
from wholebody.tasks.base import Goal
from wholebody.tasks.residuals import PlacementResidual


def state_equations(problem: Problem, state: State) -> None:
    """Build all equations of a problem once, to find unsupported terms.

    Args:
        problem: to be solved.
        state: it is moved to the problem's start.

    Raises:
        UnsupportedTermError: a term or a joint has no equations here.
    """
    bodies = FigureBodies(problem.scene.figure, problem.start)
    goal_equations(problem, bodies, problem.goals)
    constraint_equations(problem, bodies)
    bound_equations(problem, bodies, state)


def goal_equations(problem: Problem, bodies: FigureBodies, goals: Sequence[Goal]) -> EquationSet:
    """Equations of goals.

    Raises:
        UnsupportedTermError: a goal has no equations here.
    """
    result = EquationSet()
    for number, goal in enumerate(goals):
        label, role = f"goals[{number}], {type(goal).__name__}", Role(goal.weight)
        if isinstance(goal, Point):
            point = _local(bodies, goal.place.frame).act(goal.resolved_offset)
            result.coincide(bodies.index(goal.place.joint), -1, label, point, goal.resolved_target, role)
        elif isinstance(goal, (Frame, Orientation, Relative)):
            _placement(result, bodies, goal.residual, label, role)
        elif isinstance(goal, Axis):
            _axis(result, bodies, goal, label)
        elif isinstance(goal, CenterOfMass):
            result.add(_mass_center(bodies, label, np.eye(3)[: len(goal.axes)], goal.resolved_target), role)
        elif isinstance(goal, Posture):
            bodies.add_posture_goals(result, label, goal.resolved_target, set(goal.dofs.tolist()), role)
        else:
            _check_own(bodies, label)
            result.add(goal_rows(bodies, goal, label), role)
    return result


def constraint_equations(problem: Problem, bodies: FigureBodies) -> EquationSet:
    """Equations of constraints.

    Raises:
        UnsupportedTermError: one has no equations here.
    """
    result = EquationSet()
    for number, term in enumerate(problem.constraints):
        label = f"constraints[{number}], {type(term).__name__}"
        if isinstance(term, Hold):
            _placement(result, bodies, term.residual, label)
        elif isinstance(term, Plane):
            place, body = np.array(_local(bodies, term.place.frame).translation), bodies.index(term.place.joint)
            role = ONE_SIDED if term.side == "above" else HARD
            result.slide(-1, body, label, term.resolved_normal, place, term.height, role)
        elif isinstance(term, Balance):
            normals = np.column_stack([term.normals, np.zeros(len(term.normals))])
            result.add(_mass_center(bodies, label, normals, term.offsets + term.margin), ONE_SIDED)
        elif isinstance(term, ReachCones):
            result.add(_cones(bodies, term, label), ONE_SIDED)
        else:
            _check_own(bodies, label)
            for rows, role in zip(constraint_rows(bodies, term, label), (HARD, ONE_SIDED), strict=True):
                if rows is not None:
                    result.add(rows, role)
    return result


def bound_equations(problem: Problem, bodies: FigureBodies, state: State) -> EquationSet:
    """Equations of bounds.

    Args:
        problem: gives the bounds.
        bodies: of its figure.
        state: of the run; it is moved to the problem's start.

    Raises:
        UnsupportedTermError: one has no equations here.
    """
    result = EquationSet()
    for number, bound in enumerate(problem.bounds):
        if isinstance(bound, Freeze):
            _frozen(result, bodies, bound, state.update(problem.start))
        elif not isinstance(bound, StepLimit):  # a solve has no time step, so a step limit bounds nothing
            raise UnsupportedTermError(
                "newton", [f"bounds[{number}], {type(bound).__name__} (it takes Freeze and StepLimit)"]
            )
    return result


def _axis(equations: EquationSet, bodies: FigureBodies, goal: Axis, label: str) -> None:
    """An axis along a direction, or towards a point."""
    local, body, role = _local(bodies, goal.place.frame), bodies.index(goal.place.joint), Role(goal.weight)
    if goal.toward is None:
        ours, wanted = axes_along(local.rotation @ goal.basis[2]), axes_along(goal.resolved_target)
        equations.turn(body, -1, label, ours, wanted, 2, role)
        return
    axes, point = goal.basis @ local.rotation.T, np.array(local.translation)
    places = goal.resolved_target[None]
    equations.add(Toward(np.array([[body]]), [label], axes[None], point[None], places), role)


def _mass_center(bodies: FigureBodies, label: str, directions: Array, height: Array) -> Batch:
    inertias = list(bodies.model.inertias)[1:]
    mass = np.array([inertia.mass for inertia in inertias])
    heavy = np.flatnonzero(mass > 0.0)
    centers = np.array([inertias[k].lever for k in heavy])
    return MassCenter(bodies.first + heavy[None], [label], mass[heavy] / mass.sum(), centers, directions, height)


def _cones(bodies: FigureBodies, term: ReachCones, label: str) -> Batch:
    limbs = term.limbs
    pairs = np.array([(bodies.index(limb.reference.joint), bodies.index(limb.limb.joint)) for limb in limbs])
    turns = np.array([_local(bodies, limb.reference.frame).rotation for limb in limbs])
    axes = np.array([_local(bodies, limb.limb.frame).rotation @ limb.axis for limb in limbs])
    return Cone(pairs, [label] * len(limbs), [limb.cone for limb in limbs], turns, axes)


def _placement(
    equations: EquationSet, bodies: FigureBodies, residual: PlacementResidual, label: str, role: Role = HARD
) -> None:
    """The residual of one frame in another: a point that coincides, and axes that agree."""
    base, local = _local(bodies, residual.base.frame), _local(bodies, residual.place.frame)
    a, b = bodies.index(residual.base.joint), bodies.index(residual.place.joint)
    if residual.position:
        equations.coincide(a, b, label, base.act(residual.target), np.array(local.translation), role)
    if residual.orientation:
        wanted = pin.Quaternion(base.rotation @ residual.undo.rotation.T)
        equations.turn(a, b, label, wanted, pin.Quaternion(local.rotation), 3, role)


def _frozen(equations: EquationSet, bodies: FigureBodies, bound: Freeze, state: State) -> None:
    """Joints that keep their placement relative to their parent at a state."""
    figure, model = bodies.figure, bodies.model
    for name in figure.joint_names(bound.joints):
        joint = figure.joint_id(name)
        parent = int(model.parents[joint])
        here = state.data.oMi[parent].actInv(state.data.oMi[joint])
        a, b, label = bodies.index(parent), bodies.index(joint), f"Freeze, {name!r}"
        if model.joints[joint].nv > 1 or not model.joints[joint].shortname().startswith("JointModelR"):
            equations.coincide(a, b, label, np.array(here.translation), np.zeros(3))
        # of a revolute joint, whose own equations leave only this rotation, two of the three rows are redundant
        equations.turn(a, b, label, pin.Quaternion(here.rotation), pin.Quaternion.Identity(), 3)


def _local(bodies: FigureBodies, frame: int) -> Any:
    """Placement of a frame in its body."""
    return bodies.model.frames[frame].placement


def _check_own(bodies: FigureBodies, label: str) -> None:
    """Refuse a term of a user's class if the figure's tangent is not a function of its bodies here.

    Raises:
        UnsupportedTermError: the figure has joints other than revolute ones and one free root.
    """
    if bodies.uncharted:
        reason = f"its rows need turning joints and one free root, and {bodies.uncharted[0]!r} is neither"
        raise UnsupportedTermError("newton", [f"{label} ({reason})"])
