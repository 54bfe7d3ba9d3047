"""The terms of a problem that cyclic coordinate descent can take; all others are refused by name before it starts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.methods.base import UnsupportedTermError
from wholebody.methods.ccd.guards import Kept
from wholebody.methods.ccd.limbs import Vector, movable, three
from wholebody.problem import Problem
from wholebody.tasks.bounds import Freeze, StepLimit
from wholebody.tasks.frame import Frame, Hold, Orientation, Relative
from wholebody.tasks.point import Point
from wholebody.tasks.range_of_motion import RangeOfMotion, ReachCones

Paths = dict[str, tuple[int, ...]]
"""Frame to the joints that `reaching` finds."""

BY_DEFAULT = ReachCones, RangeOfMotion
"""What it keeps of what people have by default."""


@dataclass(frozen=True)
class GoalPlace:
    """A frame, or a point of it, and its target in the world or in another frame."""

    frame: int  # index in the model
    offset: Vector  # the point in the frame, metres
    place: Vector | None  # target position; None if only the orientation counts
    rotation: Any  # (3, 3) target rotation; None if only the position counts
    weight: float  # factor on the squared error
    to: int = 0  # index of the frame that has the target; 0 is the world
    # of two frames that move towards each other, which half of a sweep moves this one
    half: int | None = None


@dataclass(frozen=True)
class Request:
    """A problem as cyclic coordinate descent takes it: goals, joints that move for them, and what is kept."""

    goals: tuple[GoalPlace, ...]
    joints: tuple[int, ...]
    kept: Kept
    loops: tuple[GoalPlace, ...] = ()  # those of the goals that must be met: what is held by frames that move


def read(problem: Problem, state: State | None = None, paths: Paths | None = None) -> Request:
    """Convert a problem; `state`, if given, is moved to its start. An UnsupportedTermError lists all such terms.

    `paths`, if given, has what earlier calls found for the same figure.
    """
    paths = {} if paths is None else paths
    reader = _Reader(problem, State(problem.scene.model) if state is None else state, paths)
    goals = reader.goals()
    loops = reader.loops()
    cones, ranges = reader.constraints()
    reader.others()
    if reader.refused:
        raise UnsupportedTermError("ccd", reader.refused)
    kept = Kept(frozenset(reader.fixed), cones, ranges)
    return Request((*goals, *loops), tuple(sorted(reader.joints)), kept, loops)


class _Reader:
    """Reads the terms of one problem: what is `refused`, in words, and the joints that move and that must not."""

    def __init__(self, problem: Problem, state: State, paths: Paths) -> None:
        self._problem, self._figure, self._state, self._paths = problem, problem.scene.figure, state, paths
        self.refused: list[str] = []
        self.joints: set[int] = set()
        self._closed: set[int] = set()  # identities of holds that are met as goals
        names = (bound.joints for bound in problem.bounds if isinstance(bound, Freeze))
        leaders = {law.joint for law in self._figure.followers.values()}  # one that others follow (mimic) stays
        frozen = (name for joints in names for name in self._figure.joint_names(joints))
        self.fixed = {self._figure.joint_id(name) for name in (*leaders, *frozen)}

    def goals(self) -> tuple[GoalPlace, ...]:
        """The goals; their joints are among `joints` then."""
        found = list[GoalPlace]()
        for number, goal in enumerate(self._problem.goals):
            where = f"goals[{number}], {type(goal).__name__}"
            if isinstance(goal, (Point, Frame, Orientation)):
                self._move(where, goal.frame, self._reaching(goal.frame))
                found.append(_goal_place(goal))
            elif isinstance(goal, Relative):
                found += self._relative(where, goal.frame, goal.to, goal)
            else:
                self.refused.append(where)
        return tuple(found)

    def _reaching(self, frame: str) -> tuple[int, ...]:
        """See `reaching`."""
        if frame not in self._paths:
            self._paths[frame] = reaching(self._figure, frame)
        return self._paths[frame]

    def _move(self, where: str, frame: str, joints: Iterable[int]) -> None:
        path = [joint for joint in joints if joint not in self.fixed]
        if not path:
            self.refused.append(
                f"{where}({frame!r}), which no joint moves that may turn (the root and joints that others follow stay)"
            )
        self.joints.update(path)

    def loops(self) -> tuple[GoalPlace, ...]:
        """What is held relative to frames that move, as goals of both frames; call `goals` first."""
        found, closed = list[GoalPlace](), -1
        while closed < len(self._closed):  # joints of a loop may move frames of another one
            closed = len(self._closed)
            for number, term in enumerate(self._problem.constraints):
                if isinstance(term, Hold) and term.relative_to and id(term) not in self._closed and self._moves(term):
                    self._closed.add(id(term))
                    where = f"constraints[{number}], Hold"
                    found += self._relative(where, term.frame, term.relative_to, term)
        return tuple(found)

    def _relative(self, where: str, frame: str, to: str, term: Relative | Hold) -> list[GoalPlace]:
        """A goal between two frames: the joints of both move, but for those that move both."""
        place, base = term.residual.place.joint, term.residual.base.joint
        apart = set.symmetric_difference(*(set(self._figure.model.supports[joint]) for joint in (place, base)))
        paths = [apart.intersection(self._reaching(name)) for name in (frame, to)]
        self._move(where, frame, set().union(*paths))
        return [one for one, path in zip(_ends(term), paths, strict=True) if not path <= self.fixed]

    def constraints(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the reach cones and of the ranges of motion; call `goals` first."""
        problem, cones, ranges = self._problem, dict[str, None](), dict[str, None]()
        left_out = {id(term) for term in problem.defaults if not isinstance(term, BY_DEFAULT)}
        for number, term in enumerate(problem.constraints):
            where = f"constraints[{number}], {type(term).__name__}"
            if id(term) in left_out:
                continue
            if isinstance(term, ReachCones):
                cones.update(dict.fromkeys(term.row_names))
            elif isinstance(term, RangeOfMotion):
                ranges.update(dict.fromkeys(term.row_names))
            elif isinstance(term, Hold) and id(term) in self._closed:
                continue
            elif isinstance(term, Hold):
                self._hold(term, f"{where}({term.frame!r})")
            else:
                self.refused.append(where)
        return tuple(cones), tuple(ranges)

    def _hold(self, term: Hold, where: str) -> None:
        """Keep the joints that would move a frame, if it is where it is held and no goal needs them."""
        if self._moves(term):
            self.refused.append(f"{where}, which the joints that reach move too")
        elif np.abs(term.value(self._state.update(self._problem.start))).max() > 1e-6:  # m, rad
            self.refused.append(f"{where}, which is elsewhere at the start")
        self.fixed |= set(self._state.column_joint[self._carried(term) != 0.0].tolist())

    def _moves(self, term: Hold) -> bool:
        """Whether joints that reach move a frame against what it is held at."""
        model = self._problem.scene.model
        return bool(self._carried(term)[[model.joints[joint].idx_v for joint in sorted(self.joints)]].any())

    def _carried(self, term: Hold) -> Array:
        """(nv,) which freedoms move a frame against what it is held at; nothing moves the world."""
        support = self._state.support
        return np.asarray(support[term.residual.place.joint] - support[term.residual.base.joint])

    def others(self) -> None:
        """Refuse bounds and measures without a counterpart in cyclic coordinate descent."""
        for number, bound in enumerate(self._problem.bounds):
            if not isinstance(bound, (Freeze, StepLimit)):
                self.refused.append(f"bounds[{number}], {type(bound).__name__}")
        if self._problem.measures_given:
            for number, term in enumerate(self._problem.measures):
                self.refused.append(f"measures[{number}], {type(term).__name__}")


def reaching(figure: Figure, frame: str) -> tuple[int, ...]:
    """The joints of the frame's chain up to it; without a chain, all between the frame and the root."""
    carrier = int(figure.model.frames[figure.frame_id(frame)].parentJoint)
    for chain in figure.chains.values():
        joints = [figure.joint_id(name) for name in chain.joints]
        if carrier in joints:
            return tuple(joint for joint in joints[: joints.index(carrier) + 1] if movable(figure.model, joint))
    path = [int(joint) for joint in figure.model.supports[carrier]]
    return tuple(joint for joint in path if joint > 0 and movable(figure.model, joint))


def _goal_place(goal: Point | Frame | Orientation) -> GoalPlace:
    if isinstance(goal, Point):
        return GoalPlace(goal.place.frame, three(goal.resolved_offset), three(goal.resolved_target), None, goal.weight)
    return GoalPlace(goal.residual.place.frame, (0.0, 0.0, 0.0), *_target(goal.residual), goal.weight)


def _target(asked: Any) -> tuple[Vector | None, Any]:
    """Position and rotation that a residual of placements asks for."""
    place = three(asked.placement.translation) if asked.position else None
    return place, asked.placement.rotation if asked.orientation else None


def _ends(term: Relative | Hold) -> tuple[GoalPlace, GoalPlace]:
    """The frame with its target in the other one, and the other one with its target in the frame."""
    (place, rotation), origin = _target(term.residual), (0.0, 0.0, 0.0)
    frame, to = term.residual.place.frame, term.residual.base.frame
    weight = term.weight if isinstance(term, Relative) else 1.0
    back = None if rotation is None else rotation.T
    return (
        GoalPlace(frame, origin, place, rotation, weight, to, 0),
        GoalPlace(to, place or origin, origin, back, weight, frame, 1),
    )
