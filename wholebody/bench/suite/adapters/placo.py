"""placo: our method of that name, and `KinematicsSolver`; it knows collisions of a robot with itself only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array, Indices, Mask
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import Tool
from wholebody.bench.suite.adapters.urdf import own_frame
from wholebody.geometry.flesh import settled
from wholebody.methods.placo.method import Placo
from wholebody.methods.placo.robot import Robot
from wholebody.problem import Problem
from wholebody.scene.geometry_model import SceneGeometry


@dataclass(frozen=True)
class PrunedPlaco(Placo):
    """placo without the pairs of a figure with itself that do not come near: what its users prune in a robot's file."""

    def pairs(self, problem: Problem) -> Indices:
        """Numbers of the scene's pairs that placo is given: those that come near, and all with things."""
        return _kept(problem.scene.figure, problem.scene.built)


class PlacoTool(Tool):
    """One `solve(True)` and `update_kinematics()` a step."""

    name = "placo"

    def __init__(self, track: Track) -> None:
        import placo

        figure, scene = track.scene.figure, settled(track.scene.model, track.scene.geometry, track.start)
        self._robot = Robot(figure, {name: own_frame(figure, name) for name in (track.tip, *track.feet)})
        wrapper = self._robot.wrapper
        pieces = wrapper.collision_model
        for piece in scene.geometryObjects:
            there = self._robot.joint(piece.parentJoint)
            pieces.addGeometryObject(pin.GeometryObject(piece.name, there, piece.placement, piece.geometry))
        for first, second in self.pairs(track):
            pieces.addCollisionPair(pin.CollisionPair(first, second))
        wrapper.set_velocity_limits(SETTING.joint_speed)
        self.reset(track.start)

        self._solver = placo.KinematicsSolver(wrapper)
        self._solver.mask_fbase(not track.floating)
        self._robot.couple(self._solver)
        self._solver.dt = SETTING.dt
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(True)
        self._reach = self._solver.add_position_task(track.tip, np.array(track.targets[0]))
        self._reach.configure("reach", "soft", 1.0)
        for foot in track.feet:
            task = self._solver.add_frame_task(foot, wrapper.get_T_world_frame(foot))
            task.configure(foot, "hard", 1.0, 1.0)
        posture = self._solver.add_joints_task()
        values = figure.joint_values(track.start)
        posture.set_joints({self._robot.joint_name(figure.joint_id(name)): value for name, value in values.items()})
        posture.configure("posture", "soft", SETTING.posture_cost**2)
        self._solver.add_regularization_task(SETTING.posture_cost**2)
        if track.pairs:
            apart = self._solver.add_avoid_self_collisions_constraint()
            apart.self_collisions_margin, apart.self_collisions_trigger = track.clearance, SETTING.within
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

    def pairs(self, track: Track) -> Sequence[tuple[int, int]]:
        """The pairs that come near."""
        return near_pairs(track.scene, track.start.tobytes())

    def remarks(self) -> dict[str, float]:
        """How many pairs it has."""
        return {"pairs": float(len(self._robot.wrapper.collision_model.collisionPairs))}


@lru_cache(maxsize=4)
def near_pairs(scene: wb.Scene, start: bytes) -> Sequence[tuple[int, int]]:
    """Pairs of pieces nearer than `SETTING.within` in one of 2000 postures about that of the bytes `start`."""
    found = _sampled(scene, np.frombuffer(start), 2000, SETTING.within)
    pairs = [(pair.first, pair.second) for pair in scene.geometry.collisionPairs]
    return [pair for pair, near in zip(pairs, found, strict=True) if near]


def _sampled(scene: wb.Scene, q: Array, samples: int, within: float) -> Mask:
    """Which pairs (pairs,) come nearer than `within` metres in random postures, the root near its place in q (nq,)."""
    rng, model = np.random.default_rng(0), scene.model
    limits, found = scene.figure.limits, np.zeros(len(scene.geometry.collisionPairs), dtype=bool)
    workspace = scene.workspace()
    for _ in range(samples):
        move = np.zeros(model.nv)
        if scene.figure.root == "free":
            move[:6] = rng.normal(size=6) * (0.15, 0.15, 0.1, 0.2, 0.2, 0.2)  # m, rad
        posture = np.asarray(pin.integrate(model, q, move))
        posture[limits.idx_q] = rng.uniform(limits.lower, limits.upper)
        found[workspace.near(posture, within).number] = True
    return found


@lru_cache(maxsize=8)
def _apart(figure: wb.Figure) -> frozenset[tuple[str, str]]:
    """Names of the pieces of a figure that do not come near each other in random postures, in pairs."""
    alone = wb.Scene(figure)
    # As many samples as MoveIt's setup assistant takes by default; 1 cm is more than clearances are, and the assistant
    # leaves out what never collides.
    near = _sampled(alone, figure.neutral, 10_000, 0.01)
    return frozenset(name for name, found in zip(_named(alone.built), near, strict=True) if not found)


@lru_cache(maxsize=4)
def _kept(figure: wb.Figure, built: SceneGeometry) -> Indices:
    apart = _apart(figure)
    return np.array([number for number, pair in enumerate(_named(built)) if pair not in apart], dtype=np.intp)


def _named(built: SceneGeometry) -> list[tuple[str, str]]:
    pieces = built.geometry.geometryObjects
    return [(pieces[pair.first].name, pieces[pair.second].name) for pair in built.geometry.collisionPairs]
