"""pink: `solve_ik` with its tasks, limits and SelfCollisionBarrier; the QPs are solved by DAQP.

To solve a problem it is iterated; a reach is followed with one call a step.
"""

from __future__ import annotations

from typing import Any, ClassVar

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, LADDER, Adapter, Tool, few
from wholebody.bench.suite.adapters.loop import Loop, Stepper, kept_apart, longest_moves, posture_costs, size
from wholebody.methods.differential import TOOL, StepError
from wholebody.problem import Problem
from wholebody.tasks.residuals import PlacementResidual

NEAREST = 20  # pairs that its barrier looks at; it gets slower with more


def pink_adapter() -> Adapter:
    """The kinematics of pink in our loop."""
    return Adapter(
        name="pink",
        make=_pink,
        prepare=PinkLoop.prepare,
        loose=(*((tolerance, FEASIBILITY_ONLY) for tolerance in (1e-2, 1e-3, 1e-4)), *few(5, 10, 20), *LADDER),
    )


def _pink(tolerance: float, iterations: int | None) -> Loop:
    return SafePinkLoop(tolerance) if iterations == FEASIBILITY_ONLY else PinkLoop(tolerance, iterations)


class PinkLoop(Loop):
    """Steps of pink."""

    name = "pink"
    safe: ClassVar[float] = 0.0  # gain of the barrier's cost of leaving a safe displacement, which here is no motion
    longest = 0.0125  # twice that leaves pink no solution more often
    margin = 3.5e-4

    def build(self, problem: Problem) -> Stepper:
        """Copy our models."""
        return _PinkStepper(problem, type(self))


class SafePinkLoop(PinkLoop):
    """The same with pink's default of that gain: faster, and of more effort."""

    safe = 1.0


class _PinkStepper:
    def __init__(self, problem: Problem, loop: type[PinkLoop]) -> None:
        from pink.limits import FloatingBaseVelocityLimit

        self._problem, self._safe, self._out, figure = problem, loop.safe, loop.out, problem.scene.figure
        longest, margin = loop.longest, loop.margin * size(figure)
        self._model = model = figure.model.copy()  # pink hangs attributes onto it
        for goal in problem.goals:
            if isinstance(goal, wb.Point):
                _offset_frame(model, goal)
        model.velocityLimit = longest_moves(figure, longest)
        if figure.root == "free":
            root = FloatingBaseVelocityLimit(model, None, longest * size(figure), longest)
            model.floating_base_velocity_limit = root
        self._data = model.createData()
        self._least = problem.clearance + margin
        self._geometry, self._pieces = _geometry(problem, self._least)

    def begin(self, room: float) -> None:
        """Make the tasks anew."""
        from pink.barriers import SelfCollisionBarrier

        problem, scene = self._problem, self._problem.scene
        for number, (ours, shift) in enumerate(self._pieces):
            self._geometry.geometryObjects[number].placement = scene.geometry.geometryObjects[ours].placement * shift
        self._points: list[tuple[Any, Array]] = []
        self._tasks = [self._goal(goal) for goal in problem.goals]
        self._hard = [self._placement(term.residual, 1.0) for term in problem.constraints if isinstance(term, wb.Hold)]
        frozen = [figure_dof for bound in problem.bounds if isinstance(bound, wb.Freeze)
                  for figure_dof in scene.figure.dofs(bound.joints).tolist()]  # fmt: skip
        if frozen:
            self._hard.append(self._joints(problem.start, sorted(set(frozen)), np.ones(len(set(frozen)))))
        self._measures = []
        for cost in posture_costs(problem):
            dofs = np.flatnonzero(cost.weights > 0.0)
            self._measures.append((self._joints(cost.reference, dofs, np.ones(len(dofs))), np.sqrt(cost.weights[dofs])))
        pairs = len(self._geometry.collisionPairs)
        self._barriers = (
            [
                SelfCollisionBarrier(
                    min(NEAREST, pairs),
                    # All that is free of a gap may be used up in one iteration: with less, held feet cannot
                    # come back
                    gain=self._out if room else 1.0,
                    safe_displacement_gain=self._safe,
                    d_min=self._least + room,
                )
            ]
            if pairs
            else []
        )

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """One `solve_ik`, with a time step of one second."""
        import pink

        with TOOL:
            configuration = pink.Configuration(
                self._model, self._data, q, copy_data=False, collision_model=self._geometry if self._barriers else None
            )
        for task, place in self._points:
            turn = configuration.get_transform_frame_to_world(task.frame).rotation
            task.set_target(pin.SE3(turn, place))
        for task, share in self._measures:
            task.cost = weight**0.5 * share
        try:
            with TOOL:
                velocity = pink.solve_ik(
                    configuration, [*self._tasks, *(task for task, _ in self._measures)], 1.0, solver="daqp",
                    damping=damping, barriers=self._barriers, constraints=self._hard, safety_break=False,
                )  # fmt: skip
        except pink.exceptions.NoSolutionFound as error:
            raise StepError(f"{type(error).__name__}: its program has no solution") from None
        return np.asarray(velocity, dtype=float)

    def _goal(self, goal: Any) -> Any:
        from pink.tasks import ComTask, FrameTask

        cost = goal.weight**0.5
        if isinstance(goal, wb.Point):
            task = FrameTask(_offset_name(goal), position_cost=cost, orientation_cost=0.0)
            self._points.append((task, np.array(goal.resolved_target)))
            return task
        if isinstance(goal, wb.CenterOfMass):
            task = ComTask(cost=[cost, cost, cost if goal.axes == "xyz" else 0.0])
            task.set_target(np.array((*goal.resolved_target, 0.0)[:3]))
            return task
        if isinstance(goal, wb.Posture):
            dofs = np.asarray(goal.dofs)
            return self._joints(goal.resolved_target, dofs, np.full(len(dofs), cost))
        return self._placement(goal.residual, cost)

    def _placement(self, residual: PlacementResidual, cost: float) -> Any:
        from pink.tasks import FrameTask, RelativeFrameTask

        costs = {"position_cost": cost * residual.position, "orientation_cost": cost * residual.orientation}
        target = residual.placement
        names = [self._model.frames[place.frame].name for place in (residual.place, residual.base)]
        task = RelativeFrameTask(*names, **costs) if residual.base.frame else FrameTask(names[0], **costs)
        task.set_target(target)
        return task

    def _joints(self, reference: Array, dofs: Any, cost: Array) -> Any:
        from pink.tasks import LinearHolonomicTask

        return LinearHolonomicTask(np.eye(self._model.nv)[dofs], np.zeros(len(dofs)), np.array(reference), cost=cost)


def _offset_name(goal: wb.Point) -> str:
    return f"{goal.frame} at {goal.resolved_offset.tolist()}"


def _offset_frame(model: Any, goal: wb.Point) -> None:
    frame = model.frames[goal.place.frame]
    there = frame.placement * pin.SE3(np.eye(3), goal.resolved_offset)
    if not model.existFrame(_offset_name(goal)):
        model.addFrame(
            pin.Frame(_offset_name(goal), frame.parentJoint, goal.place.frame, there, pin.FrameType.OP_FRAME)
        )


def _geometry(problem: Problem, least: float) -> tuple[Any, list[tuple[int, Any]]]:
    """Pieces and pairs for the barrier; of each piece, its number in ours and how it is shifted against that."""
    ours, made = problem.scene.geometry, pin.GeometryModel()
    pieces: list[tuple[int, Any]] = []
    known: dict[tuple[int, float], int] = {}

    def piece(number: int, lower: float) -> int:
        if (number, lower) not in known:
            theirs = pin.GeometryObject(ours.geometryObjects[number])
            shift = pin.SE3.Identity()
            if lower:
                shift.translation = -lower * np.array(theirs.geometry.n)
            theirs.name = f"{theirs.name} {lower!r}"
            known[number, lower] = made.addGeometryObject(theirs)
            pieces.append((number, shift))
        return known[number, lower]

    for first, second, clearance, _ in kept_apart(problem, 0.0):
        surface = isinstance(ours.geometryObjects[second].geometry, coal.Halfspace)
        resting = clearance < problem.clearance or (problem.clearance == 0.0 and surface)
        if not resting:
            made.addCollisionPair(pin.CollisionPair(piece(first, 0.0), piece(second, 0.0)))
        elif surface:
            made.addCollisionPair(pin.CollisionPair(piece(first, 0.0), piece(second, least - clearance)))
    return made, pieces


class PinkTool(Tool):
    """One `solve_ik` and `integrate_inplace` a step."""

    name = "pink"

    def __init__(self, track: Track) -> None:
        """Set the tasks up."""
        import pink
        from pink.barriers import SelfCollisionBarrier
        from pink.limits import FloatingBaseVelocityLimit
        from pink.tasks import FrameTask, PostureTask

        self._pink, self._scene = pink, track.scene
        self._model = track.scene.model.copy()
        self._model.velocityLimit = np.full(self._model.nv, SETTING.joint_speed)
        if track.floating:
            root = FloatingBaseVelocityLimit(self._model, None, SETTING.root_speed, SETTING.root_turn)
            self._model.floating_base_velocity_limit = root
        self._solvers_failure = pink.exceptions.NoSolutionFound
        self.reset(track.start)
        self._reach = FrameTask(track.tip, position_cost=1.0, orientation_cost=0.0)
        self._at = pin.SE3.Identity()
        posture = PostureTask(cost=SETTING.posture_cost)
        posture.set_target(track.start)
        self._tasks = [self._reach, posture]
        self._feet = [FrameTask(foot, position_cost=1.0, orientation_cost=1.0) for foot in track.feet]
        for task in self._feet:
            task.set_target_from_configuration(self._configuration)
        pairs = min(NEAREST, track.pairs)
        # Half of what is free of a gap may be used up in one step.
        self._barriers = (
            [SelfCollisionBarrier(n_collision_pairs=pairs, gain=0.5 / SETTING.dt, d_min=track.clearance)]
            if pairs
            else []
        )

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._configuration = self._pink.Configuration(
            self._model, self._model.createData(), np.array(q), collision_model=self._scene.geometry
        )
        self.failures = 0

    def step(self, target: Array) -> None:
        """Move one step."""
        self._at.translation = target
        self._reach.set_target(self._at)
        try:
            velocity = self._pink.solve_ik(
                self._configuration, self._tasks, SETTING.dt, solver="daqp", damping=SETTING.posture_cost**2,
                barriers=self._barriers, constraints=self._feet, safety_break=False,
            )  # fmt: skip
        except self._solvers_failure:
            self.failures += 1
            return
        self._configuration.integrate_inplace(velocity, SETTING.dt)

    def posture(self) -> Array:
        """Where it is."""
        return np.array(self._configuration.q)
