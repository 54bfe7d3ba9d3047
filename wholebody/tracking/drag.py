"""Dragging with any method: a stream of nearby goals, frame by frame (Choi and Cremer 1999, section 3)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, Generic, NamedTuple, TypeVar, overload

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import number, posture, shown, time_step
from wholebody.base.errors import InputError
from wholebody.base.pool import OneAtATime
from wholebody.geometry.continuous.passing_through import GRAZE, INSIDE, is_free
from wholebody.methods.base import Method, Step, Tracker, goal_error, judged
from wholebody.methods.control import BUDGET, budget_for_sweep, within_budget
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.assembly_system import AssemblySolution
from wholebody.methods.newton.settings import FRAMES
from wholebody.methods.solve import method_for_motions, warn_of_left_out
from wholebody.problem import Problem
from wholebody.scene.moving_obstacles import Collision, FrameMotion
from wholebody.scene.workspace import NotCopyable, Workspace
from wholebody.solution import Solution
from wholebody.tasks import Hold, Relative
from wholebody.tasks.bounds import shortened
from wholebody.tracking.frame import FRAME
from wholebody.tracking.moving_goals import copied, interpolated_target, moving_goal, retarget, warm_started
from wholebody.tracking.qp_strategy import largest_motions

Answer = TypeVar("Answer", Solution, AssemblySolution)


class DragFrame(NamedTuple):
    """Answer of one frame of a drag."""

    q: Array  # (nq,) the posture, of an assembly that of its `scene`
    error: float  # largest remaining goal error, metres or radians
    iterations: int  # iterations of the method
    seconds: float  # wall time
    # what things that move (`Scene.move` with `over`) passed through, or are inside of
    collisions: tuple[Collision, ...] = ()
    # shares of the frame, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty. Straight from
    # one to the next nothing was passed but the collisions.
    path: tuple[tuple[float, Array], ...] = ()
    open: float = 0.0  # largest error of an assembly's joints and contacts, metres or radians

    def __repr__(self) -> str:
        hit = f", {len(self.collisions)} collisions" if self.collisions else ""
        return f"DragFrame: error {self.error:.3g}, {self.iterations} iterations, {1e3 * self.seconds:.3g} ms{hit}"


class GoalMoves:
    """How far the goal moves in a frame: all the way, or as far as its budget was enough for lately."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._most, self._error, self._starved = seconds, np.inf, 0.0, 0

    @property
    def budget(self) -> float:
        """Seconds of the next frame: twice as many after each three in a row that were cut off (a slow machine)."""
        return float(self._seconds * 2.0 ** min(self._starved // 3, 4))

    def shares(self, error: float) -> Iterator[float]:
        """Fractions of the path to a goal that is `error` m or rad away, tried until a motion is free or time is up."""
        self._error = error
        moves = (self._most, *(move for move in (0.01, 0.002) if move < self._most))  # m, rad
        for turn, move in enumerate(moves):
            if turn == 0 or (move < error and not BUDGET.over):
                yield min(1.0, move / error) if error else 1.0

    def end(self, error: float, *, cut: bool = False) -> None:
        """End a frame that left an error: the next goes twice as far, or half as far if it was `cut` off."""
        asked = min(self._most, self._error)
        if cut:
            self._starved += 1
        elif BUDGET.spent < 0.25:
            self._starved = 0
        if BUDGET.spent < 0.5 or self._error - error > 0.5 * asked:
            self._most *= 2.0
        elif BUDGET.over:
            self._most = max(0.5 * asked, 0.002)  # m, rad


class ProblemDrag:
    """Follows a goal of a problem; see `Drag`, which raises the same.

    Attributes:
        problem: to be solved; its goals are replaced as they move.
        q: (nq,) the present posture.
        tracker: the method's tracker of these goals.
        workspace: distances and sweeps of its frames.
    """

    def __init__(self, problem: Problem, method: str | Method, *, goal: int, dt: float, budget: float) -> None:
        self.problem, self.dt = copied(problem), time_step(dt, "dt")
        self.method = warn_of_left_out(method_for_motions(method), 3, self.problem)
        self.tracker = self.method.tracker(self.problem, self.dt)
        self.workspace = self.tracker.workspace
        self._alone = OneAtATime("drag")
        moving_goal(problem, goal)
        self._number, self._seconds, self._moves = goal, budget, GoalMoves(budget)
        self._motion: FrameMotion | None = None
        most = largest_motions(problem.scene, 8.0 * self.dt, 3.0 * self.dt)  # rad/s, m/s: as a tracked figure's
        closed = any(isinstance(term, Hold) and term.relative_to for term in problem.constraints)
        # a frame within a budget is seen as it comes; part of a motion would open what two frames hold together
        self._fastest = None if budget == np.inf or closed else np.array((-most, most))
        self.q: Array = problem.scene.figure.clamp(problem.start)

    def place(self, q: Array) -> None:
        """Go on from a posture (nq,)."""
        self.q = np.array(posture(q, self.problem.scene.model.nq, "Drag: q"))

    def to(self, target: Any) -> DragFrame:
        """See `Drag.to`."""
        began = time.perf_counter()
        with self._alone, within_budget(self._moves.budget):
            retarget(self.problem, self._number, target)
            self.workspace.refresh()
            before = self.q
            collisions, path = tuple[Collision, ...](), tuple[tuple[float, Array], ...]()
            if np.isinf(self.tracker.unswept):
                step = self.tracker.frame(self.q) if self._seconds == np.inf else next(self._frames())
                self.q, iterations = step.q, step.iterations
                collisions, path = getattr(step, "collisions", ()), getattr(step, "path", ())
            else:
                self._motion = self.workspace.next_frame(self.q)
                iterations = self._followed()
                if self._motion is not None:
                    collisions = judged(self.workspace, self._motion, before, self.q)
                    path = ((0.0, before), (1.0, self.q))
            if self._seconds < np.inf:
                still = np.allclose(before, self.q, rtol=0.0, atol=1e-9)  # m, rad: of rounding
                self._moves.end(self._left()[1], cut=BUDGET.over and still)
            error = goal_error(self.problem, self.workspace, self.q)
            return DragFrame(self.q, error, iterations, time.perf_counter() - began, collisions, path)

    def finish(self) -> Solution:
        """See `Drag.finish`."""
        with self._alone:
            solution = warm_started(self.problem, self.tracker, self.q)
            self.q = solution.q
            return solution

    def _followed(self) -> int:
        """Move by the longest free motion of `GoalMoves`, or out of a thing moved into the figure; the iterations."""
        spent, tried = 0, list[Array]()
        # m: depth of an overlap that the tracker itself does not lead out of
        deep = 0.0 if self.tracker.leaves_overlap else self.workspace.deepest(self.q)
        deep = deep if deep > GRAZE else 0.0
        found: Array | None = None
        for step in self._frames():
            spent, q = spent + step.iterations, step.q
            part = shortened(self.problem.scene.model, self.q, q, self._fastest)
            if not (self._is_free(part, self.tracker.unswept) and (not deep or self.workspace.deepest(part) <= GRAZE)):
                tried.append(part)
                continue
            # a part of a motion leads through what its end is beside; the motion to a nearer goal may be whole
            rubs = part is not q and self.workspace.deepest(part) > INSIDE
            found = part if found is None or not rubs else found
            if not rubs:
                break
        if found is not None:
            self.q = found
        elif deep:
            self._leave(tried, deep)
        return spent

    def _frames(self) -> Iterator[Step]:
        goal = moving_goal(self.problem, self._number)
        (left, error), target = self._left(), goal.placement if isinstance(goal, Relative) else goal.target
        for share in self._moves.shares(error):
            if share < 1.0:
                retarget(self.problem, self._number, interpolated_target(goal, left, share))
            step = self.tracker.frame(self.q)
            retarget(self.problem, self._number, target)
            yield step

    def _left(self) -> tuple[Array, float]:
        """The error of the moving goal at the present posture, and its length, metres or radians."""
        left = moving_goal(self.problem, self._number).error(self.workspace.state.update(self.q))
        return left, max(float(np.linalg.norm(left[:3])), float(np.linalg.norm(left[3:])))

    def _is_free(self, q: Array, unswept: float) -> bool:
        """Whether the motion to the posture q (nq,) is free, with things that move meanwhile; see `is_free`."""
        if self._motion is not None:
            return self._motion.first_contact(self.q, q, GRAZE) is None
        return is_free(self.workspace, self.q, q, unswept, budget_for_sweep())

    def _leave(self, tried: list[Array], deep: float) -> None:
        """Move out of an overlap of `deep` metres: by a free motion, else to the shallower end."""
        ends = [*self.tracker.overlap_resolutions(self.q), *tried]
        depths = [self.workspace.deepest(q) for q in ends]
        out = [
            (not self._is_free(q, 0.0), depth, number)
            for number, (depth, q) in enumerate(zip(depths, ends, strict=True))
            if depth < deep
        ]
        if out:
            self.q = ends[min(out)[2]]


class AssemblyDrag:
    """Follows a goal of an assembly that is moved from frame to frame; it moves the assembly's bodies.

    If joints or contacts do not hold after a frame, or its motion passes through something, the goal moves by a shorter
    distance, or not in that frame. Raises InputError where there is no such goal.
    """

    def __init__(self, assembly: Assembly, goal: int, seconds: float) -> None:
        self._goal, self._moves = assembly.goal_index(goal), GoalMoves(seconds)
        self.problem, self.tracker = assembly.prepare(), None

    @property
    def workspace(self) -> Workspace | None:
        """Distances and sweeps of its frames; None where no shapes can touch."""
        return self.problem.workspace

    @property
    def q(self) -> Array:
        """(nq,) the placements of the bodies as a posture of the assembly's `scene`."""
        return self.problem.q

    def place(self, _: Array) -> None:
        """Refuse: an assembly is placed by its own variables."""
        raise InputError("Drag: the posture of an assembly is set by assembly.place(variables)")

    def to(self, target: Any) -> DragFrame:
        """Make one frame towards a position, placement or orientation; raises InputError where the target is none."""
        began, spent, collisions = time.perf_counter(), 0, tuple[Collision, ...]()
        path: tuple[tuple[float, Array], ...] = ()
        made, goal, hard = self.problem, self._goal, 0.0
        made.retarget(goal, target)
        error, before = made.goal_error(goal), made.variables()
        with within_budget(self._moves.budget):
            try:
                for share in self._moves.shares(error):
                    if share < 1.0:
                        made.interpolate_goal(goal, share, target)
                    step = made.step()
                    spent, collisions = spent + step.iterations, collisions or step.collisions
                    path, hard = step.path or path, step.joint_error
                    if step.taken:
                        break
            finally:
                made.retarget(goal, target)
            cut = BUDGET.spent > FRAMES.time_share and step.taken and np.array_equal(before, made.variables())
            self._moves.end(made.goal_error(goal), cut=cut)
        left = max(made.goal_error(number) for number in range(len(made.goals)))
        if path and not np.array_equal(path[-1][1], made.q):
            path = (*path, (1.0, made.q))
        return DragFrame(made.q, left, spent, time.perf_counter() - began, collisions, path, hard)

    def finish(self) -> AssemblySolution:
        """Meet the present goals with full accuracy."""
        return self.problem.solve()


class Drag(NotCopyable, Generic[Answer]):
    """Follows a goal that is moved from frame to frame, of a problem by any method or of an assembly.

    "qp" solves one quadratic program a frame, seldom up to three; "newton" takes a few Newton steps. Other methods
    solve every frame anew from the present posture, "ccd" and "placo" to a millimetre. No method restarts from other
    postures. If the motion to a posture penetrates something, the goal moves by a shorter distance, or not in that
    frame. If a thing was moved into the figure, the figure first leaves it. Of things that move (`Scene.move` with
    `over`) "qp" evades them as they come; the others meet them where they end. What they could not avoid is
    named in the answer. A drag of an assembly moves the assembly itself, by a few Newton steps a frame.

    With a budget a frame ends with what it has found by then, and the next goes on from there. By other methods than
    "qp", which may jump, joints turn by at most 8 rad/s then, unless a `Hold` is relative to another frame. Where
    it was not enough to get half as far as the goal went, the goal goes half as far next, down to 2 mm; otherwise it
    goes twice as far.

    Raises:
        InputError: a problem that the method cannot take, a goal that cannot be moved, or a value out of range.
        UnknownNameError: there is no such method.

    Examples:
        >>> drag = wb.tracking.Drag(problem.with_start(solution.q))
        >>> drag.to((0.55, -0.25, 0.96)).error < 0.01
        True
    """

    @overload
    def __init__(
        self: Drag[Solution],
        problem: Problem,
        method: str | Method = ...,
        *,
        goal: int = ...,
        dt: float = ...,
        budget: float = ...,
    ) -> None: ...
    @overload
    def __init__(self: Drag[AssemblySolution], problem: Assembly, *, goal: int = ..., budget: float = ...) -> None: ...
    def __init__(
        self,
        problem: Problem | Assembly,
        method: str | Method = "qp",
        *,
        goal: int = 0,
        dt: float = FRAME,
        budget: float = np.inf,
    ) -> None:
        """Begin a drag at the problem's start, or where the assembly's bodies are.

        Args:
            problem: with the goal that will move, a `Point`, a `Frame`, an `Orientation` or a `Relative`, whose target
                is in the axes of its `to`; or an assembly with a goal.
            method: "qp", "ccd", "newton" or another by name, with a tolerance of 1e-5 at the end and no restarts; or a
                configured method, which is used as it is. An assembly has one method only.
            goal: index of the goal that moves.
            dt: seconds a frame, for methods that bound velocities.
            budget: seconds of the processor after which the search of a frame ends; the next goes on from there.

        Raises:
            InputError: there is no such goal, it is of another kind, or the budget is not positive.
            UnknownNameError: there is no such method.
        """
        self._run: ProblemDrag | AssemblyDrag
        budget = np.inf if budget == np.inf else number(budget, "Drag: budget", 1e-9, 3600.0, "s")
        if isinstance(problem, Assembly):
            dt = time_step(dt, "dt")
            if method not in ("qp", "newton"):
                raise InputError(
                    f"Drag: an assembly is solved by Newton steps, not by {shown(method)}; leave method out"
                )
            self._run = AssemblyDrag(problem, goal, budget)
        else:
            self._run = ProblemDrag(problem, method, goal=goal, dt=dt, budget=budget)

    @property
    def q(self) -> Array:
        """(nq,) the present posture, of an assembly that of its `scene`, where it cannot be set."""
        return self._run.q

    @q.setter
    def q(self, q: Array) -> None:
        self._run.place(q)

    @property
    def problem(self) -> Problem | Assembly:
        """The problem, whose goals are replaced as they move; or the assembly."""
        return self._run.problem

    @property
    def workspace(self) -> Workspace | None:
        """Distances and sweeps of its frames; None for an assembly in which no shapes can touch."""
        return self._run.workspace

    @property
    def tracker(self) -> Tracker | None:
        """The method's tracker of the problem's goals; None for an assembly."""
        return self._run.tracker

    def to(self, target: Any) -> DragFrame:
        """Move the goal to a position, placement or orientation, as its kind has it, and make one frame towards it.

        Raises InputError where the target is none.
        """
        return self._run.to(target)

    def finish(self) -> Answer:
        """Meet the present goal with the method's full accuracy, and assess the posture."""
        answer: Any = self._run.finish()
        found: Answer = answer
        return found
