"""A problem's terms as placo's tasks and constraints; terms without a class in placo are refused by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.base import UnsupportedTermError, named_terms
from wholebody.methods.placo.robot import Robot, unsupported_joints
from wholebody.problem import Problem
from wholebody.tasks.base import Goal
from wholebody.tasks.frame import PlacementResidual
from wholebody.tasks.inputs import Place

Frames = dict[str, tuple[int, pin.SE3]]

REASONS = {
    "Axis": "placo aligns an axis with a direction, not with a place",
    "CenterOfMass": "placo's is of all figures together",
    "Plane": "placo has no half-spaces for frames",
    "ReachCones": "placo's cones are circular",
    "Soft": "goals would give way to it, as placo weighs them against each other",
}
"""Reasons of refusals that the name of the term's class does not explain."""


@dataclass
class Tasks:
    """The tasks that change while the solver runs."""

    robot: Robot
    # the tasks of the measures, with the share of the weight of each
    measures: list[tuple[Any, float]] = field(default_factory=list)
    # tasks of holds, with how many weights each has, and their names
    holds: list[tuple[Any, int, str]] = field(default_factory=list)
    # half-spaces of joints, with the balance of one figure among several that they stand for to first order
    balances: list[tuple[Any, tasks.Balance]] = field(default_factory=list)

    def move(self, state: State, weight: float) -> None:
        """Take the robot to a posture, and set the weight of the measures against the goals."""
        self.robot.move(state.q)
        for number, (task, share) in enumerate(self.measures):
            task.configure(f"measure {number}", "soft", weight * share)
        for half_spaces, term in self.balances:
            rows, room = self.robot.half_spaces(
                state.dense_jacobian(term.jacobian(state)), np.asarray(term.value(state)) - term.lower
            )
            half_spaces.A, half_spaces.b = rows, room

    def hold(self, weight: float) -> None:
        """Make holds soft with a weight, or hard with 0."""
        for task, weights, name in self.holds:
            task.configure(name, "soft" if weight else "hard", *[weight or 1.0] * weights)


def check_terms(problem: Problem) -> None:
    """Raise an `UnsupportedTermError` that lists terms and joints without a class in placo, each with the reason."""
    refused = list[str]()
    for where, term in named_terms(problem):
        if not _takes(problem, term):
            kind = type(term).__name__
            refused.append(where + (f" ({REASONS[kind]})" if kind in REASONS else ""))
    refused += unsupported_joints(problem.scene.figure)
    if refused:
        raise UnsupportedTermError("placo", refused)


def _takes(problem: Problem, term: object) -> bool:
    if isinstance(term, tasks.CenterOfMass):
        return _of_all(problem, term)
    if isinstance(term, tasks.Axis):
        return term.toward is None
    if isinstance(term, tasks.Plane):
        return term.side == "on"
    kinds = (
        tasks.Point, tasks.Frame, tasks.Orientation, tasks.Posture, tasks.Relative, tasks.Hold, tasks.Balance,
        tasks.Freeze, tasks.StepLimit, tasks.Effort, tasks.Displacement,
    )  # fmt: skip
    return isinstance(term, kinds)


def _of_all(problem: Problem, term: tasks.Balance | tasks.CenterOfMass) -> bool:
    """Whether a term is of the centre of mass of all that moves, not of one figure among several."""
    joints, inertias = term.joints, problem.scene.model.inertias
    return joints is None or not any(inertias[k].mass > 0.0 for k in range(1, len(inertias)) if k not in joints)


def named_frames(problem: Problem) -> Frames:
    """The frames that the tasks name: joint and placement in it."""
    found: Frames = {}
    for term in (*problem.goals, *problem.constraints):
        if isinstance(term, tasks.Point):
            _add(found, problem, term.place, term.resolved_offset)
        elif isinstance(term, (tasks.Axis, tasks.Plane)):
            _add(found, problem, term.place)
        elif isinstance(term, (tasks.Frame, tasks.Orientation, tasks.Relative, tasks.Hold)):
            _add(found, problem, term.residual.place)
            _add(found, problem, term.residual.base)
    return found


def _add(frames: Frames, problem: Problem, place: Place, offset: Array | None = None) -> None:
    frame = problem.scene.model.frames[place.frame]
    there = frame.placement if offset is None else frame.placement * pin.SE3(np.eye(3), offset)
    frames[_name(place, offset)] = (place.joint, there)


def _name(place: Place, offset: Array | None = None) -> str:
    if offset is None or not offset.any():
        return f"f{place.frame:05d}"
    return f"f{place.frame:05d} at {' '.join(repr(value) for value in offset.tolist())}"


def add_terms(solver: Any, robot: Robot, problem: Problem) -> Tasks:
    """Add goals to placo's solver as soft tasks, constraints as hard ones, and measures."""
    own = Tasks(robot)
    for number, goal in enumerate(problem.goals):
        _goal(solver, robot, problem, f"goal {number}", goal)
    for number, term in enumerate(problem.constraints):
        if isinstance(term, tasks.Balance) and not _of_all(problem, term):
            none = np.zeros((0, robot.wrapper.model.nq))
            own.balances.append((solver.add_joint_space_half_spaces_constraint(none, np.zeros(0)), term))
            own.balances[-1][0].configure(f"constraint {number}", "hard", 1.0)
        elif isinstance(term, (tasks.Hold, tasks.Orientation)):
            own.holds.append((*_placement(solver, term.residual), f"constraint {number}"))
        elif isinstance(term, Goal):
            _goal(solver, robot, problem, f"constraint {number}", term, "hard")
        else:
            _constraint(solver, f"constraint {number}", term)
    for bound in problem.bounds:
        if isinstance(bound, tasks.Freeze):  # a solve has no time step, so a step limit bounds nothing
            _freeze(solver, robot, problem, bound)
    if not robot.floating:
        solver.mask_fbase(True)
    for measure in problem.measures:
        if isinstance(measure, (tasks.Effort, tasks.Displacement)):
            _measure(solver, robot, problem, measure, own)
    return own


def _goal(solver: Any, robot: Robot, problem: Problem, name: str, goal: Any, priority: str = "soft") -> None:
    if isinstance(goal, tasks.Posture):
        _posture(solver, robot, problem, name, goal)
        return
    if isinstance(goal, (tasks.Frame, tasks.Orientation, tasks.Relative)):
        task, weights = _placement(solver, goal.residual)
        task.configure(name, priority, *[goal.weight] * weights)
        return
    if isinstance(goal, tasks.Point):
        task = solver.add_position_task(_name(goal.place, goal.resolved_offset), np.array(goal.resolved_target))
    elif isinstance(goal, tasks.Axis):
        task = solver.add_axisalign_task(_name(goal.place), np.array(goal.basis[2]), np.array(goal.resolved_target))
    else:
        task = solver.add_com_task(np.array((*goal.resolved_target, 0.0)[:3]))
        task.mask.set_axises(goal.axes, "task")
    task.configure(name, priority, goal.weight)


def _posture(solver: Any, robot: Robot, problem: Problem, name: str, goal: tasks.Posture) -> None:
    figure, dofs = problem.scene.figure, set(np.asarray(goal.dofs).tolist())
    joints = _joint_values(robot, problem, goal.resolved_target)
    values = {name: value for dof, name, value in joints if dof in dofs}
    if values:
        task = solver.add_joints_task()
        task.set_joints(values)
        task.configure(name, "soft", goal.weight)
    for root, joint in figure.roots.items():
        moved = figure.model.joints[joint]
        if moved.idx_v in dofs:
            target = pin.XYZQUATToSE3(goal.resolved_target[moved.idx_q : moved.idx_q + 7])
            task = solver.add_frame_task(robot.link(joint), (figure.model.jointPlacements[joint] * target).homogeneous)
            task.configure(f"{name}, {root}", "soft", goal.weight, goal.weight)


def _constraint(solver: Any, name: str, term: Any) -> None:
    if isinstance(term, tasks.Plane):
        task = solver.add_position_task(_name(term.place), term.height * np.array(term.resolved_normal))
        across = np.linalg.svd(term.resolved_normal[None])[2]  # rows: the normal, and two directions in the plane
        task.mask.R_custom_world = np.array([across[1], across[2], term.resolved_normal])
        task.mask.set_axises("z", "custom")
        task.configure(name, "hard", 1.0)
    elif isinstance(term, tasks.Balance):
        corners = _corners(term.normals, term.offsets)
        constraint = solver.add_com_polygon_constraint(list(corners[::-1]), term.margin)
        constraint.configure(name, "hard", 1.0)


def _placement(solver: Any, residual: PlacementResidual) -> tuple[Any, int]:
    """A task for the residual of one frame in another, or in the world, and how many weights it has."""
    target, names, weights = residual.placement, [_name(residual.place)], 1
    if residual.base.frame:
        names.insert(0, _name(residual.base))
    if residual.position and residual.orientation:
        kind, wanted, weights = "frame", target.homogeneous, 2
    elif residual.position:
        kind, wanted = "position", target.translation
    else:
        kind, wanted = "orientation", target.rotation
    relative = "relative_" if residual.base.frame else ""
    return getattr(solver, f"add_{relative}{kind}_task")(*names, wanted), weights


def _freeze(solver: Any, robot: Robot, problem: Problem, bound: tasks.Freeze) -> None:
    figure = problem.scene.figure
    for name in figure.joint_names(bound.joints):
        joint = figure.joint_id(name)
        if robot.floating and joint == 1:
            solver.mask_fbase(True)
        else:
            for one in robot.joint_names(joint):
                solver.mask_dof(one)


def _measure(
    solver: Any, robot: Robot, problem: Problem, measure: tasks.Effort | tasks.Displacement, own: Tasks
) -> None:
    """Weighted squared distance from a posture: a joints task for every distinct weight."""
    weights = measure.distance.weights
    groups: dict[float, dict[str, float]] = {}
    for dof, name, value in _joint_values(robot, problem, measure.distance.reference):
        groups.setdefault(float(weights[dof]), {})[name] = value
    for weight in sorted(groups):
        if weight > 0.0:
            task = solver.add_joints_task()
            task.set_joints(groups[weight])
            own.measures.append((task, measure.weight * weight / float(weights.max())))


def _joint_values(robot: Robot, problem: Problem, q: Array) -> list[tuple[int, str, float]]:
    """Degree of freedom, name in placo, and value in the posture q (nq,), of each joint with one."""
    figure = problem.scene.figure
    ids = [(figure.joint_id(name), value) for name, value in figure.joint_values(q).items()]
    return [(figure.model.joints[joint].idx_v, robot.joint_name(joint), value) for joint, value in ids]


def _corners(normals: Array, offsets: Array) -> Array:
    """Corners (k, 2) of a convex polygon, anticlockwise, from its edges."""
    before = np.roll(normals, 1, axis=0), np.roll(offsets, 1)
    return np.array(
        [
            np.linalg.solve(np.array([n0, n1]), np.array([o0, o1]))
            for n0, n1, o0, o1 in zip(before[0], normals, before[1], offsets, strict=True)
        ]
    )
