"""The method placo: its differential inverse kinematics, iterated until a whole problem is solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.fields import Checked
from wholebody.figures.state import State
from wholebody.geometry.flesh import settled
from wholebody.methods.base import Iterations, TimeLimit, Tolerance, check_problem, unseen
from wholebody.methods.conclusion import Descends, Ending
from wholebody.methods.control import BUDGET, Control
from wholebody.methods.differential import MEASURES, REGULAR, TOOL, Iteration, Settings, StepError, held
from wholebody.methods.placo.robot import SWELL, Robot
from wholebody.methods.placo.terms import add_terms, check_terms, named_frames
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.balance import Balance

STEP = 0.1  # rad, m: largest motion of a joint or the root in one iteration; half of it takes a quarter longer
NEAR = 0.1  # m: pairs nearer than this have a row; placo's trigger
HOLDS = {"hard": 0.0, "soft": 100.0}
"""What `Placo.holds` may be -> the weight of holds as soft tasks, 0 for hard ones."""


@dataclass(frozen=True)
class Placo(Checked, Descends):
    """placo's `KinematicsSolver`, by its documented tasks, iterated.

    Goals are soft tasks and holds hard ones; a program without a solution is solved again with soft holds. Joint
    limits and placo's self-collision constraint, whose model includes the objects, are hard too. The measures are
    joints tasks with decreasing weight. An iteration is one of its programs.

    Takes Point, Frame, Orientation, Axis(direction=...), CenterOfMass, Posture and Relative goals; Hold, Plane with
    side "on", Balance and Freeze; Effort and Displacement. All other terms are refused by name, and CenterOfMass of one
    figure among several. There is one start. If placo finds no solution of a program, the answer is the posture before
    it, and the message quotes placo.

    Attributes:
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most programs.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None, it
            ends after four seconds of processor time.
        holds: "hard", or "soft" for holds of weight 100 against goals of weight 1: programs then have a solution where
            hard tasks contradict each other or what keeps pairs apart.

    Raises:
        MissingPackageError: placo is not installed.

    Examples:
        >>> "placo" not in wb.methods.installed_methods() or wb.solve(problem, wb.methods.Placo()).method == "placo"
        True
    """

    name = "placo"
    on_the_way = 1e-3  # m, rad
    tolerance: Tolerance = 1e-5
    iterations: Iterations = 200
    time_limit: TimeLimit = None
    holds: Literal["hard", "soft"] = "hard"

    def _check_terms(self, problem: Problem) -> None:
        check_terms(problem)

    def _unseen(self, problem: Problem) -> tuple[str, ...]:
        """See `Descends._unseen`: reach cones and ranges of motion, which people have by default."""
        return unseen(problem, lambda term: isinstance(term, Balance))

    def prepare(self, problem: Problem) -> None:
        """Build placo's robot for a problem; `solve` does it if this was not called."""
        check_problem(problem, "Placo.prepare: problem")
        with problem.borrow() as workspace, problem.scene.built.pool(_RobotCache, _RobotCache).borrow() as cache:
            cache.robot(problem, workspace, self.pairs(problem))

    def pairs(self, problem: Problem) -> Indices:
        """Numbers (pairs,) of the scene's pairs that placo is given: all of them."""
        check_problem(problem, "Placo.pairs: problem")
        return np.arange(len(problem.clearances))

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`."""
        with problem.scene.built.pool(_RobotCache, _RobotCache).borrow() as cache:
            robot = cache.robot(problem, workspace, self.pairs(problem))
            stepper = _Programs(problem, robot, self.tolerance, HOLDS[self.holds])
            # of the measures' weight from one iteration to the next; less ends sooner and with more effort
            settings = Settings(self.tolerance, self.iterations, STEP, 0.75)
            run = Iteration(problem, workspace, stepper, settings, control)
            run.go()
        if BUDGET.over:  # a frame that was cut off: its programs hold to first order only
            run.q = held(problem, workspace.state, run.q, self.tolerance)
        failure = f"placo gave up at program {run.steps} ({run.failure})" if run.failure else ""
        return Ending(run.q, run.converged, run.steps, tuple(run.trace), f"in {run.steps} programs", failure=failure)


class _RobotCache:
    """Keeps the robot of one solve for the next solve on the same scene, which may have a similar problem."""

    def __init__(self) -> None:
        self._robot: Robot | None = None

    def robot(self, problem: Problem, workspace: Workspace, pairs: Indices) -> Robot:
        """The robot for some pairs of a problem, with the placements of things in the workspace."""
        check_terms(problem)
        frames = named_frames(problem)
        if self._robot is None or not self._robot.serves(problem, frames, pairs):
            self._robot = Robot(problem.scene.figure, frames)
            self._robot.add_pieces(problem, pairs)
        self._robot.place_objects(settled(workspace.model, workspace.geometry, problem.start))
        return self._robot


class _Programs:
    """placo's programs for one problem."""

    def __init__(self, problem: Problem, robot: Robot, tolerance: float, holding: float) -> None:
        import placo

        self._robot, self._state = robot, State(problem.scene.model)
        self._solver: Any = placo.KinematicsSolver(robot.wrapper)
        robot.couple(self._solver)
        self._tasks, self._holding = add_terms(self._solver, robot, problem), holding
        self._regular = self._solver.add_regularization_task(REGULAR * MEASURES)
        self._solver.dt = 1.0
        robot.limit_steps(STEP)
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(True)
        apart = self._solver.add_avoid_self_collisions_constraint()
        # without it, rounding makes a held foot on a floor infeasible
        # share of the tolerance by which pairs may be nearer than their clearance
        apart.self_collisions_margin = -SWELL - 0.4 * tolerance
        apart.self_collisions_trigger = NEAR - SWELL
        apart.configure("apart", "hard", 1.0)

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """Displacement (nv,) by one program; see `wholebody.methods.differential.Stepper`."""
        self._tasks.move(self._state.update(q), weight)
        self._regular.set_weight(damping)
        try:
            return self._solved(self._holding)
        except StepError:
            if self._holding:
                raise
            return self._solved(HOLDS["soft"])

    def _solved(self, holding: float) -> Array:
        self._tasks.hold(holding)
        try:
            with TOOL:
                theirs = self._solver.solve(False)
        except RuntimeError as error:
            raise StepError(" ".join(str(error).split())) from None
        return self._robot.displacement(theirs)
