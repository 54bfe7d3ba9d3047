"""The terms of a problem that cyclic coordinate descent can take; all others are refused by name before it starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wholebody.figures.description import followers_of
from wholebody.figures.figure import Figure
from wholebody.figures.state import State, joint_support
from wholebody.geometry.placement import placement
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.ccd.limbs import movable
from wholebody.problem import Problem
from wholebody.tasks.bounds import Freeze, StepLimit
from wholebody.tasks.frame import Frame, Orientation
from wholebody.tasks.hold import Hold
from wholebody.tasks.inputs import target_rotation
from wholebody.tasks.point import Point
from wholebody.tasks.range_of_motion import RangeOfMotion
from wholebody.tasks.reach_cones import ReachCones

HELD = 1e-6  # m, rad: a hold that is met to this at the start is kept by joints that do not move


@dataclass(frozen=True)
class GoalPlace:
    """A frame, or a point of it, and its target.

    Attributes:
        frame: index in the model.
        offset: the point in the frame, metres.
        place: target position in the world; None if only the orientation counts.
        rotation: (3, 3) target rotation in the world; None if only the position counts.
        weight: factor on the squared error.
    """

    frame: int
    offset: tuple[float, float, float]
    place: tuple[float, float, float] | None
    rotation: Any
    weight: float


@dataclass(frozen=True)
class Request:
    """A problem in the form that cyclic coordinate descent takes.

    Attributes:
        goals: the goals.
        joints: Pinocchio's indices of the joints that move for the goals.
        fixed: joints that must not move, not even to resolve overlap.
        cones: names of the reach cones to keep.
        ranges: names of the ranges of motion to keep.
    """

    goals: tuple[GoalPlace, ...]
    joints: tuple[int, ...]
    fixed: frozenset[int]
    cones: tuple[str, ...]
    ranges: tuple[str, ...]


def read(problem: Problem, state: State | None = None) -> Request:
    """Convert a problem; `state`, if given, is moved to the problem's start.

    Raises:
        UnsupportedTermError: it has terms that this method cannot take; all of them are listed.
    """
    figure = problem.scene.figure
    refused: list[str] = []
    fixed = {joint for bound in problem.bounds if isinstance(bound, Freeze) for joint in _frozen(figure, bound)}
    goals, joints = [], set[int]()
    for number, goal in enumerate(problem.goals):
        where = f"goals[{number}], {type(goal).__name__}"
        if not isinstance(goal, (Point, Frame, Orientation)):
            refused.append(where)
            continue
        path = [joint for joint in reaching(figure, goal.frame) if joint not in fixed]
        if not path:
            refused.append(f"{where}({goal.frame!r}), which no joint moves that may turn (the root stays)")
        goals.append(_goal_place(figure, goal))
        joints.update(path)
    cones: dict[str, None] = {}
    ranges: dict[str, None] = {}
    moving = _dofs(figure, joints)
    state = (State(problem.scene.model) if state is None else state).update(problem.start)
    support = joint_support(problem.scene.model)
    left_out = {id(term) for term in problem.defaults if not isinstance(term, (ReachCones, RangeOfMotion))}
    for number, term in enumerate(problem.constraints):
        if id(term) in left_out:
            continue
        where = f"constraints[{number}], {type(term).__name__}"
        if isinstance(term, ReachCones):
            cones.update(dict.fromkeys(figure.cones if term.names is None else term.names))
        elif isinstance(term, RangeOfMotion):
            ranges.update(dict.fromkeys(term.row_names))
        elif isinstance(term, Hold):
            carried = support[_joint(figure, term.frame)]
            if term.relative_to is not None:
                carried = carried - support[_joint(figure, term.relative_to)]
            if carried[moving].any():
                refused.append(f"{where}({term.frame!r}), which the joints that reach move too")
            elif np.abs(term.value(state)).max() > HELD:
                refused.append(f"{where}({term.frame!r}), which is elsewhere at the start")
            held = {int(joint) for joint in range(1, problem.scene.model.njoints) if _moves(figure, joint, carried)}
            fixed |= held
        else:
            refused.append(where)
    for number, bound in enumerate(problem.bounds):
        if not isinstance(bound, (Freeze, StepLimit)):
            refused.append(f"bounds[{number}], {type(bound).__name__}")
    if problem.measures_given:
        refused += [f"measures[{number}], {type(term).__name__}" for number, term in enumerate(problem.measures)]
    refused += [f"joint {name!r}, which follows another one (mimic)" for name in list(followers_of(figure.model))[:1]]
    if refused:
        raise UnsupportedTermError("ccd", refused)
    return Request(tuple(goals), tuple(sorted(joints)), frozenset(fixed), tuple(cones), tuple(ranges))


def reaching(figure: Figure, frame: str) -> tuple[int, ...]:
    """The joints that move a frame to its goal.

    These are the joints of the chain that carries it, from the chain's beginning to the frame; without a chain, all
    joints between the frame and the root.
    """
    carrier = _joint(figure, frame)
    for chain in figure.chains.values():
        joints = [figure.joint_id(name) for name in chain.joints]
        if carrier in joints:
            return tuple(joint for joint in joints[: joints.index(carrier) + 1] if movable(figure.model, joint))
    path = [int(joint) for joint in figure.model.supports[carrier]]
    return tuple(joint for joint in path if joint > 0 and movable(figure.model, joint))


def _joint(figure: Figure, frame: str) -> int:
    return int(figure.model.frames[figure.frame_id(frame)].parentJoint)


def _moves(figure: Figure, joint: int, carried: Any) -> bool:
    made = figure.model.joints[joint]
    return bool(carried[made.idx_v : made.idx_v + made.nv].any())


def _dofs(figure: Figure, joints: set[int]) -> list[int]:
    return [figure.model.joints[joint].idx_v for joint in sorted(joints)]


def _frozen(figure: Figure, bound: Freeze) -> list[int]:
    return [figure.joint_id(name) for name in figure.joint_names(bound.joints)]


def _goal_place(figure: Figure, goal: Point | Frame | Orientation) -> GoalPlace:
    frame = figure.frame_id(goal.frame)
    if isinstance(goal, Point):
        offset, place = np.asarray(goal.offset, dtype=float), np.asarray(goal.target, dtype=float)
        return GoalPlace(frame, tuple(offset.tolist()), tuple(place.tolist()), None, goal.weight)
    if isinstance(goal, Frame):
        target = placement(goal.target)
        return GoalPlace(frame, (0.0, 0.0, 0.0), tuple(target.translation.tolist()), target.rotation, goal.weight)
    return GoalPlace(frame, (0.0, 0.0, 0.0), None, target_rotation(goal.target, "target").rotation, goal.weight)
