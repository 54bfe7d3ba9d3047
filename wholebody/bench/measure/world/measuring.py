"""One drop in one engine: what is measured, the same way for all."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import util

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.measure.world.drops import GRAVITY, Drop
from wholebody.bench.measure.world.engines import ENGINES
from wholebody.bench.suite.problem_sets.things import coal_distance

PACKAGES = {"mujoco": "mujoco", "rapier": "rapier3d"}


@dataclass(frozen=True)
class DropRow:
    """One drop in one engine.

    Attributes:
        drop, engine: what was asked.
        things: that move.
        frames: of the run.
        median_ms, p99_ms: processor time of a frame.
        frame_ms: time that a frame stands for.
        deepest_mm: of any two things, or of a thing and the floor, at the end of any frame, by coal.
        grew: largest gain of kinetic and potential energy in a frame, in parts of the energy at the start.
        left: the energy at the end, likewise; above that of things that lie at z = 0.
    """

    drop: str
    engine: str
    things: int
    frames: int
    median_ms: float
    p99_ms: float
    frame_ms: float
    deepest_mm: float
    grew: float
    left: float


def installed(names: Sequence[str]) -> list[str]:
    """Those of the engines whose package is installed."""
    return [name for name in names if name not in PACKAGES or util.find_spec(PACKAGES[name])]


def measure(drop: Drop, engine: str, frames: int | None = None) -> DropRow:
    """Run a drop in an engine, and judge the end of every frame.

    Args:
        drop: the case.
        engine: a name of `ENGINES`.
        frames: fewer than the drop has.
    """
    world = ENGINES[engine](drop)
    count = round(drop.seconds / drop.frame) if frames is None else frames
    judge, times = Judge(drop), []
    depths, energies = [], [judge.energy(*world.state())]
    for _ in range(count):
        began = time.process_time()
        world.frame()
        times.append(time.process_time() - began)
        poses, velocities = world.state()
        depths.append(judge.deepest(poses))
        energies.append(judge.energy(poses, velocities))
    start = energies[0]
    return DropRow(
        drop.name, engine, len(drop.sizes), count, 1e3 * float(np.median(times)),
        1e3 * float(np.quantile(times, 0.99)), 1e3 * drop.frame, 1e3 * max(depths),
        float(np.diff(energies).max()) / start, energies[-1] / start,
    )  # fmt: skip


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
