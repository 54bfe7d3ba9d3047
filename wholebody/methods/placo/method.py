"""The method placo: its differential inverse kinematics, iterated until a whole problem is solved."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.geometry.proximity import COAL_ACCURACY
from wholebody.methods.base import SolvingTracker, UnsupportedTermError, refusal
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control, Progress, check_time_limit
from wholebody.methods.inputs import ITERATIONS, TOLERANCE, check_problem, check_settings
from wholebody.methods.placo.robot import SWELL, Robot
from wholebody.methods.placo.terms import add_terms, named_frames, unsupported
from wholebody.problem import Problem
from wholebody.solution import Solution, TraceEntry
from wholebody.workspace import Workspace

STEP = 0.05  # rad, m: largest motion of a joint or the root in one iteration
NEAR = 0.1  # m: pairs nearer than this have a row; placo's trigger
SHARE = 0.5  # of the tolerance, to which goals and constraints are met: the assessment rounds differently
LET_IN = 0.4  # share of the tolerance by which pairs may be nearer than their clearance
REST = 1e-2  # share of the tolerance: a smaller step counts as convergence
COMFORT = 1e-2  # weight of the measures at the beginning, against goals of weight 1
DECAY = 0.75  # of that weight from one iteration to the next; less ends sooner and with more effort
LEAST = 1e-3  # share of the tolerance: least weight of the measures, which goals then miss by less than the tolerance
REGULAR = 1e-3  # share of the measures' weight: weight of the motion itself
DAMPING = 1e-3  # weight of the motion after a step opposed to the previous one, against goals of weight 1
STIFFER, LOOSER = 4.0, 0.5  # factors on that, after another such step and after any other
MOST_DAMPING = 10.0


@dataclass(frozen=True)
class Placo:
    """placo's `KinematicsSolver`, by its documented tasks, iterated.

    Goals are soft tasks and holds hard ones. Joint limits and placo's self-collision constraint, whose model includes
    the objects, are hard too. The measures are joints tasks with decreasing weight. An iteration is one of its
    programs.

    Takes Point, Frame, Orientation, Axis(direction=...), CenterOfMass, Posture and Relative goals; Hold, Plane with
    side "on", Balance and Freeze; Effort and Displacement. All other terms are refused by name. There is one
    start. If placo finds no solution of a program, the answer is the posture before it, and the message quotes placo.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most programs.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None, it
            ends after four seconds of processor time.
    """

    tolerance: float = 1e-5
    iterations: int = 200
    time_limit: float | None = None

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
        """
        check_settings(self, tolerance=TOLERANCE, iterations=ITERATIONS)
        check_time_limit(self.time_limit)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "placo"

    def accepts(self, problem: Problem) -> str | None:
        """None if placo has classes for all terms and joints; otherwise the sentence that names the others."""
        check_problem(problem, "Placo.accepts: problem")
        return refusal(self.name, unsupported(problem))

    def prepare(self, problem: Problem) -> None:
        """Build placo's robot for a problem; `solve` does it if this was not called.

        Raises:
            InputError: placo cannot express the problem, or its scene changed after it was stated.
            MissingPackageError: placo is not installed.
        """
        check_problem(problem, "Placo.prepare: problem")
        with problem.lend() as workspace, problem.scene.built.pool(_Room, _Room).lend() as room:
            room.robot(problem, workspace)

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """Find a posture. Goals out of reach and starts in penetration are answers, not errors.

        Args:
            problem: the problem.
            progress: see `wholebody.methods.control.Progress`.

        Raises:
            InputError: placo cannot express the problem, or its scene changed after it was stated.
            MissingPackageError: placo is not installed.
        """
        check_problem(problem, "Placo.solve: problem")
        began = time.perf_counter()
        with (
            problem.lend() as workspace,
            problem.scene.built.pool(_Room, _Room).lend() as room,
            Control(self.time_limit, progress) as control,
        ):
            run = _Run(problem, workspace, room.robot(problem, workspace), self, control)
            run.go()
        failure = f"placo gave up at program {run.programs} ({run.failure})" if run.failure else ""
        ending = Ending(
            run.q, run.rested, run.programs, tuple(run.trace), f"in {run.programs} programs", failure=failure
        )
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control, began=began)

    def tracker(self, problem: Problem, dt: float) -> SolvingTracker:
        """A tracker that solves the problem anew at every step.

        Raises:
            InputError: dt is not a positive finite number, or the scene changed after the problem was made.
        """
        return SolvingTracker(self, problem, dt)


class _Room:
    """Keeps the robot of one solve for the next solve on the same scene, which may have a similar problem."""

    def __init__(self) -> None:
        self._robot: Robot | None = None

    def robot(self, problem: Problem, workspace: Workspace) -> Robot:
        """The robot for a problem, with the placements of things in the workspace."""
        refused = unsupported(problem)
        if refused:
            raise UnsupportedTermError("placo", refused)
        frames = named_frames(problem)
        if self._robot is None or not self._robot.serves(problem, frames):
            self._robot = Robot(problem, frames)
        self._robot.place_objects(workspace.geometry)
        return self._robot


class _Run:
    """One solve.

    Attributes:
        q: (nq,) the present posture.
        programs: number of solved programs.
        rested: whether it converged: nothing moves any more.
        failure: placo's message if it found no solution.
    """

    def __init__(self, problem: Problem, workspace: Workspace, robot: Robot, method: Placo, control: Control) -> None:
        import placo

        self._problem, self._robot, self._method, self._control = problem, robot, method, control
        self._proximity, self._state = workspace.proximity, workspace.state
        self.q: Array = problem.scene.figure.clamp(problem.start)
        self.trace: list[TraceEntry] = []
        self.programs, self.rested, self.failure = 0, False, ""
        self._damping, self._last = 0.0, np.zeros(problem.scene.model.nv)
        self._solver: Any = placo.KinematicsSolver(robot.wrapper)
        self._tasks = add_terms(self._solver, robot, problem)
        self._regular = self._solver.add_regularization_task(REGULAR * COMFORT)
        self._solver.dt = 1.0
        robot.wrapper.set_velocity_limits(STEP)
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(True)
        apart = self._solver.add_avoid_self_collisions_constraint()
        # without it, rounding makes a held foot on a floor infeasible
        apart.self_collisions_margin = -SWELL - LET_IN * method.tolerance
        apart.self_collisions_trigger = NEAR - SWELL
        apart.configure("apart", "hard", 1.0)

    def go(self) -> None:
        """Iterate until everything is met, nothing moves, placo fails or the programs run out."""
        method, model = self._method, self._problem.scene.model
        step = 0.0
        while True:
            error, violation = self._look()
            self.trace.append(TraceEntry(error, violation, 0.0, step))
            self._control.tell(self.trace[-1])
            enough = SHARE * method.tolerance
            if max(error, violation) <= enough and self._apart(enough):
                return
            if self.programs and step <= REST * method.tolerance:
                self.rested = True
                return
            if self.programs == method.iterations or self._control.over:
                return
            move = self._program()
            if move is None:
                return
            moved = self._problem.scene.figure.clamp(np.asarray(pin.integrate(model, self.q, move)))
            step = float(np.abs(pin.difference(model, self.q, moved)).max(initial=0.0))
            self.q = moved

    def _look(self) -> tuple[float, float]:
        """The largest error of a goal and of a constraint, metres or radians."""
        state = self._state.update(self.q)
        errors, violations = [0.0], [0.0]
        for goal in self._problem.goals:
            error = np.atleast_1d(goal.error(state))
            angular = np.broadcast_to(goal.angular, error.shape)
            errors += [float(np.linalg.norm(error[angular])), float(np.linalg.norm(error[~angular]))]
        for term in self._problem.constraints:
            value = np.atleast_1d(term.value(state))
            violations.append(float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0)))
        return max(errors), max(violations)

    def _apart(self, tolerance: float) -> bool:
        """Whether all pairs keep their clearance."""
        clearances = self._problem.clearances
        near = self._proximity.query(self._state, float(clearances.max(initial=0.0)))
        return bool((near.distance >= clearances[near.number] - tolerance - COAL_ACCURACY).all())

    def _program(self) -> Array | None:
        """Displacement (nv,) from one of placo's programs, or None if it has no solution."""
        weight = max(COMFORT * DECAY**self.programs, LEAST * self._method.tolerance)
        self._tasks.weigh(weight)
        self._regular.set_weight(max(REGULAR * weight, self._damping))
        self._robot.move(self.q)
        self.programs += 1
        try:
            theirs = self._solver.solve(False)
        except RuntimeError as error:
            self.failure = " ".join(str(error).split())
            return None
        move = self._robot.displacement(theirs)
        if not np.isfinite(move).all():
            self.failure = "a displacement that is not a number"
            return None
        move = move * min(1.0, STEP / max(float(np.abs(move).max(initial=0.0)), STEP))
        back = float(move @ self._last) < 0.0
        self._damping = min(max(STIFFER * self._damping, DAMPING), MOST_DAMPING) if back else LOOSER * self._damping
        self._last = move
        return move
