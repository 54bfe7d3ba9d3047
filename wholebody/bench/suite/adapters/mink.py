"""mink: `solve_ik` with its tasks and limits on a MuJoCo model made from ours; the QPs are solved by DAQP.

To solve a problem it is iterated; a reach is followed with one call a step.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import LADDER, Adapter, Tool, few
from wholebody.bench.suite.adapters.loop import (
    Loop,
    Stepper,
    kept_apart,
    longest_moves,
    placements,
    posture_costs,
    size,
)
from wholebody.bench.suite.adapters.urdf import Frames, mjcf, own_frame
from wholebody.figures.figure import Figure
from wholebody.methods.differential import TOOL, StepError
from wholebody.problem import Problem
from wholebody.tasks.inputs import Place
from wholebody.tasks.residuals import PlacementResidual


def mink_adapter() -> Adapter:
    """The kinematics of mink in our loop, with holds as heavy soft tasks."""
    return Adapter("mink", MinkLoop, (*few(5, 10, 20), *LADDER), MinkLoop.prepare)


class MinkLoop(Loop):
    """Steps of mink."""

    name = "mink"
    kinds = (*Loop.kinds, wb.Axis)
    near: ClassVar[float] = 0.1  # of the size of a figure: pairs nearer than this have a row
    gain: ClassVar[float] = 0.85  # share of what is free of a gap that may be used up in one step: mink's default

    def build(self, problem: Problem) -> Stepper:
        """Write the model."""
        return _MinkStepper(problem, type(self))


class _MinkStepper:
    def __init__(self, problem: Problem, loop: type[MinkLoop]) -> None:
        self._problem, self._loop, self._longest = problem, loop, loop.longest
        self._sites = Frames()
        self._room = 0.0
        for term in (*problem.goals, *problem.constraints):
            if isinstance(term, wb.Point):
                self._site(term.place, term.resolved_offset)
            elif isinstance(term, wb.Axis):
                self._site(term.place)
            elif isinstance(term, (wb.Frame, wb.Orientation, wb.Relative, wb.Hold)):
                self._site(term.residual.place)
                self._site(term.residual.base)
        self._compile()

    def begin(self, room: float) -> None:
        """Make the tasks anew, and the model where objects moved since it was made."""
        import mink

        problem, scene = self._problem, self._problem.scene
        if room != self._room or not np.array_equal(placements(self._problem), self._placed):
            self._room = room
            self._compile()
        model = self._mujoco
        self._points: list[tuple[Any, str, Array]] = []
        self._tasks = [self._goal(goal) for goal in problem.goals]
        held = [term.residual for term in problem.constraints if isinstance(term, wb.Hold)]
        self._tasks += [self._placement(residual, 10.0) for residual in held]  # where goals cost 1
        self._hard: list[Any] = []
        frozen = [bound for bound in problem.bounds if isinstance(bound, wb.Freeze)]
        if frozen:
            dofs = {self._dof[dof] for bound in frozen for dof in scene.figure.dofs(bound.joints).tolist()}
            self._hard.append(mink.DofFreezingTask(model, sorted(dofs)))
        self._measures = []
        for posture in posture_costs(problem):
            self._measures.append((self._joints(posture.reference), self._spread(np.sqrt(posture.weights))))

    def step(self, q: Array, weight: float, damping: float) -> Array:
        """One `solve_ik`, with a time step of one second."""
        import mink

        configuration, theirs = self._configuration, self._order.theirs(q)
        with TOOL:
            configuration.update(theirs)
        for task, site, place in self._points:
            turn = configuration.get_transform_frame_to_world(site, "site").rotation()
            task.set_target(mink.SE3.from_rotation_and_translation(turn, place))
        for task, share in self._measures:
            task.set_cost(weight**0.5 * share)
        try:
            with TOOL:
                velocity = mink.solve_ik(
                    configuration, [*self._tasks, *(task for task, _ in self._measures)], 1.0, solver="daqp",
                    damping=damping, limits=self._limits, constraints=self._hard or None,
                )  # fmt: skip
        except mink.NoSolutionFound as error:
            raise StepError(f"{type(error).__name__}: its program has no solution") from None
        return np.asarray(velocity, dtype=float)[self._dof]

    def _compile(self) -> None:
        import mink
        import mujoco

        self._mujoco = mujoco.MjModel.from_xml_string(mjcf(self._problem.scene, self._sites))
        self._configuration = mink.Configuration(self._mujoco)
        self._limits, self._placed = self._made_limits(), placements(self._problem)

    def _site(self, place: Place, offset: Array | None = None) -> str:
        return self._sites.named(self._problem.scene.model, place, offset)

    def _made_limits(self) -> list[Any]:
        import mink

        problem, model = self._problem, self._mujoco
        figure = problem.scene.figure
        self._order = _Order(figure, model)
        self._dof = self._order.dof
        most, reach = longest_moves(figure, self._longest), size(figure)
        limits = [
            mink.ConfigurationLimit(model, gain=1.0),
            mink.VelocityLimit(model, {name: float(most[figure.dofs([name])[0]]) for name in figure.joints}),
        ]
        if figure.root == "free":
            limits.append(
                mink.FreeJointVelocityLimit(model, self._longest * reach, self._longest, joint_name="root_joint")
            )
        names = [piece.name for piece in problem.scene.geometry.geometryObjects]
        pieces = problem.scene.geometry.geometryObjects
        groups: dict[tuple[float, float], list[Any]] = {}
        for pair in kept_apart(problem, self._loop.margin * reach, held=False):
            room = 0.0 if pieces[pair.first].parentJoint and pieces[pair.second].parentJoint else self._room
            asked = pair.clearance + max(pair.margin, room), room
            groups.setdefault(asked, []).append(([names[pair.first]], [names[pair.second]]))
        for (clearance, room), pairs in groups.items():
            apart = mink.CollisionAvoidanceLimit(
                model,
                pairs,
                gain=self._loop.gain,
                minimum_distance_from_collisions=clearance,
                collision_detection_distance=clearance + self._loop.near * reach,
                bound_relaxation=-self._loop.out * room,  # without it, a pair that is nearer than it may be stays so
            )
            limits.append(apart)
        return limits

    def _spread(self, ours: Array) -> Array:
        """Values (nv,) by degree of freedom, in MuJoCo's order."""
        theirs = np.zeros(self._mujoco.nv)
        theirs[self._dof] = ours
        return theirs

    def _goal(self, goal: Any) -> Any:
        import mink

        cost = goal.weight**0.5
        if isinstance(goal, wb.Point):
            site = self._site(goal.place, goal.resolved_offset)
            task = mink.FrameTask(site, "site", position_cost=cost, orientation_cost=0.0)
            self._points.append((task, site, np.array(goal.resolved_target)))
        elif isinstance(goal, wb.Axis):
            kind = mink.AxisAlignTask if goal.toward is None else mink.LookAtTask
            task = kind(self._site(goal.place), "site", axis=np.array(goal.basis[2]), cost=cost)
            task.set_target(np.array(goal.resolved_target))
        elif isinstance(goal, wb.CenterOfMass):
            task = mink.ComTask(cost=np.array([cost, cost, cost if goal.axes == "xyz" else 0.0]))
            task.set_target(np.array((*goal.resolved_target, 0.0)[:3]))
        elif isinstance(goal, wb.Posture):
            task = self._joints(goal.resolved_target)
            costs = np.zeros(self._mujoco.nv)
            costs[self._dof[np.asarray(goal.dofs)]] = cost
            task.set_cost(costs)
        else:
            task = self._placement(goal.residual, cost)
        return task

    def _placement(self, residual: PlacementResidual, cost: float) -> Any:
        import mink

        costs = {"position_cost": cost * residual.position, "orientation_cost": cost * residual.orientation}
        target = mink.SE3.from_matrix(residual.placement.homogeneous)
        site = self._site(residual.place)
        if residual.base.frame:
            task = mink.RelativeFrameTask(site, "site", self._site(residual.base), "site", **costs)
        else:
            task = mink.FrameTask(site, "site", **costs)
        task.set_target(target)
        return task

    def _joints(self, reference: Array) -> Any:
        import mink

        task = mink.PostureTask(self._mujoco, cost=0.0)
        task.set_target(self._order.theirs(reference))
        return task


class _Order:
    """Postures and degrees of freedom in the order of MuJoCo's model.

    Attributes:
        dof: (nv,) MuJoCo's place of each of ours.
    """

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


class MinkTool(Tool):
    """One `solve_ik` and `integrate_inplace` a step."""

    name = "mink"

    def __init__(self, track: Track) -> None:
        """Set the model and the tasks up."""
        import mink
        import mujoco

        self._mink = mink
        figure = track.scene.figure
        sites = {name: own_frame(figure, name) for name in (track.tip, *track.feet)}
        model = self._mujoco_model = mujoco.MjModel.from_xml_string(mjcf(track.scene, sites))
        self._order = _Order(figure, model)
        self.reset(track.start)
        self._reach = self._task(track.tip, 1.0, 0.0)
        posture = mink.PostureTask(model, cost=SETTING.posture_cost)
        posture.set_target(self._configuration.q)
        self._tasks = [self._reach, posture]
        self._feet = [self._task(foot, 1.0, 1.0) for foot in track.feet]
        for task in self._feet:
            task.set_target_from_configuration(self._configuration)
        geometry = track.scene.geometry
        names = [piece.name for piece in geometry.geometryObjects]
        apart = mink.CollisionAvoidanceLimit(
            model,
            [([names[pair.first]], [names[pair.second]]) for pair in geometry.collisionPairs],
            gain=0.5 * SETTING.dt,  # half of what is free of a gap may be used up in one step of a reach
            minimum_distance_from_collisions=track.clearance,
            collision_detection_distance=SETTING.within,
        )
        self.pairs = len(apart.geom_id_pairs)
        self._limits = [
            mink.ConfigurationLimit(model),
            mink.VelocityLimit(model, dict.fromkeys(figure.joints, SETTING.joint_speed)),
            apart,
        ]
        if track.floating:
            self._limits.append(
                mink.FreeJointVelocityLimit(model, SETTING.root_speed, SETTING.root_turn, joint_name="root_joint")
            )

    def _task(self, frame: str, position: float, orientation: float) -> Any:
        return self._mink.FrameTask(frame, "site", position_cost=position, orientation_cost=orientation)

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._configuration = self._mink.Configuration(self._mujoco_model, q=self._order.theirs(q))
        self.failures = 0

    def step(self, target: Array) -> None:
        """Move one step."""
        self._reach.set_target(self._mink.SE3.from_translation(target))
        try:
            velocity = self._mink.solve_ik(
                self._configuration, self._tasks, SETTING.dt, solver="daqp", damping=SETTING.posture_cost**2,
                limits=self._limits, constraints=self._feet or None,
            )  # fmt: skip
        except self._mink.NoSolutionFound:
            self.failures += 1
            return
        self._configuration.integrate_inplace(velocity, SETTING.dt)

    def posture(self) -> Array:
        """Where it is."""
        return self._order.ours(self._configuration.q)

    def remarks(self) -> dict[str, float]:
        """How many pairs it looks at."""
        return {"pairs": float(self.pairs)}
