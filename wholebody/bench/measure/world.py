"""`wholebody bench world`: things that are dropped, slid and stacked in three engines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import util
from typing import Any

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.rows import Row, measured_ms
from wholebody.bench.suite.problem_sets.things import coal_distance
from wholebody.bench.tables import render

DENSITY = 700.0  # kg/m3
GRAVITY = 9.81  # m/s2


@dataclass(frozen=True)
class Drop:
    """Boxes and balls above a floor at z = 0, on which wood slides on wood (table 1 of Schmidl and Lin).

    `sizes`: full lengths (3,) of a box, or the radius (1,) of a ball; `places` (n, 3) of the centres [m]; `velocity`
    (3,) of all at the start; `frame` and `seconds`: of a frame and of the whole.
    """

    name: str
    sizes: tuple[tuple[float, ...], ...]
    places: Array
    velocity: tuple[float, float, float]
    frame: float
    seconds: float
    friction: float = 0.3
    restitution: float = 0.3

    @property
    def masses(self) -> Array:
        """(n,) kg."""
        volumes = [size[0] ** 3 * 4.0 / 3.0 * np.pi if len(size) == 1 else np.prod(size) for size in self.sizes]
        return DENSITY * np.array(volumes)

    @property
    def inertias(self) -> Array:
        """(n, 3) about the centres, kg m2."""
        found = np.zeros((len(self.sizes), 3))
        for k, (size, mass) in enumerate(zip(self.sizes, self.masses, strict=True)):
            square = np.array(size) ** 2
            found[k] = 0.4 * mass * square[0] if len(size) == 1 else mass / 12.0 * (square.sum() - square)
        return found

    def shapes(self) -> list[wb.Shape]:
        """The shape of each thing."""
        return [wb.Sphere(size[0]) if len(size) == 1 else wb.Box((size[0], size[1], size[2])) for size in self.sizes]


def drops() -> tuple[Drop, ...]:
    """All cases."""
    slide = Drop("slide", ((0.2, 0.2, 0.1),), np.array([[0.0, 0.0, 0.0501]]), (2.0, 0.0, 0.0), 1 / 60, 1.5)
    return (ball(), slide, stack(10), grid("27 balls", 3), grid("216 balls", 6), pile(20, 1 / 60), pile(100, 1 / 30))


def ball() -> Drop:
    """A ball that falls from a metre and bounces."""
    return Drop("ball", ((0.05,),), np.array([[0.0, 0.0, 1.0]]), (0.0, 0.0, 0.0), 1 / 60, 3.0)


def stack(count: int) -> Drop:
    """Boxes upon each other."""
    places = np.array([[0.0, 0.0, 0.1 + 0.2001 * k + 1e-4] for k in range(count)])
    return Drop(f"stack of {count}", ((0.2, 0.2, 0.2),) * count, places, (0.0, 0.0, 0.0), 1 / 60, 4.0)


def grid(name: str, side: int) -> Drop:
    """A cube of balls that falls apart (SimBenchmark's "666" for six on a side)."""
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places = 0.12 * cells + (0.0, 0.0, 0.2) + 0.002 * cells[:, 2:] * (0.5, 1.0, 0.0)
    return Drop(name, ((0.05,),) * len(cells), places, (0.0, 0.0, 0.0), 1 / 60, 2.0)


def pile(count: int, frame: float) -> Drop:
    """Boxes that fall into a heap."""
    rng = np.random.default_rng(0)
    cells = np.array([(k % 4, k // 4 % 4, k // 16) for k in range(count)])
    places = 0.3 * cells + (0.0, 0.0, 0.2)
    places[:, :2] += 0.05 * rng.random((count, 2))
    return Drop(f"heap of {count} boxes", ((0.2, 0.15, 0.1),) * count, places, (0.0, 0.0, 0.0), frame, 3.0)


class _Own:
    """wholebody.

    Every engine advances by `frame`; `state` has positions with quaternions x, y, z, w (n, 7), and velocities, angular
    ones along the world's axes too (n, 6).
    """

    def __init__(self, drop: Drop) -> None:
        from wholebody.dynamics.rigid_bodies import RigidBodies

        scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor")
        self.names = [f"thing {k}" for k in range(len(drop.sizes))]
        away = np.array([20.0, 0.0, 0.0])
        for name, shape, place in zip(self.names, drop.shapes(), drop.places, strict=True):
            body = wb.Body(DENSITY, velocity=drop.velocity)
            scene.add(shape, name=name, at=place + away, body=body)
        self._engine, self._time, self._away = RigidBodies(scene), drop.frame, away

    def frame(self) -> None:
        self._engine.advance(self._time)

    def state(self) -> tuple[Array, Array]:
        poses = [pin.SE3ToXYZQUAT(self._engine.placement(name)) for name in self.names]
        velocities = [self._engine.twist(name) for name in self.names]
        return np.array(poses) - np.append(self._away, np.zeros(4)), np.array(velocities)


class _Mujoco:
    """MuJoCo with its default contacts, which are soft and know no restitution, in steps of 1/480 s."""

    def __init__(self, drop: Drop) -> None:
        import mujoco

        things = list(zip(drop.sizes, drop.places.tolist(), strict=True))
        text = render("drop.xml", drop=drop, things=things, dt=1.0 / 480.0, gravity=GRAVITY, density=DENSITY)
        self._mujoco: Any = mujoco
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        self._data.qvel.reshape(-1, 6)[:, :3] = drop.velocity
        self._steps = round(480.0 * drop.frame)

    def frame(self) -> None:
        for _ in range(self._steps):
            self._mujoco.mj_step(self._model, self._data)

    def state(self) -> tuple[Array, Array]:
        # MuJoCo's angular velocities are those of the body's axes.
        q, v = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6).copy()
        poses = np.column_stack([q[:, :3], q[:, 4:], q[:, 3]])
        for k, pose in enumerate(poses):
            v[k, 3:] = pin.XYZQUATToSE3(pose).rotation @ v[k, 3:]
        return poses, v


class _Rapier:
    """Rapier with its defaults, in steps of a frame."""

    def __init__(self, drop: Drop) -> None:
        import rapier3d

        surface = {"friction": drop.friction, "restitution": drop.restitution, "density": DENSITY}
        self._world = rapier3d.PhysicsWorld(gravity=(0.0, 0.0, -GRAVITY))
        self._world.integration_parameters.dt = drop.frame
        self._world.add_collider(rapier3d.Collider.cuboid(50.0, 50.0, 1.0, translation=(0.0, 0.0, -1.0), **surface))
        self._bodies = []
        for size, place in zip(drop.sizes, drop.places, strict=True):
            if len(size) == 1:
                shape = rapier3d.Collider.ball(size[0], **surface)
            else:
                shape = rapier3d.Collider.cuboid(*(0.5 * x for x in size), **surface)
            body = rapier3d.RigidBody.dynamic(translation=tuple(map(float, place)), linvel=drop.velocity)
            self._bodies.append(self._world.add_body(body, colliders=[shape]))

    def frame(self) -> None:
        self._world.step()

    def state(self) -> tuple[Array, Array]:
        poses, velocities = [], []
        for handle in self._bodies:
            body = self._world.rigid_bodies[handle]
            at, turned, v, w = body.translation, body.rotation, body.linvel, body.angvel
            poses.append([at.x, at.y, at.z, turned.i, turned.j, turned.k, turned.w])
            velocities.append([v.x, v.y, v.z, w.x, w.y, w.z])
        return np.array(poses), np.array(velocities)


ENGINES: Mapping[str, Callable[[Drop], Any]] = {"wholebody": _Own, "mujoco": _Mujoco, "rapier": _Rapier}
"""All engines by name."""


def installed(names: Sequence[str]) -> list[str]:
    """Those of the engines whose package is installed."""
    packages = {"mujoco": "mujoco", "rapier": "rapier3d"}
    return [name for name in names if name not in packages or util.find_spec(packages[name])]


def measure(drop: Drop, engine: str, frames: int | None = None) -> Row:
    """Run a drop in an engine, and judge the end of every frame by coal; `frames`: fewer than the drop has."""
    world = ENGINES[engine](drop)
    count = round(drop.seconds / drop.frame) if frames is None else frames
    judge, spent = Judge(drop), []
    depths, energies = [0.0], [judge.energy(*world.state())]
    for _ in range(count):
        spent.append(measured_ms(world.frame)[0])
        poses, velocities = world.state()
        depths.append(judge.deepest(poses))
        energies.append(judge.energy(poses, velocities))
    start = energies[0]
    return Row(
        drop.name,
        engine,
        {
            "things": len(drop.sizes),
            "frames": count,
            "median ms": float(np.median(spent)),
            "p99 ms": float(np.quantile(spent, 0.99)),
            "a frame ms": 1e3 * drop.frame,
            "deepest mm": 1e3 * max(depths),
            "largest gain of energy": float(np.diff(energies).max()) / start,
            "energy left": energies[-1] / start,
        },
    )


class Judge:
    """Depths and energies of a drop, whatever engine moved it."""

    def __init__(self, drop: Drop) -> None:
        self._shapes = [shape.pieces()[0].geometry for shape in drop.shapes()]
        self._reach = np.array([np.linalg.norm(size) * (1.0 if len(size) == 1 else 0.5) for size in drop.sizes])
        self._masses, self._inertias = drop.masses, drop.inertias
        self._floor = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    def energy(self, poses: Array, velocities: Array) -> float:
        """Kinetic and potential energy, joules."""
        total = float((self._masses * (0.5 * (velocities[:, :3] ** 2).sum(axis=1) + GRAVITY * poses[:, 2])).sum())
        for pose, spin, inertia in zip(poses, velocities[:, 3:], self._inertias, strict=True):
            total += 0.5 * float((inertia * (pin.XYZQUATToSE3(pose).rotation.T @ spin) ** 2).sum())
        return total

    def deepest(self, poses: Array) -> float:
        """Greatest depth of two things, or of one and the floor, metres; 0 if there is none."""
        placed = [pin.XYZQUATToSE3(pose) for pose in poses]
        depth = 0.0
        for k in np.flatnonzero(poses[:, 2] < self._reach):
            depth = max(depth, -coal_distance(self._floor, pin.SE3.Identity(), self._shapes[k], placed[k]))
        apart = np.linalg.norm(poses[:, None, :3] - poses[None, :, :3], axis=2)
        for i, j in np.argwhere(np.triu(apart < self._reach[:, None] + self._reach[None], 1)):
            depth = max(depth, -coal_distance(self._shapes[i], placed[i], self._shapes[j], placed[j]))
        return depth
