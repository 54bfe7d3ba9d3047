"""Dragging with any method: a goal that moves, followed frame by frame.

After Choi and Cremer 1999, section 3: a stream of nearby goals, each met with moderate accuracy and the last one with
high.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.checks import time_step
from wholebody.methods.ccd.method import CCD
from wholebody.methods.moving_goals import begun_at, moving_goal, own_copy, part_way, refuse_assembly, retarget
from wholebody.methods.nearby import Nearby, for_motions
from wholebody.methods.newton.method import Newton
from wholebody.methods.newton.tracking import NewtonTracker
from wholebody.methods.qp.method import QP
from wholebody.methods.qp.tracking import Tracker
from wholebody.methods.solve import Method
from wholebody.pool import OneAtATime
from wholebody.problem import Problem
from wholebody.solution import Solution
from wholebody.tasks import Frame, Point, StepLimit
from wholebody.workspace import Workspace

Array = NDArray[np.float64]

FRAME = 1.0 / 60.0  # s: a frame of a screen
ON_THE_WAY = 1e-3  # m, rad: to which a method that solves anew in every frame meets the goal before the end
OF_A_FRAME = 1e-4  # m, rad: to which "qp" meets the goal in a frame
PROGRAMS = 3  # most of a frame; more = nearer to a goal that turns quickly, dearer frames where it cannot be met
WORTH = 0.5  # share of the error that another program must leave at most for one more to follow
LEGS = (np.inf, 0.01, 0.002)  # m, rad: how far the goal is followed in a frame, in turn where a longer way is not free
GRAZE = 5e-4  # m: deeper than this a way goes into something; soles that are held dip in between two postures
SHORT = 0.03  # rad, m: a shorter way of joints whose every step was looked after dips in by less than GRAZE


class DragFrame(NamedTuple):
    """Answer of one frame of a drag.

    Attributes:
        q: (nq,) the posture.
        error: what is left to the goals, metres or radians, the larger.
        iterations: iterations of the method.
        seconds: wall time.
    """

    q: Array
    error: float
    iterations: int
    seconds: float


class Drag:
    """Follows a goal that is moved from frame to frame.

    "qp" makes one quadratic program a frame, seldom up to three, "newton" a few Newton steps; other methods solve every
    frame anew from the posture at hand, "ccd" to a millimetre. No method restarts elsewhere. Where the way to a posture
    goes into something, the goal is followed by a shorter leg, or not in that frame. Where something came into the
    figure, getting out of it comes first.

    Attributes:
        problem: what is asked; its goals are replaced as they move.
        q: (nq,) the present posture.
        tracker: the method's own for these goals, where it has one.
    """

    def __init__(self, problem: Problem, method: str | Method = "qp", *, goal: int = 0, dt: float = FRAME) -> None:
        """Take hold.

        Args:
            problem: with the goal that will move, a `Point` or a `Frame`.
            method: "qp", "ccd", "newton" or another by name, which is set for 1e-5 at the end and not to restart; or a
                configured method, which is taken as it is.
            goal: which of the problem's goals moves.
            dt: seconds a frame.

        Raises:
            InputError: there is no such goal, or it is of another kind.
            UnknownNameError: there is no such method.
        """
        refuse_assembly(problem, "Drag")
        self.problem, self.dt = own_copy(problem), time_step(dt, "dt")
        self.method = for_motions(method)
        own = self.method
        self.tracker = own.tracker(self.problem, self.dt) if isinstance(own, (QP, Newton)) else None
        self._workspace = self.tracker.workspace if self.tracker is not None else self.problem.workspace()
        self._alone = OneAtATime("drag")
        self._rough = replace(self.method, tolerance=ON_THE_WAY) if isinstance(self.method, CCD) else self.method
        moving_goal(problem, goal)
        self._number = goal
        self.q: Array = problem.scene.figure.clamp(problem.start)

    def to(self, target: Any) -> DragFrame:
        """Move the goal to a place (or a placement, for a `Frame`), and make one frame towards it.

        Raises:
            InputError: the target is not one.
        """
        began = time.perf_counter()
        with self._alone:
            retarget(self.problem, self._number, target)
            self._workspace.refresh()
            if isinstance(self.tracker, Tracker):
                self.q, iterations = qp_frame(self.tracker, self.q, OF_A_FRAME)
            else:
                iterations = self._followed()
            return DragFrame(
                self.q, _error(self.problem, self._workspace, self.q), iterations, time.perf_counter() - began
            )

    def finish(self) -> Solution:
        """Meet the goal where it is now with the method's full accuracy, and judge the posture."""
        with self._alone:
            tracker = self.tracker if isinstance(self.tracker, NewtonTracker) else None
            solution = Nearby(self.problem, self.method, tracker).solve(self.q)
            self.q = solution.q
            return solution

    def _followed(self) -> int:
        """Move to a posture whose way is free, nearer to the goal by as long a leg as goes; the iterations it took.

        Where something came into the figure, out of it.
        """
        goal, deep = moving_goal(self.problem, self._number), self._came_in()
        try:
            return self._follow(goal, deep)
        finally:
            retarget(self.problem, self._number, goal.target)

    def _follow(self, goal: Point | Frame, deep: float) -> int:
        spent, tried = 0, list[Array]()
        left = goal.error(self._workspace.state.update(self.q))
        error = max(float(np.linalg.norm(left[:3])), float(np.linalg.norm(left[3:])))
        for leg in LEGS:
            if leg < error:
                retarget(self.problem, self._number, part_way(goal, left, leg / error))
            elif np.isfinite(leg):
                continue  # the goal is no farther than that, and was asked for already
            q, iterations, short = self._attempt()
            spent, q = spent + iterations, self._bounded(q)
            if _free(self._workspace, self.q, q, short) and (not deep or _depth(self._workspace, q) <= GRAZE):
                self.q = q
                break
            tried.append(q)
        else:
            if deep:
                self._leave(tried, deep)
        return spent

    def _attempt(self) -> tuple[Array, int, float]:
        """A posture for the present goals, the iterations, and how long a way the method itself looks after."""
        if isinstance(self.tracker, NewtonTracker):
            step = self.tracker.step(self.q)
            return step.q, step.iterations, SHORT
        solution = self._rough.solve(begun_at(self.problem, self.q))
        return solution.q, solution.iterations, 0.0

    def _bounded(self, q: Array) -> Array:
        """As far towards the posture q (nq,) as bounds on speeds let a frame go."""
        limits = [bound for bound in self.problem.bounds if isinstance(bound, StepLimit)]
        if not limits:
            return q
        model, state = self._workspace.model, self._workspace.state.update(self.q)
        way = pin.difference(model, self.q, q)
        most = np.min(
            [np.where(way > 0.0, high, -low) for low, high in (b.bounds(state, self.dt) for b in limits)], axis=0
        )
        share = float(np.min(np.where(np.abs(way) > most, most / np.maximum(np.abs(way), 1e-12), 1.0)))
        return q if share >= 1.0 else np.asarray(pin.integrate(model, self.q, share * way))

    def _came_in(self) -> float:
        """How deep something is in the figure, metres; 0 for little, and for newton, which sees to that by itself."""
        deep = 0.0 if isinstance(self.method, Newton) else _depth(self._workspace, self.q)
        return deep if deep > GRAZE else 0.0

    def _leave(self, tried: list[Array], deep: float) -> None:
        """Out of what came in by `deep` metres, where no way that was tried is free and leads out.

        "ccd" pushes the present posture out. Of this and the postures (nq,) that were tried, a free way is better than
        one that gets deeper first, and then the less deep end.
        """
        pushed = [self._bounded(self.method.pushed_out(self.problem, self.q))] if isinstance(self.method, CCD) else []
        ends = ((_depth(self._workspace, q), q) for q in (*pushed, *tried))
        out = [
            (not _free(self._workspace, self.q, q, 0.0), depth, k) for k, (depth, q) in enumerate(ends) if depth < deep
        ]
        if out:
            self.q = [*pushed, *tried][min(out)[2]]


def qp_frame(tracker: Tracker, q: Array, tolerance: float) -> tuple[Array, int]:
    """One frame of dragging by quadratic programs: until the goals are met as a frame should, or another brings little.

    Args:
        tracker: of the problem with the goals of this frame.
        q: (nq,) posture of the frame before.
        tolerance: to which the goals of a frame are met, metres and radians.

    Returns:
        The posture (nq,), and how many programs it took.
    """
    problem, workspace = tracker.problem, tracker.workspace
    bounded = any(isinstance(bound, StepLimit) for bound in problem.bounds)  # of the way of a whole frame
    here, error = tracker.step(q).q, np.inf
    for spent in range(1, 1 if bounded else PROGRAMS):
        before, error = error, _error(problem, workspace, here)
        if error <= tolerance or error > WORTH * before:
            return here, spent
        there = tracker.step(here, measures=False).q
        if not _free(workspace, q, there, SHORT):
            return here, spent + 1
        here = there
    return here, 1 if bounded else PROGRAMS


def _free(workspace: Workspace, before: Array, after: Array, short: float) -> bool:
    """Whether the way between postures (nq,) goes into nothing; ways up to `short` are taken as they are."""
    if np.abs(pin.difference(workspace.model, before, after)).max(initial=0.0) <= short:
        return True
    return workspace.sweep.first_contact(before, after, tolerance=GRAZE) is None


def _depth(workspace: Workspace, q: Array) -> float:
    """Depth of the deepest overlap at a posture (nq,), metres."""
    return float(-workspace.near(q, 0.0).distance.min(initial=0.0))


def _error(problem: Problem, workspace: Workspace, q: Array) -> float:
    state = workspace.state.update(q)
    return max((float(np.linalg.norm(goal.error(state))) for goal in problem.goals), default=0.0)
