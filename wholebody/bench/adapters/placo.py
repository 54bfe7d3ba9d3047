"""placo: our method of that name, and `KinematicsSolver` with its documented tasks for a reach.

In a reach, feet and the self-collision constraint are hard tasks. placo knows collisions of a robot with itself only.
The objects are added to its collision model, fixed to the world; it then treats them as parts of the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
from typing import ClassVar

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.adapters.base import LADDER, POSTURE_COST, REACH_COST, Adapter, Tool, few, made
from wholebody.bench.track import DT, JOINT_SPEED, WITHIN, Track
from wholebody.methods.placo.robot import Robot

SAMPLES = 2000
ROOT_SPREAD = np.array([0.15, 0.15, 0.1, 0.2, 0.2, 0.2])  # m, rad


def placo_adapter(holds: str = "hard") -> Adapter:
    """The adapter to placo's kinematics solver, with holds as hard tasks or as soft ones."""
    said = "holds and" if holds == "hard" else "holds soft with weight 100,"
    return Adapter(
        name="placo" if holds == "hard" else f"placo/{holds}",
        make=partial(made, partial(wb.Placo, holds=holds), {}),
        prepare=wb.Placo.prepare,
        loose=(*few(5, 10, 20), *LADDER),
        setup=f"wb.Placo(holds={holds!r}), all else as it comes: goals as soft tasks, {said} the self-collision "
        "constraint hard, joint limits, at most 0.1 rad or m a program, joints tasks for the measures with a weight "
        "that fades; one start, at most 200 programs. The objects are added to its collision model, with the clearance "
        "of each pair. Building its robot is set-up.",
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

        figure, scene = track.scene.figure, track.scene.geometry
        self._robot = Robot(figure, {name: _place(figure, name) for name in (track.tip, *track.feet)})
        wrapper = self._robot.wrapper
        pieces = wrapper.collision_model
        for piece in scene.geometryObjects:
            there = self._robot.joint(piece.parentJoint)
            pieces.addGeometryObject(pin.GeometryObject(piece.name, there, piece.placement, piece.geometry))
        for first, second in self.pairs(track):
            pieces.addCollisionPair(pin.CollisionPair(first, second))
        wrapper.set_velocity_limits(JOINT_SPEED)
        self.reset(track.start)

        self._solver = placo.KinematicsSolver(wrapper)
        self._solver.mask_fbase(not track.floating)
        self._robot.couple(self._solver)
        self._solver.dt = DT
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(True)
        self._reach = self._solver.add_position_task(track.tip, np.array(track.targets[0]))
        self._reach.configure("reach", "soft", REACH_COST**2)
        for foot in track.feet:
            task = self._solver.add_frame_task(foot, wrapper.get_T_world_frame(foot))
            task.configure(foot, "hard", 1.0, 1.0)
        posture = self._solver.add_joints_task()
        values = figure.joint_values(track.start)
        posture.set_joints({self._robot.joint_name(figure.joint_id(name)): value for name, value in values.items()})
        posture.configure("posture", "soft", POSTURE_COST**2)
        self._solver.add_regularization_task(POSTURE_COST**2)
        if track.pairs:
            apart = self._solver.add_avoid_self_collisions_constraint()
            apart.self_collisions_margin, apart.self_collisions_trigger = track.clearance, WITHIN
            apart.configure("apart", "hard", 1.0)

    def pairs(self, track: Track) -> Sequence[tuple[int, int]]:
        """The pairs of pieces that it is given: all of the scene."""
        return [(pair.first, pair.second) for pair in track.scene.geometry.collisionPairs]

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._robot.move(q)
        self.failures = 0

    def step(self, target: Array) -> None:
        """Move one step."""
        self._reach.target_world = target
        try:
            self._solver.solve(True)
        except RuntimeError:  # no solution of its program
            self.failures += 1
        self._robot.wrapper.update_kinematics()

    def posture(self) -> Array:
        """Where it is."""
        return self._robot.posture()


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
        return {"pairs": float(len(self._robot.wrapper.collision_model.collisionPairs))}


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
        if scene.figure.root == "free":
            move[:6] = rng.normal(size=6) * ROOT_SPREAD
        posture = np.asarray(pin.integrate(model, q, move))
        posture[limits.idx_q] = rng.uniform(limits.lower, limits.upper)
        found[workspace.near(posture, WITHIN).number] = True
    pairs = [(pair.first, pair.second) for pair in scene.geometry.collisionPairs]
    return [pair for pair, near in zip(pairs, found, strict=True) if near]


def _place(figure: wb.Figure, name: str) -> tuple[int, pin.SE3]:
    """Joint of a frame, and its placement in it."""
    frame = figure.model.frames[figure.frame_id(name)]
    return int(frame.parentJoint), frame.placement
