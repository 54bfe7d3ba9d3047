"""Engines that drop things: each places them at the start and advances a frame at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.world.drops import DENSITY, FRICTION, GRAVITY, RESTITUTION, Drop

MUJOCO_STEP = 1.0 / 480.0  # s: its own default is 2 ms
FLOOR = 50.0  # m


class Engine(Protocol):
    """One drop in one engine."""

    def frame(self) -> None:
        """Advance by a frame."""

    def state(self) -> tuple[Array, Array]:
        """Positions with quaternions x, y, z, w (n, 7); velocities, angular ones along the world's axes too (n, 6)."""


class Own:
    """wholebody."""

    def __init__(self, drop: Drop) -> None:
        """Put everything into a scene, far from a hand."""
        from wholebody.dynamics.rigid_bodies import RigidBodies

        scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor")
        self.names = [f"thing {k}" for k in range(len(drop.sizes))]
        away = np.array([20.0, 0.0, 0.0])
        for name, shape, place in zip(self.names, drop.shapes(), drop.places, strict=True):
            body = wb.Body(DENSITY, velocity=drop.velocity)
            scene.add(shape, name=name, at=place + away, body=body)
        self._engine, self._time, self._away = RigidBodies(scene), drop.frame, away

    def frame(self) -> None:
        """Advance by a frame."""
        self._engine.advance(self._time)

    def state(self) -> tuple[Array, Array]:
        """Poses and velocities; see `Engine`."""
        poses = [pin.SE3ToXYZQUAT(self._engine.placement(name)) for name in self.names]
        velocities = [self._engine.twist(name) for name in self.names]
        return np.array(poses) - np.append(self._away, np.zeros(4)), np.array(velocities)


class Mujoco:
    """MuJoCo with its default contacts, which are soft and know no restitution, in steps of 1/480 s."""

    def __init__(self, drop: Drop) -> None:
        """Write a model and read it."""
        import mujoco

        bodies = []
        for size, place in zip(drop.sizes, drop.places, strict=True):
            kind = "sphere" if len(size) == 1 else "box"
            half = " ".join(str(x if len(size) == 1 else 0.5 * x) for x in size)
            at = " ".join(map(str, place))
            bodies.append(
                f'<body pos="{at}"><freejoint/><geom type="{kind}" size="{half}" density="{DENSITY}"/></body>'
            )
        text = (
            f'<mujoco><option timestep="{MUJOCO_STEP}" gravity="0 0 {-GRAVITY}" cone="elliptic"/>'
            f'<default><geom friction="{FRICTION} 0 0" condim="3"/></default><worldbody>'
            f'<geom type="plane" size="{FLOOR} {FLOOR} 1"/>{"".join(bodies)}</worldbody></mujoco>'
        )
        self._mujoco: Any = mujoco
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        self._data.qvel.reshape(-1, 6)[:, :3] = drop.velocity
        self._steps = round(drop.frame / MUJOCO_STEP)

    def frame(self) -> None:
        """Advance by a frame."""
        for _ in range(self._steps):
            self._mujoco.mj_step(self._model, self._data)

    def state(self) -> tuple[Array, Array]:
        """Poses and velocities; see `Engine`. MuJoCo's angular velocities are those of the body's axes."""
        q, v = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6).copy()
        poses = np.column_stack([q[:, :3], q[:, 4:], q[:, 3]])
        for k, pose in enumerate(poses):
            v[k, 3:] = pin.XYZQUATToSE3(pose).rotation @ v[k, 3:]
        return poses, v


class Rapier:
    """Rapier with its defaults, in steps of a frame."""

    def __init__(self, drop: Drop) -> None:
        """Put everything into a world."""
        import rapier3d

        surface = {"friction": FRICTION, "restitution": RESTITUTION, "density": DENSITY}
        self._world = rapier3d.PhysicsWorld(gravity=(0.0, 0.0, -GRAVITY))
        self._world.integration_parameters.dt = drop.frame
        self._world.add_collider(rapier3d.Collider.cuboid(FLOOR, FLOOR, 1.0, translation=(0.0, 0.0, -1.0), **surface))
        self._bodies = []
        for size, place in zip(drop.sizes, drop.places, strict=True):
            if len(size) == 1:
                shape = rapier3d.Collider.ball(size[0], **surface)
            else:
                shape = rapier3d.Collider.cuboid(*(0.5 * x for x in size), **surface)
            body = rapier3d.RigidBody.dynamic(translation=tuple(map(float, place)), linvel=drop.velocity)
            self._bodies.append(self._world.add_body(body, colliders=[shape]))

    def frame(self) -> None:
        """Advance by a frame."""
        self._world.step()

    def state(self) -> tuple[Array, Array]:
        """Poses and velocities; see `Engine`."""
        poses, velocities = [], []
        for handle in self._bodies:
            body = self._world.rigid_bodies[handle]
            at, turned, v, w = body.translation, body.rotation, body.linvel, body.angvel
            poses.append([at.x, at.y, at.z, turned.i, turned.j, turned.k, turned.w])
            velocities.append([v.x, v.y, v.z, w.x, w.y, w.z])
        return np.array(poses), np.array(velocities)


ENGINES: Mapping[str, Callable[[Drop], Engine]] = {"wholebody": Own, "mujoco": Mujoco, "rapier": Rapier}
"""All engines by name."""
