"""placo: our method of that name, and `KinematicsSolver` with its documented tasks for a reach.

In a reach, feet and the self-collision constraint are hard tasks. placo knows collisions of a robot with itself only.
The objects are added to its collision model, fixed to the world; it then treats them as parts of the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.adapters.base import LADDER, POSTURE_COST, REACH_COST, Adapter, Tool, few, made
from wholebody.bench.track import CLEARANCE, DT, JOINT_SPEED, WITHIN, Track
from wholebody.figures.packaged_urdf import urdf_path

SAMPLES = 2000
ROOT_SPREAD = np.array([0.15, 0.15, 0.1, 0.2, 0.2, 0.2])  # m, rad


def placo_adapter() -> Adapter:
    """The adapter to placo's kinematics solver."""
    return Adapter(
        name="placo",
        make=partial(made, wb.Placo, {}),
        prepare=wb.Placo.prepare,
        loose=(*few(5, 10, 20), *LADDER),
        setup="wb.Placo(), all else as it comes: goals as soft tasks, holds and the self-collision constraint hard, "
        "joint limits, at most 0.05 rad or m a program, joints tasks for the measures with a weight that fades; one "
        "start, at most 200 programs. The objects are added to its collision model, with the clearance of each pair. "
        "Building its robot is set-up.",
        differences=(
            "placo has no class for objects in the world: they are added to its collision model as parts of the robot",
            "placo minimises Effort and Displacement only",
            "placo has no reach cones, no half-spaces for frames and no axis toward a place",
            "placo has one row a pair, between the two nearest points",
            "placo finds no solution where hard tasks repeat each other, as in a redundant closed loop",
        ),
    )


class PlacoTool(Tool):
    """One `solve(True)` and `update_kinematics()` a step."""

    name = "placo"
    differences: ClassVar[tuple[str, ...]] = (
        "placo has no bound on the speed of a floating base",
        "placo has no class for objects in the world: they are added to its collision model as parts of the robot",
    )

    def __init__(self, track: Track) -> None:
        """Set the solver up."""
        import placo

        self._robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, _without_collisions())
        model, ours = self._robot.model, track.scene.model
        assert list(model.names) == list(ours.names)
        pieces, scene = self._robot.collision_model, track.scene.geometry
        for piece in scene.geometryObjects:
            pieces.addGeometryObject(pin.GeometryObject(piece.name, piece.parentJoint, piece.placement, piece.geometry))
        for first, second in self.pairs(track):
            pieces.addCollisionPair(pin.CollisionPair(first, second))
        self._robot.set_velocity_limits(JOINT_SPEED)
        self.reset(track.start)

        self._solver = placo.KinematicsSolver(self._robot)
        self._solver.dt = DT
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(True)
        self._reach = self._solver.add_position_task(track.tip, np.array(track.targets[0]))
        self._reach.configure("reach", "soft", REACH_COST**2)
        for foot in track.feet:
            task = self._solver.add_frame_task(foot, self._robot.get_T_world_frame(foot))
            task.configure(foot, "hard", 1.0, 1.0)
        posture = self._solver.add_joints_task()
        posture.set_joints(track.scene.figure.joint_values(track.start))
        posture.configure("posture", "soft", POSTURE_COST**2)
        self._solver.add_regularization_task(POSTURE_COST**2)
        apart = self._solver.add_avoid_self_collisions_constraint()
        apart.self_collisions_margin, apart.self_collisions_trigger = CLEARANCE, WITHIN
        apart.configure("apart", "hard", 1.0)

    def pairs(self, track: Track) -> Sequence[tuple[int, int]]:
        """The pairs of pieces that it is given: all of the scene."""
        return [(pair.first, pair.second) for pair in track.scene.geometry.collisionPairs]

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._robot.state.q = np.array(q)
        self._robot.update_kinematics()
        self.failures = 0

    def step(self, target: Array) -> None:
        """Move one step."""
        self._reach.target_world = target
        try:
            self._solver.solve(True)
        except RuntimeError:  # no solution of its program
            self.failures += 1
        self._robot.update_kinematics()

    def posture(self) -> Array:
        """Where it is: placo orders the joints as we do."""
        return np.array(self._robot.state.q)


class PrunedPlacoTool(PlacoTool):
    """The same with the pairs that a careful user would leave: those that sampled postures bring near."""

    name = "placo/pruned"
    differences: ClassVar[tuple[str, ...]] = (
        f"placo/pruned has only the pairs that come nearer than {1e3 * WITHIN:g} mm in one of {SAMPLES} sampled "
        "postures, joints anywhere within their limits and the root near where it stands; the sampling is not timed, "
        "and pairs that it left out are not kept apart",
    )

    def pairs(self, track: Track) -> Sequence[tuple[int, int]]:
        """The pairs that come near."""
        return near_pairs(track.scene, track.start.tobytes())

    def remarks(self) -> dict[str, float]:
        """How many pairs it has."""
        return {"pairs": float(len(self._robot.collision_model.collisionPairs))}


@lru_cache(maxsize=4)
def near_pairs(scene: wb.Scene, start: bytes) -> Sequence[tuple[int, int]]:
    """Pairs of pieces that come nearer than `WITHIN` in sampled postures.

    Args:
        scene: whose pairs.
        start: (nq,) posture about which the root is sampled, as bytes.
    """
    rng, q, model = np.random.default_rng(0), np.frombuffer(start), scene.model
    limits, found = scene.figure.limits, np.zeros(len(scene.geometry.collisionPairs), dtype=bool)
    workspace = scene.workspace()
    for _ in range(SAMPLES):
        move = np.zeros(model.nv)
        move[:6] = rng.normal(size=6) * ROOT_SPREAD
        posture = np.asarray(pin.integrate(model, q, move))
        posture[limits.idx_q] = rng.uniform(limits.lower, limits.upper)
        found[workspace.near(posture, WITHIN).number] = True
    pairs = [(pair.first, pair.second) for pair in scene.geometry.collisionPairs]
    return [pair for pair, near in zip(pairs, found, strict=True) if near]


def _without_collisions() -> str:
    robot = ElementTree.parse(urdf_path("human")).getroot()
    for link in robot.findall("link"):
        for shape in (*link.findall("collision"), *link.findall("visual")):
            link.remove(shape)
    return ElementTree.tostring(robot, encoding="unicode")
