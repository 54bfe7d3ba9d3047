"""Goals and constraints of a problem as equations of bodies; terms of users' classes by their rows in the tangent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.newton.batches import Batch, MassCenter
from wholebody.methods.newton.directions import Cone, Toward
from wholebody.methods.newton.equations import EquationSet
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.quaternions import axes_with_z
from wholebody.methods.newton.tangent_rows import constraint_rows, goal_rows
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
        problem: the problem.
        state: it is moved to the problem's start.

    Raises:
        UnsupportedTermError: a term or a joint has no equations here.
    """
    bodies = FigureBodies(problem.scene.figure, problem.start)
    goal_equations(problem, bodies, problem.goals)
    constraint_equations(problem, bodies)
    bound_equations(problem, state)


def goal_equations(problem: Problem, bodies: FigureBodies, goals: Sequence[Goal]) -> EquationSet:
    """Equations of goals.

    Raises:
        UnsupportedTermError: a goal has no equations here.
    """
    result = EquationSet()
    for number, goal in enumerate(goals):
        label = f"goals[{number}], {type(goal).__name__}"
        if isinstance(goal, Point):
            place = goal.place
            point = _local(problem, place.frame).act(goal.resolved_offset)
            result.coincide(place.joint - 1, -1, label, point, goal.resolved_target, goal=True, weight=goal.weight)
        elif isinstance(goal, (Frame, Orientation, Relative)):
            _placement(result, problem, goal.residual, label, goal=True, weight=goal.weight)
        elif isinstance(goal, Axis):
            _axis(result, problem, goal, label)
        elif isinstance(goal, CenterOfMass):
            directions = np.eye(3)[: len(goal.axes)]
            make = partial(_mass_center, bodies, label, directions, goal.resolved_target)
            result.add(make, "mass center", goal=True, weight=goal.weight)
        elif isinstance(goal, Posture):
            bodies.add_posture_goals(result, label, goal.resolved_target, set(goal.dofs.tolist()), goal.weight)
        else:
            _check_own(bodies, label)
            result.add(_as_made(goal_rows(bodies, goal, label)), "own", goal=True, weight=goal.weight)
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
            _placement(result, problem, term.residual, label)
        elif isinstance(term, Plane):
            place = np.array(_local(problem, term.place.frame).translation)
            above = term.side == "above"
            result.slide(-1, term.place.joint - 1, label, term.resolved_normal, place, term.height, above=above)
        elif isinstance(term, Balance):
            normals = np.column_stack([term.normals, np.zeros(len(term.normals))])
            make = partial(_mass_center, bodies, label, normals, term.offsets + term.margin)
            result.add(make, "mass center", one_sided=True)
        elif isinstance(term, ReachCones):
            result.add(partial(_cones, problem, term, label), "cone", one_sided=True)
        else:
            _check_own(bodies, label)
            for rows, one_sided in zip(constraint_rows(bodies, term, label), (False, True), strict=True):
                if rows is not None:
                    result.add(_as_made(rows), "own", one_sided=one_sided)
    return result


def bound_equations(problem: Problem, state: State) -> EquationSet:
    """Equations of bounds.

    Args:
        problem: gives the bounds.
        state: of the run; it is moved to the problem's start.

    Raises:
        UnsupportedTermError: one has no equations here.
    """
    result = EquationSet()
    for number, bound in enumerate(problem.bounds):
        if isinstance(bound, Freeze):
            _frozen(result, problem, bound, state)
        elif not isinstance(bound, StepLimit):  # a solve has no time step, so a step limit bounds nothing
            raise UnsupportedTermError(
                "newton", [f"bounds[{number}], {type(bound).__name__} (it takes Freeze and StepLimit)"]
            )
    return result


def _axis(equations: EquationSet, problem: Problem, goal: Axis, label: str) -> None:
    """An axis along a direction, or towards a point."""
    local, joint = _local(problem, goal.place.frame), goal.place.joint
    if goal.toward is None:
        ours = pin.Quaternion(axes_with_z((local.rotation @ goal.basis[2])[None])[0])
        wanted = pin.Quaternion(axes_with_z(goal.resolved_target[None])[0])
        equations.turn(joint - 1, -1, label, ours, wanted, 2, goal=True, weight=goal.weight)
        return
    axes, point, place = goal.basis @ local.rotation.T, np.array(local.translation), goal.resolved_target

    def make(world: int) -> Batch:
        body = np.array([[joint - 1 if joint else world]])
        return Toward(body, [label], axes[None], point[None], place[None])

    equations.add(make, "toward", goal=True, weight=goal.weight)


def _mass_center(bodies: FigureBodies, label: str, directions: Array, height: Array, world: int) -> Batch:
    inertias = list(bodies.model.inertias)[1:]
    mass = np.array([inertia.mass for inertia in inertias])
    heavy = np.flatnonzero(mass > 0.0)
    centers = np.array([inertias[k].lever for k in heavy])
    return MassCenter(heavy[None], [label], mass[heavy] / mass.sum(), centers, directions, height)


def _cones(problem: Problem, term: ReachCones, label: str, world: int) -> Batch:
    limbs = term.limbs
    pairs = np.array([(limb.reference.joint - 1, limb.limb.joint - 1) for limb in limbs], dtype=np.intp)
    pairs[pairs < 0] = world
    turns = np.array([_local(problem, limb.reference.frame).rotation for limb in limbs])
    axes = np.array([_local(problem, limb.limb.frame).rotation @ limb.axis for limb in limbs])
    return Cone(pairs, [label] * len(limbs), [limb.cone for limb in limbs], turns, axes)


def _placement(
    equations: EquationSet,
    problem: Problem,
    residual: PlacementResidual,
    label: str,
    *,
    goal: bool = False,
    weight: float = 1.0,
) -> None:
    """The residual of one frame in another: a point that coincides, and axes that agree."""
    base, local = _local(problem, residual.base.frame), _local(problem, residual.place.frame)
    a, b = residual.base.joint - 1, residual.place.joint - 1
    if residual.position:
        point = base.act(residual.target)
        equations.coincide(a, b, label, point, np.array(local.translation), goal=goal, weight=weight)
    if residual.orientation:
        wanted = pin.Quaternion(base.rotation @ residual.undo.rotation.T)
        equations.turn(a, b, label, wanted, pin.Quaternion(local.rotation), 3, goal=goal, weight=weight)


def _frozen(equations: EquationSet, problem: Problem, bound: Freeze, state: State) -> None:
    """Joints that keep their placement relative to their parent."""
    figure, model = problem.scene.figure, problem.scene.model
    state.update(problem.start)
    for name in figure.joint_names(bound.joints):
        joint = figure.joint_id(name)
        parent = int(model.parents[joint])
        here = state.data.oMi[parent].actInv(state.data.oMi[joint])
        label = f"Freeze, {name!r}"
        if model.joints[joint].nv == 1 and model.joints[joint].shortname().startswith("JointModelR"):
            # the joint's own equations leave only this rotation: one of the three rows, the others are redundant
            equations.turn(parent - 1, joint - 1, label, pin.Quaternion(here.rotation), pin.Quaternion.Identity(), 3)
        else:
            equations.coincide(parent - 1, joint - 1, label, np.array(here.translation), np.zeros(3))
            equations.turn(parent - 1, joint - 1, label, pin.Quaternion(here.rotation), pin.Quaternion.Identity(), 3)


def _local(problem: Problem, frame: int) -> Any:
    """Placement of a frame in its body."""
    return problem.scene.model.frames[frame].placement


def _as_made(batch: Batch) -> Callable[[int], Batch]:
    return lambda world: batch


def _check_own(bodies: FigureBodies, label: str) -> None:
    """Refuse a term of a user's class if the figure's tangent is not a function of its bodies here.

    Raises:
        UnsupportedTermError: the figure has joints other than revolute ones and one free root.
    """
    if bodies.uncharted:
        reason = f"its rows need turning joints and one free root, and {bodies.uncharted[0]!r} is neither"
        raise UnsupportedTermError("newton", [f"{label} ({reason})"])
