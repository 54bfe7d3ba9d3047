"""A goal dragged along a path by any method: the postures, their times, and their assessment."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wholebody.assessment.motion import deepened, jerk
from wholebody.assessment.posture import assess
from wholebody.base.arrays import Array, brief
from wholebody.base.checks import array, function, instance, numbers
from wholebody.base.errors import InputError
from wholebody.methods.base import Method
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.tasks import Point
from wholebody.tracking.drag import Drag, DragFrame
from wholebody.tracking.frame import FRAME
from wholebody.tracking.moving_goals import copied, moving_goal, retarget, target_of

Counts = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Dragged:
    """A drag, frame by frame; it has `q` and `dt` like a clip.

    Attributes:
        q: (n + 2, nq) the start, every frame, and the end, which is solved to full accuracy.
        targets: (n, 3) position of the goal in each frame, metres; the last one is repeated while the figure lags.
        dt: seconds from frame to frame.
        method: name of the method.
        seconds, cpu_seconds: (n,) of each frame: wall time, and the processor's for this thread.
        iterations: (n,) of the method in each frame.
        end: the solution at the end.
        paths: the path to each posture, as in `DragFrame`; empty where it is straight.

    Examples:
        >>> wholebody.tracking.drag_along(problem, [(0.5, -0.25, 0.95)], "qp").method
        'qp'
    """

    __repr__ = brief

    q: Array
    targets: Array
    dt: float
    method: str
    seconds: Array
    cpu_seconds: Array
    iterations: Counts
    end: Solution
    paths: tuple[tuple[tuple[float, Array], ...], ...] = ()

    def __len__(self) -> int:
        return len(self.targets)


@dataclass(frozen=True, eq=False)
class DragJudgement:
    """How good a drag is; arrays have a row a posture, the start first and the end last.

    Attributes:
        error: (n,) remaining error of the moving goal in each frame, metres, or radians if that is more.
        depth: (n + 2,) deepest overlap of any pair, metres; 0 if there is none.
        between: (n + 1,) a bound on how much deeper any pair gets between two postures than at the deeper of the two,
            metres, one of `assessment.motion.DEPTHS`; inf if it is more than the last of them.
        constraint_violation: (n + 2,) largest violation of a constraint, metres or radians.
        limit_violation: largest violation of a joint limit at any posture, radians.
        jerk: (n - 1,) root of the mean square of the third difference of the joint angles over time, rad/s^3.

    Examples:
        >>> dragged = wholebody.tracking.drag_along(problem, [(0.5, -0.25, 0.95)], "qp")
        >>> bool(wholebody.tracking.judge_drag(problem, dragged).limit_violation < 1e-6)
        True
    """

    __repr__ = brief

    error: Array
    depth: Array
    between: Array
    constraint_violation: Array
    limit_violation: float
    jerk: Array


def present_position(problem: Problem, goal: int = 0) -> Array:
    """Position (3,), metres, of the frame or point of a goal at the start; raises InputError for other goals."""
    term = moving_goal(problem, goal)
    return np.asarray(target_position(problem, goal) + term.error(problem.scene.state(problem.start))[:3])


def target_position(problem: Problem, goal: int = 0) -> Array:
    """Position of a goal's target, (3,) metres; raises like `present_position`."""
    term = moving_goal(problem, goal)
    target = target_of(term)
    return np.array(target if isinstance(term, Point) else target.translation, dtype=float)


def drag_along(
    problem: Problem,
    places: ArrayLike,
    method: str | Method = "newton",
    *,
    goal: int = 0,
    dt: float = FRAME,
    progress: Callable[[int], None] | None = None,
) -> Dragged:
    """Drag a goal through positions, one a frame, and meet the last with full accuracy.

    A figure that lags behind gets more frames at the last position until it comes to rest.

    Args:
        problem: with the goal that moves, a `Point`, or a `Frame` or a `Relative`, which keep their orientation.
        places: (n, 3) metres, of a `Relative` in the axes of its `to`.
        method: see `Drag`, as for what is raised.
        goal: index of the goal that moves.
        dt: seconds from frame to frame.
        progress: called after each frame with the number of frames done.

    Examples:
        >>> dragged = wholebody.tracking.drag_along(problem, [(0.5, -0.25, 0.95)], "qp")
        >>> dragged.end.status
        'solved'
    """
    given = array(places, "places", "places of shape (n, 3), metres")
    if given.ndim != 2 or given.shape[1] != 3 or not len(given):
        raise InputError(f"places has shape {given.shape}; give places of shape (n, 3), metres, at least one")
    targets = numbers(given, given.shape, "places")
    function(progress, "progress")
    drag = Drag(problem, method, goal=goal, dt=dt)
    aims = [_aim(problem, goal, place) for place in targets]
    start, frames, cpu, left = drag.q, list[DragFrame](), list[float](), [np.inf]
    # A figure that lags behind gets 120 frames at most, while it is over 1e-3 off and comes nearer by 1e-4 (m, rad).
    while len(cpu) < len(aims) or (len(cpu) < len(aims) + 120 and left[-1] > 1e-3 and left[-2] - left[-1] > 1e-4):
        began = time.thread_time()
        frames.append(drag.to(aims[min(len(cpu), len(aims) - 1)]))
        cpu.append(time.thread_time() - began)
        left.append(frames[-1].error)
        if progress is not None:
            progress(min(len(cpu), len(aims)))
    end = drag.finish()
    return Dragged(
        q=np.array([start, *(frame.q for frame in frames), end.q]),
        targets=np.vstack([targets, np.tile(targets[-1], (len(cpu) - len(aims), 1))]),
        dt=dt,
        method=end.method,
        seconds=np.array([frame.seconds for frame in frames]),
        cpu_seconds=np.array(cpu),
        iterations=np.array([frame.iterations for frame in frames], dtype=np.intp),
        end=end,
        paths=((), *(frame.path for frame in frames), ()),
    )


def judge_drag(problem: Problem, dragged: Dragged, *, goal: int = 0) -> DragJudgement:
    """Assess a drag of a problem's goal.

    Examples:
        >>> dragged = wholebody.tracking.drag_along(problem, [(0.5, -0.25, 0.95)], "qp")
        >>> bool(wholebody.tracking.judge_drag(problem, dragged).depth.max() < 1e-3)
        True
    """
    own = copied(problem)
    instance(dragged, Dragged, "judge_drag: dragged", "make one with drag_along(problem, places)")
    moving_goal(problem, goal)
    errors, judged = [], []
    for frame, q in enumerate(dragged.q):
        place = dragged.targets[min(max(frame - 1, 0), len(dragged) - 1)]
        retarget(own, goal, _aim(problem, goal, place))
        judged.append(assess(own, q))
        errors.append(judged[-1].goal_errors[goal])
    return DragJudgement(
        error=np.array(errors[1:-1]),
        depth=np.array([one.penetration for one in judged]),
        between=deepened(problem.scene, dragged.q),
        constraint_violation=np.array([one.constraint_violation for one in judged]),
        limit_violation=max(one.limit_violation for one in judged),
        jerk=jerk(problem.scene.model, dragged.q, dragged.dt),
    )


def _aim(problem: Problem, goal: int, place: Array) -> Array | pin.SE3:
    """The target of a moving goal at a position (3,)."""
    term = moving_goal(problem, goal)
    return place if isinstance(term, Point) else pin.SE3(target_of(term).rotation, place)
