"""The assessment of answers to many problems of one scene that are alike but for numbers: `assess`, in arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.assessment.all_pairs import all_pairs
from wholebody.base.arrays import Array, Indices
from wholebody.problem import Problem
from wholebody.tasks.inputs import WORLD, Place
from wholebody.tasks.point import Point

TOGETHER = 50_000  # bounds of pairs that are looked at together: more take more memory than the processor keeps near
_UNTURNED, _UNMOVED = np.eye(3), np.zeros(3)


class Numbers(NamedTuple):
    """What k problems with g goals each ask: places and rotations of frames, a squared distance, and clearances."""

    offsets: Array  # (k, g, 3) of what is placed, in its frame
    targets: Array  # (k, g, 3) where
    undo: Array  # (k, g, 3, 3) inverses of the rotations that are asked for
    references: Array  # (k, nq) posture of which the measure is the squared distance
    clearances: Array  # (k, pairs) metres

    @classmethod
    def of(cls, problems: Sequence[Problem]) -> Numbers:
        """What these ask, whose goals are `Point`, `Frame`, `Orientation` or `Relative`."""
        goals = [[_numbers(goal) for goal in problem.goals] for problem in problems]
        offsets, targets, undo = (np.array([[goal[part] for goal in each] for each in goals]) for part in range(3))
        references = np.array([_distance(problem).reference for problem in problems])
        return cls(offsets, targets, undo, references, np.array([problem.clearances for problem in problems]))

    def of_some(self, rows: Indices) -> Numbers:
        """What some of them (m,) ask."""
        return Numbers(*(part[rows] for part in self))


class Judged(NamedTuple):
    """Arrays (k,) with a number a posture; see `Assessment`."""

    goal_error: Array
    goal_angle: Array
    penetration: Array
    clearance_violation: Array
    limit_violation: Array
    constraint_violation: Array
    measure: Array

    def meets(self, tolerance: float) -> Any:
        """Which (k,) meet their goals with everything held to a tolerance, metres and radians."""
        return np.maximum.reduce(self[:-1]) <= tolerance

    def put(self, rows: Indices, other: Judged) -> None:
        """Replace some rows (m,) by those of another judgement."""
        for part, new in zip(self, other, strict=True):
            part[rows] = new


def judged(problem: Problem, numbers: Numbers, q: Array) -> Judged:
    """Judge postures q (k, nq) of one problem without constraints and bounds, each with its own numbers."""
    model, built, figure = problem.scene.model, problem.scene.built, problem.scene.figure
    with all_pairs(built).borrow() as pairs:
        step = max(1, TOGETHER // max(1, len(built.table.pairs)))
        parts = [pairs.shortfalls(q[k : k + step], numbers.clearances[k : k + step]) for k in range(0, len(q), step)]
    joints, penetration, short = (np.concatenate(each) for each in zip(*parts, strict=True))
    far, turned = np.zeros((2, 1 + len(problem.goals), len(q)))
    for g, goal in enumerate(problem.goals):
        far[g], turned[g] = _errors(goal, joints, [part[:, g] for part in numbers[:3]])
    values = q[:, figure.limits.idx_q]
    beyond = np.maximum(figure.limits.lower - values, values - figure.limits.upper).max(axis=1, initial=0.0)
    if model.nq == model.nv:
        away = q - numbers.references
    else:
        away = np.array([pin.difference(model, *each) for each in zip(numbers.references, q, strict=True)])
    measure = problem.measures[0].weight * ((away * away) @ _distance(problem).weights)
    return Judged(far.max(axis=0), turned.max(axis=0), penetration, short, beyond, np.zeros(len(q)), measure)


def _distance(problem: Problem) -> Any:
    measure: Any = problem.measures[0]
    return measure.distance


def _numbers(goal: Any) -> tuple[Array, Array, Array]:
    """Offset (3,), target (3,), and the inverse (3, 3) of the target's rotation of a goal."""
    if type(goal) is Point:
        return goal.resolved_offset, goal.resolved_target, _UNTURNED
    return _UNMOVED, goal.residual.placement.translation, goal.residual.placement.rotation.T


def _errors(goal: Any, joints: Array, asked: Sequence[Array]) -> tuple[Array, Array]:
    """Distances and angles (k,) of a goal from its targets, with the joints (k, njoints, 4, 3) there."""
    offset, target, undo = asked
    if type(goal) is Point:
        place, base, position, orientation = goal.place, WORLD, True, False
    else:
        place, _, base, position, orientation = goal.residual
    turn, at = _placed(place, joints)
    at = at + (turn @ offset[:, :, None])[:, :, 0]
    if base.frame:
        back, origin = _placed(base, joints)
        back = back.transpose(0, 2, 1)
        turn, at = back @ turn, (back @ (at - origin)[:, :, None])[:, :, 0]
    none = np.zeros(len(joints))
    far = np.linalg.norm(at - target, axis=1) if position else none
    if not orientation:
        return far, none
    left = turn @ undo
    sine = np.stack([left[:, (k + 2) % 3, (k + 1) % 3] - left[:, (k + 1) % 3, (k + 2) % 3] for k in range(3)])
    return far, np.arctan2(np.linalg.norm(sine, axis=0), np.trace(left, axis1=1, axis2=2) - 1.0)


def _placed(place: Place, joints: Array) -> tuple[Array, Array]:
    """Rotations (k, 3, 3) and origins (k, 3) of a frame in the world."""
    at, joint = place.placement, joints[:, place.joint]
    turn = joint[:, :3].transpose(0, 2, 1)
    return turn @ at.rotation, joint[:, 3] + turn @ at.translation
