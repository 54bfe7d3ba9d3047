"""embodik: `KinematicsSolver.solve_position_step` on a URDF made from ours, set up as its own examples are."""

from __future__ import annotations

from collections import Counter
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.files import Scratch
from wholebody.bench.suite.adapters.base import LADDER, few
from wholebody.bench.suite.adapters.loop import Loop, Stepper, kept_apart, placements, posture_costs, size
from wholebody.bench.suite.adapters.urdf import Frames, joint_name, piece_name, write_urdf
from wholebody.methods.base import named_terms
from wholebody.methods.differential import TOOL, StepError
from wholebody.problem import Problem


class Embodik(Loop):
    """Steps of embodik."""

    name = "embodik"
    loose = (*few(10, 20, 50), *LADDER)
    longest = 1.0  # it bounds its steps itself, by the joints' limits of speed
    kinds: ClassVar[tuple[type, ...]] = (
        wb.Displacement, wb.Effort, wb.Frame, wb.Freeze, wb.Orientation, wb.Point,
    )  # fmt: skip

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        """Take a budget."""
        # Near a goal, a step makes up for a tenth of the residual.
        super().__init__(tolerance, 1000 if iterations is None else iterations)

    def build(self, problem: Problem) -> Stepper:
        """Write and read the model."""
        return _EmbodikStepper(problem)

    def unsupported(self, problem: Problem) -> list[str]:
        """What embodik cannot express."""
        refused = [where for where, term in named_terms(problem) if not isinstance(term, self.kinds)]
        free = problem.scene.figure.root == "free"
        return [*refused, "a free root (its URDF reader hangs all things on the root)"] if free else refused


class _EmbodikStepper:
    def __init__(self, problem: Problem) -> None:
        self._problem, self._model = problem, problem.scene.model
        self._frames = Frames()
        for goal in problem.goals:
            self._frame(goal)
        self._read()

    def begin(self, room: float) -> None:
        """Make the solver anew, since it keeps a memory of its steps, and the model where objects moved."""
        import embodik

        if not np.array_equal(placements(self._problem), self._placed):
            self._read()
        problem = self._problem
        self._solver = solver = embodik.KinematicsSolver(self._robot)
        solver.dt = 0.01  # s: its examples' time step
        solver.set_damping(0.1)  # its examples'
        solver.set_tolerance(0.1)
        self._options, self._targets = embodik.PositionStepOptions(), list[Any]()
        for goal in problem.goals:
            self._goal(goal)
        for cost in posture_costs(problem)[-1:]:
            task = solver.add_posture_task("posture")
            # The weight is that of its examples; the posture task ranks below the goals.
            task.priority, task.weight, task.solve_mode = 1, 1e-2, embodik.TaskSolveMode.MIN_ERROR
            task.set_target_configuration(self._theirs(cost.reference))
            task.set_joint_weights(self._spread(cost.weights))
        options = self._options
        options.max_steps = 1
        # Its examples' largest factor on the time step, and m of error from which it grows.
        options.adaptive_dt, options.adaptive_dt_max_scale, options.adaptive_dt_reference_distance = True, 10.0, 0.02
        options.primary_solve_mode = embodik.TaskSolveMode.SCALE_ELASTIC
        options.primary_allow_min_error_fallback = True
        frozen = {dof for bound in problem.bounds if isinstance(bound, wb.Freeze)
                  for dof in problem.scene.figure.dofs(bound.joints).tolist()}  # fmt: skip
        options.locked_joint_indices = [int(self._dof[dof]) for dof in sorted(frozen)]
        self._keep_apart(room)

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """One `solve_position_step`; further ones while nothing moves."""
        import embodik

        del weight, damping  # its posture task ranks below the goals, and its damping is its own
        theirs = self._theirs(q)
        for _ in range(5):  # calls without motion before it counts as at rest: its joint limits give way after three
            self._options.continuity_command_revision += 1  # a new command: it holds still 0.3 mm from an old one
            with TOOL:
                answer = self._solver.solve_position_step(theirs, self._targets, self._options)
            moved = np.asarray(answer.q_solution, dtype=float)
            if not np.isfinite(moved).all():
                raise StepError("a posture that is not a number")
            if not np.array_equal(moved, theirs):
                break
        status = embodik.SolverStatus
        if answer.status in (status.INVALID_INPUT, status.NON_FINITE_INPUT, status.SHAPE_MISMATCH):
            raise StepError(f"{answer.status.name}: {answer.status_message}")
        return np.asarray(pin.difference(self._model, q, self._ours(moved)))

    def _read(self) -> None:
        import embodik

        with Scratch() as folder:
            self._robot = embodik.RobotModel(str(write_urdf(self._problem.scene, self._frames, folder)))
        self._placed, model, robot = placements(self._problem), self._model, self._robot
        self._index, self._dof = np.arange(model.nq), np.arange(model.nv)
        for number in range(1, model.njoints):
            joint, name = model.joints[number], joint_name(number)
            self._index[joint.idx_q : joint.idx_q + joint.nq] = robot.get_joint_config_index(name) + np.arange(joint.nq)
            self._dof[joint.idx_v] = robot.get_joint_velocity_index(name)

    def _keep_apart(self, room: float) -> None:
        """State the pairs: one least distance, and others for the pairs that have another."""
        problem, pieces = self._problem, self._problem.scene.geometry.geometryObjects
        asked: dict[tuple[str, str], float] = {}
        for pair in kept_apart(problem, Embodik.margin * size(problem.scene.figure), held=False):
            moves = not (pieces[pair.first].parentJoint and pieces[pair.second].parentJoint)
            names = piece_name(pair.first), piece_name(pair.second)
            asked[names] = pair.clearance + max(pair.margin, room if moves else 0.0)
        if not asked:
            return
        usual = Counter(asked.values()).most_common(1)[0][0]
        self._solver.configure_collision_constraint(
            min_distance=usual, include_pairs=[(f"{first}_0", f"{second}_0") for first, second in asked],
            # The most collision rows that its documentation recommends.
            nearest_points_all_pairs=False, max_constraints=5,
        )  # fmt: skip
        for (first, second), distance in asked.items():
            if distance != usual:
                self._solver.set_collision_pair_min_distance(first, second, distance, activate_when_clear=False)

    def _theirs(self, q: Array) -> Array:
        """Posture in embodik's order, from ours (nq,)."""
        there = np.empty(len(q))
        there[self._index] = q
        return there

    def _ours(self, there: Array) -> Array:
        """Our posture (nq,) from embodik's."""
        q: Array = there[self._index]
        return q

    def _spread(self, ours: Array) -> Array:
        """Values (nv,) by degree of freedom, in embodik's order."""
        theirs = np.empty(len(ours))
        theirs[self._dof] = ours
        return theirs

    def _frame(self, goal: Any) -> str:
        """Name of the link of a goal's frame, or of a point in it; noted, so that the model gets it."""
        if isinstance(goal, wb.Point):
            return self._frames.named(self._model, goal.place, goal.resolved_offset)
        return self._frames.named(self._model, goal.residual.place)

    def _goal(self, goal: Any) -> None:
        import embodik

        kinds = embodik.TaskType
        if isinstance(goal, wb.Point):
            kind, target = kinds.FRAME_POSITION, pin.SE3(np.eye(3), goal.resolved_target)
        else:
            target = goal.residual.placement
            kind = kinds.FRAME_POSE if goal.residual.position else kinds.FRAME_ORIENTATION
        name = f"goal {len(self._targets)}"
        task = self._solver.add_frame_task(name, self._frame(goal), kind)
        task.priority, task.weight, task.solve_mode = 0, 1.0, embodik.TaskSolveMode.SCALE_ELASTIC
        gain = 10.0  # 1/s: its examples', for positions and orientations
        self._targets.append(embodik.TaskTarget(name, target.homogeneous, gain, gain))
