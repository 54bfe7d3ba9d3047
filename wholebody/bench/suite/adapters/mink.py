"""mink: tasks and limits on a MuJoCo model made from ours."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.loop import (
    Loop,
    Stepper,
    TaskStepper,
    TaskTool,
    kept_apart,
    longest_moves,
    placements,
    size,
)
from wholebody.bench.suite.adapters.urdf import Frames, mjcf, own_frame
from wholebody.figures.figure import Figure
from wholebody.problem import Problem
from wholebody.tasks.frame import PlacementResidual
from wholebody.tasks.inputs import Place


class Mink(Loop):
    """Steps of mink, with holds as heavy soft tasks."""

    name = "mink"
    longest = 0.2  # this and the margin: the most solved of five settings on a seed that no comparison uses
    margin = 2.3e-4
    kinds = (*Loop.kinds, wb.Axis)
    near: ClassVar[float] = 0.1  # of the size of a figure: pairs nearer than this have a row
    gain: ClassVar[float] = 0.85  # share of what is free of a gap that may be used up in one step: mink's default

    def build(self, problem: Problem) -> Stepper:
        """Write the model."""
        return _MinkStepper(problem, type(self))


class _MinkStepper(TaskStepper):
    def __init__(self, problem: Problem, loop: type[Mink]) -> None:
        import mink

        super().__init__(problem, mink)
        self._loop, self._room, self._sites = loop, 0.0, Frames()
        for term in (*problem.goals, *problem.constraints):
            if isinstance(term, wb.Point):
                self._named(term.place, term.resolved_offset)
            elif isinstance(term, wb.Axis):
                self._named(term.place)
            elif isinstance(term, (wb.Frame, wb.Orientation, wb.Relative, wb.Hold)):
                self._named(term.residual.place)
                self._named(term.residual.base)
        self._compile()

    def begin(self, room: float) -> None:
        """Make the tasks anew, and the model where objects moved since it was made."""
        if room != self._room or not np.array_equal(placements(self._problem), self._placed):
            self._room = room
            self._compile()
        super().begin(room)

    def _keeping(self, held: list[PlacementResidual], frozen: set[int]) -> dict[str, Any]:
        self._soft += [self._placement(residual, 10.0) for residual in held]  # where goals cost 1
        dofs = sorted(self._order.dof[dof] for dof in frozen)
        hard = [self._package.DofFreezingTask(self._mujoco, dofs)] if frozen else None
        return {"limits": self._limits, "constraints": hard}

    def _configured(self, q: Array) -> Any:
        self._configuration.update(self._order.theirs(q))
        return self._configuration

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """One `solve_ik`, in our order of the degrees of freedom."""
        return np.asarray(super().step(q, weight, damping)[self._order.dof])

    def _named(self, place: Place, offset: Array | None = None) -> tuple[str, ...]:
        return self._sites.named(self._problem.scene.model, place, offset), "site"

    def _joints(self, reference: Array, cost: Array) -> Any:
        theirs = np.zeros(self._mujoco.nv)
        theirs[self._order.dof] = cost
        task = self._package.PostureTask(self._mujoco, cost=theirs)
        task.set_target(self._order.theirs(reference))
        return task

    def _at(self, turned: Any, place: Array) -> Any:
        return self._package.SE3.from_rotation_and_translation(turned.rotation(), place)

    def _target(self, residual: PlacementResidual) -> Any:
        return self._package.SE3.from_matrix(residual.placement.homogeneous)

    def _goal(self, goal: Any) -> Any:
        if not isinstance(goal, wb.Axis):
            return super()._goal(goal)
        kind = self._package.AxisAlignTask if goal.toward is None else self._package.LookAtTask
        task = kind(*self._named(goal.place), axis=np.array(goal.basis[2]), cost=goal.weight**0.5)
        task.set_target(np.array(goal.resolved_target))
        return task

    def _compile(self) -> None:
        import mujoco

        self._mujoco = mujoco.MjModel.from_xml_string(mjcf(self._problem.scene, self._sites))
        self._configuration = self._package.Configuration(self._mujoco)
        self._limits, self._placed = self._made_limits(), placements(self._problem)

    def _made_limits(self) -> list[Any]:
        mink, problem, model, loop = self._package, self._problem, self._mujoco, self._loop
        figure = problem.scene.figure
        self._order = Order(figure, model)
        most, reach = longest_moves(figure, loop.longest), size(figure)
        speeds = {name: float(most[figure.dofs([name])[0]]) for name in figure.joints}
        limits = [mink.ConfigurationLimit(model, gain=1.0), mink.VelocityLimit(model, speeds)]
        if figure.root == "free":
            limits.append(_root_limit(mink, model, loop.longest * reach, loop.longest))
        pieces = problem.scene.geometry.geometryObjects
        groups: dict[tuple[float, float], list[Any]] = {}
        for pair in kept_apart(problem, loop.margin * reach, held=False):
            first, second = pieces[pair.first], pieces[pair.second]
            room = 0.0 if first.parentJoint and second.parentJoint else self._room
            asked = pair.clearance + max(pair.margin, room), room
            groups.setdefault(asked, []).append(([first.name], [second.name]))
        for (clearance, room), pairs in groups.items():
            apart = mink.CollisionAvoidanceLimit(
                model, pairs, gain=loop.gain, minimum_distance_from_collisions=clearance,
                collision_detection_distance=clearance + loop.near * reach,
                bound_relaxation=-loop.out * room,  # without it, a pair that is nearer than it may be stays so
            )  # fmt: skip
            limits.append(apart)
        return limits


def _root_limit(mink: Any, model: Any, speed: float, turn: float) -> Any:
    return mink.FreeJointVelocityLimit(model, speed, turn, joint_name="root_joint")


class Order:
    """Postures in the order of MuJoCo's model, and its place `dof` (nv,) of each of our degrees of freedom."""

    def __init__(self, figure: Figure, model: Any) -> None:
        self._size, self._free = (figure.model.nq, model.nq), figure.root == "free"
        pairs = [(model.joint(name), figure.model.joints[figure.joint_id(name)]) for name in figure.joints]
        self._addresses = [(int(theirs.qposadr[0]), ours) for theirs, ours in pairs]
        self.dof = np.arange(figure.model.nv)
        for theirs, ours in pairs:
            self.dof[ours.idx_v] = int(theirs.dofadr[0])

    def theirs(self, q: Array) -> Array:
        """Posture in MuJoCo's order, from ours (nq,)."""
        there = np.zeros(self._size[1])
        if self._free:
            there[:3], there[3], there[4:7] = q[:3], q[6], q[3:6]
        for address, joint in self._addresses:
            part = q[joint.idx_q : joint.idx_q + joint.nq]
            there[address] = part[0] if joint.nq == 1 else np.arctan2(part[1], part[0])
        return there

    def ours(self, there: Array) -> Array:
        """Our posture (nq,) from MuJoCo's."""
        q = np.empty(self._size[0])
        if self._free:
            q[:3], q[3:6], q[6] = there[:3], there[4:7], there[3]
        for address, joint in self._addresses:
            angle = there[address]
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        return q


class MinkTool(TaskTool):
    """mink along a reach."""

    name = "mink"
    _kind = ("site",)

    def __init__(self, track: Track) -> None:
        import mink
        import mujoco

        self._package = mink
        figure, pieces = track.scene.figure, track.scene.geometry.geometryObjects
        sites = {name: own_frame(figure, name) for name in (track.tip, *track.feet)}
        model = self._mujoco = mujoco.MjModel.from_xml_string(mjcf(track.scene, sites))
        self._order = Order(figure, model)
        self.begin(track)
        apart = mink.CollisionAvoidanceLimit(
            model,
            [([pieces[pair.first].name], [pieces[pair.second].name]) for pair in track.scene.geometry.collisionPairs],
            gain=0.5 * SETTING.dt,  # half of what is free of a gap may be used up in one step of a reach
            minimum_distance_from_collisions=track.clearance,
            collision_detection_distance=SETTING.within,
        )
        self._pairs = len(apart.geom_id_pairs)
        speeds = mink.VelocityLimit(model, dict.fromkeys(figure.joints, SETTING.joint_speed))
        limits = [mink.ConfigurationLimit(model), speeds, apart]
        if track.floating:
            limits.append(_root_limit(mink, model, SETTING.root_speed, SETTING.root_turn))
        self._kept = {"limits": limits, "constraints": self._feet or None}

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._configuration = self._package.Configuration(self._mujoco, q=self._order.theirs(q))
        self.failures = 0

    def _posture_task(self) -> Any:
        return self._package.tasks.PostureTask(self._mujoco, cost=SETTING.posture_cost)

    def _there(self, target: Array) -> Any:
        return self._package.SE3.from_translation(target)

    def posture(self) -> Array:
        """Where it is."""
        return self._order.ours(self._configuration.q)

    def remarks(self) -> dict[str, float]:
        """How many pairs it looks at."""
        return {"pairs": float(self._pairs)}
