"""pink: tasks, limits and SelfCollisionBarrier on our own Pinocchio model."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY
from wholebody.bench.suite.adapters.loop import Loop, Stepper, TaskStepper, TaskTool, kept_apart, longest_moves, size
from wholebody.geometry.flesh import settled
from wholebody.problem import Problem
from wholebody.tasks.frame import PlacementResidual
from wholebody.tasks.inputs import Place

NEAREST = 20  # pairs that its barrier looks at; it gets slower with more


class Pink(Loop):
    """Steps of pink."""

    name = "pink"
    longest = 0.025  # the most solved of 0.0125 to 0.1 on a seed that no comparison uses
    margin = 3.5e-4
    loose = (*((tolerance, FEASIBILITY_ONLY) for tolerance in (1e-2, 1e-3, 1e-4)), *Loop.loose)

    def __init__(self, tolerance: float, iterations: int | None = None) -> None:
        """Take a budget; feasibility only has pink's default gain of leaving a safe displacement, here no motion."""
        safe = iterations == FEASIBILITY_ONLY
        super().__init__(tolerance, None if safe else iterations)
        self.safe = float(safe)  # faster, and of more effort

    def build(self, problem: Problem) -> Stepper:
        """Copy our models."""
        return _PinkStepper(problem, self)


class _PinkStepper(TaskStepper):
    def __init__(self, problem: Problem, loop: Pink) -> None:
        import pink

        super().__init__(problem, pink)
        self._safe, self._out, figure = loop.safe, loop.out, problem.scene.figure
        self._model = model = figure.model.copy()  # pink hangs attributes onto it
        for goal in problem.goals:
            if isinstance(goal, wb.Point):
                self._offset_frame(goal)
        model.velocityLimit = longest_moves(figure, loop.longest)
        if figure.root == "free":
            _bound_root(model, loop.longest * size(figure), loop.longest)
        self._data = model.createData()
        self._least = problem.clearance + loop.margin * size(figure)
        self._geometry, self._pieces = _geometry(problem, self._least)

    def begin(self, room: float) -> None:
        """Place the pieces, and make the tasks anew."""
        scene = self._problem.scene
        ours = settled(scene.model, scene.geometry, self._problem.start).geometryObjects
        for number, (piece, shift) in enumerate(self._pieces):
            self._geometry.geometryObjects[number].placement = ours[piece].placement * shift
        self._room = room
        super().begin(room)

    def _keeping(self, held: list[PlacementResidual], frozen: set[int]) -> dict[str, Any]:
        from pink.barriers import SelfCollisionBarrier

        hard = [self._placement(residual, 1.0) for residual in held]
        if frozen:
            hard.append(
                self._joints(self._problem.start, np.isin(np.arange(self._model.nv), list(frozen)).astype(float))
            )
        pairs, barriers = len(self._geometry.collisionPairs), []
        if pairs:
            # All that is free of a gap may be used up in one iteration: with less, held feet cannot come back.
            gain = self._out if self._room else 1.0
            least = self._least + self._room
            barriers.append(
                SelfCollisionBarrier(min(NEAREST, pairs), gain=gain, safe_displacement_gain=self._safe, d_min=least)
            )
        return {"barriers": barriers, "constraints": hard, "safety_break": False}

    def _configured(self, q: Array) -> Any:
        pieces = self._geometry if len(self._geometry.collisionPairs) else None
        return self._package.Configuration(self._model, self._data, q, copy_data=False, collision_model=pieces)

    def _named(self, place: Place, offset: Array | None = None) -> tuple[str, ...]:
        name = self._model.frames[place.frame].name
        return (name if offset is None else f"{name} at {offset.tolist()}",)

    def _joints(self, reference: Array, cost: Array) -> Any:
        dofs = np.flatnonzero(cost > 0.0)
        rows, zeros = np.eye(self._model.nv)[dofs], np.zeros(len(dofs))
        return self._tasks.LinearHolonomicTask(rows, zeros, np.array(reference), cost=cost[dofs])

    def _at(self, turned: pin.SE3, place: Array) -> Any:
        return pin.SE3(turned.rotation, place)

    def _target(self, residual: PlacementResidual) -> Any:
        return residual.placement

    def _offset_frame(self, goal: wb.Point) -> None:
        (name,), model = self._named(goal.place, goal.resolved_offset), self._model
        if not model.existFrame(name):
            frame = model.frames[goal.place.frame]
            there = frame.placement * pin.SE3(np.eye(3), goal.resolved_offset)
            model.addFrame(pin.Frame(name, frame.parentJoint, goal.place.frame, there, pin.FrameType.OP_FRAME))


def _bound_root(model: Any, speed: float, turn: float) -> None:
    from pink.limits import FloatingBaseVelocityLimit

    model.floating_base_velocity_limit = FloatingBaseVelocityLimit(model, None, speed, turn)


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
        if not resting or surface:
            lower = least - clearance if resting else 0.0
            made.addCollisionPair(pin.CollisionPair(piece(first, 0.0), piece(second, lower)))
    return made, pieces


class PinkTool(TaskTool):
    """pink along a reach."""

    name = "pink"

    def __init__(self, track: Track) -> None:
        import pink
        from pink.barriers import SelfCollisionBarrier

        self._package = pink
        self._model = track.scene.model.copy()
        self._geometry = settled(self._model, track.scene.geometry, track.start)
        self._model.velocityLimit = np.full(self._model.nv, SETTING.joint_speed)
        if track.floating:
            _bound_root(self._model, SETTING.root_speed, SETTING.root_turn)
        self.begin(track)
        pairs = min(NEAREST, track.pairs)
        # Half of what is free of a gap may be used up in one step.
        barrier = SelfCollisionBarrier(pairs, gain=0.5 / SETTING.dt, d_min=track.clearance) if pairs else None
        self._kept = {"barriers": [barrier] if pairs else [], "constraints": self._feet, "safety_break": False}

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        data = self._model.createData()
        self._configuration = self._package.Configuration(
            self._model, data, np.array(q), collision_model=self._geometry
        )
        self.failures = 0

    def _posture_task(self) -> Any:
        return self._package.tasks.PostureTask(cost=SETTING.posture_cost)

    def _there(self, target: Array) -> Any:
        return pin.SE3(np.eye(3), target)

    def posture(self) -> Array:
        """Where it is."""
        return np.array(self._configuration.q)
