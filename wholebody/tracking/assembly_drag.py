"""Dragging a goal of an assembly from frame to frame."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.control import BUDGET, within_budget
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.assembly_solution import AssemblySolution
from wholebody.scene.moving_obstacles import Collision


class DragFrame(NamedTuple):
    """Answer of one frame of a drag.

    Attributes:
        q: (nq,) the posture, of an assembly that of its `scene`.
        error: largest remaining goal error, metres or radians.
        iterations: iterations of the method.
        seconds: wall time.
        collisions: what things that move (`Scene.move` with `over`) passed through, or are inside of.
        path: shares of the frame, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty. Straight
            from one to the next nothing was passed but the collisions.
    """

    q: Array
    error: float
    iterations: int
    seconds: float
    collisions: tuple[Collision, ...] = ()
    path: tuple[tuple[float, Array], ...] = ()

    def __repr__(self) -> str:
        hit = f", {len(self.collisions)} collisions" if self.collisions else ""
        return f"DragFrame: error {self.error:.3g}, {self.iterations} iterations, {1e3 * self.seconds:.3g} ms{hit}"


class GoalMoves:
    """How far the goal moves in a frame: all the way, or as far as its budget was enough for lately."""

    def __init__(self) -> None:
        self._most, self._error = np.inf, 0.0

    def shares(self, error: float) -> Iterator[float]:
        """Shares of the way to a goal that is `error` m or rad away, tried until a motion is free or time is up."""
        self._error = error
        moves = (self._most, *(move for move in (0.01, 0.002) if move < self._most))  # m, rad
        for number, move in enumerate(moves):
            if number == 0 or (move < error and BUDGET.spent < 1.0):
                yield min(1.0, move / error) if error else 1.0

    def end(self, error: float) -> None:
        """End a frame that left an error: the next goes twice as far, or half as far if the budget was not enough."""
        asked = min(self._most, self._error)
        if BUDGET.spent < 0.5 or self._error - error > 0.5 * asked:
            self._most *= 2.0
        elif BUDGET.spent > 1.0:
            self._most = max(0.5 * asked, 0.002)  # m, rad


class AssemblyDrag:
    """Follows a goal of an assembly that is moved from frame to frame; it moves the assembly's bodies.

    If joints or contacts do not hold after a frame's few Newton steps, or its motion passes through something, the
    bodies go back to where they were and the goal moves by a shorter distance, or not in that frame.

    Raises InputError where there is no such goal.
    """

    def __init__(self, assembly: Assembly, goal: int, seconds: float) -> None:
        self._goal, self._seconds, self._moves = assembly.goal_index(goal), seconds, GoalMoves()
        self.assembly = assembly.prepare()

    @property
    def q(self) -> Array:
        """(nq,) the placements of the bodies as a posture of the assembly's `scene`."""
        return self.assembly.q

    def to(self, target: Any) -> DragFrame:
        """Make one frame towards a position, or a placement; raises InputError where the target is neither."""
        began, spent, collisions = time.perf_counter(), 0, tuple[Collision, ...]()
        path: tuple[tuple[float, Array], ...] = ()
        made, goal = self.assembly, self._goal
        made.retarget(goal, target)
        error = made.goal_error(goal)
        try:
            with within_budget(self._seconds):
                for share in self._moves.shares(error):
                    if share < 1.0:
                        made.interpolate_goal(goal, share, target)
                    step = made.step()
                    spent, collisions = spent + step.iterations, collisions or step.collisions
                    path = step.path or path
                    if step.taken:
                        break
                self._moves.end(made.goal_error(goal))
        finally:
            made.retarget(goal, target)
        left = max(made.goal_error(number) for number in range(len(made.goals)))
        if path and not np.array_equal(path[-1][1], made.q):
            path = (*path, (1.0, made.q))
        return DragFrame(made.q, left, spent, time.perf_counter() - began, collisions, path)

    def finish(self) -> AssemblySolution:
        """Meet the present goals with full accuracy."""
        return self.assembly.solve()
