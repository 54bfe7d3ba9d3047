"""Dominoes, stacks and balls in a pen for minutes: is anything lost, does anything that lies drift, is anything NaN?"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.dynamics.rigid_bodies import RigidBodies

DT = 1.0 / 60.0
PEN = 1.5  # m: half the side
WALL = 0.6  # m: height
EVERY = 10.0  # s: after which one of the balls is kicked
KICK = 2.0  # m/s
AWAY = np.array([20.0, 0.0, 0.0])  # from the hand that a scene needs
BALLS, STACK, DOMINOES, PILLAR = 6, 5, 8, 4


@dataclass(frozen=True)
class LongRow:
    """One long run.

    Attributes:
        minutes: simulated.
        things: that move.
        cpu_seconds: of the processor.
        median_ms, p99_ms: of a frame.
        impacts: in all.
        deepest_mm: after any step.
        grew_joule: largest gain of energy in a frame without a kick.
        drift_mm: of the stack that nothing can reach, from where it lay after the first ten seconds.
        outside: things that left the pen, or are not finite.
        asleep: bodies that sleep at the end.
    """

    minutes: float
    things: int
    cpu_seconds: float
    median_ms: float
    p99_ms: float
    impacts: int
    deepest_mm: float
    grew_joule: float
    drift_mm: float
    outside: int
    asleep: int


def long_run(minutes: float, seed: int = 0, progress: Callable[[float], None] | None = None) -> LongRow:
    """Run it; `progress` is called with the simulated minutes, after each."""
    engine, names, pillar = _engine(seed)
    rng = np.random.default_rng(seed)
    frames, kicks = round(60.0 * minutes / DT), round(EVERY / DT)
    times, impacts, deepest, grew, energy = [], 0, 0.0, 0.0, engine.energy()
    lay: Array | None = None
    made = None
    for number in range(frames):
        if number % kicks == kicks - 1:
            _kick(engine, f"ball {rng.integers(BALLS)}", rng)
            energy = engine.energy()
        began = time.process_time()
        made = engine.advance(DT)
        times.append(time.process_time() - began)
        impacts, deepest = impacts + len(made.events), max(deepest, made.deepest)
        grew, energy = max(grew, made.energy - energy), made.energy
        if number == kicks:
            lay = _places(engine, pillar)
        if progress is not None and (number + 1) % 3600 == 0:
            progress((number + 1) * DT / 60.0)
    end = _places(engine, names) - AWAY
    inside = (np.abs(end[:, :2]) < PEN).all(axis=1) & (end[:, 2] > 0.0) & (end[:, 2] < 3.0)
    drift = 0.0 if lay is None else float(np.linalg.norm(_places(engine, pillar) - lay, axis=1).max())
    return LongRow(
        minutes, len(names), sum(times), 1e3 * float(np.median(times)), 1e3 * float(np.quantile(times, 0.99)), impacts,
        1e3 * deepest, grew, 1e3 * drift, int((~inside).sum()), made.sleeping if made else 0,
    )  # fmt: skip


def _places(engine: RigidBodies, names: list[str]) -> Array:
    return np.array([engine.placement(name).translation for name in names])


def _kick(engine: RigidBodies, name: str, rng: np.random.Generator) -> None:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    place = engine.placement(name).translation
    mass = 1.0 / engine.mobility(name, place)[0, 0]
    engine.push(name, mass * KICK * np.array([np.cos(angle), np.sin(angle), 0.3]), place)


def _engine(seed: int) -> tuple[RigidBodies, list[str], list[str]]:
    """The pen with everything in it; names of all that moves, and of the pillar behind its own fence."""
    scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor")
    names: list[str] = []

    def put(shape: wb.Shape, name: str, x: float, y: float, z: float, body: wb.Body | None) -> None:
        scene.add(shape, name=name, at=AWAY + (x, y, z), body=body)
        if body is not None:
            names.append(name)

    thick = 0.1
    for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        size = (thick, 2.0 * PEN, WALL) if x else (2.0 * PEN, thick, WALL)
        put(wb.Box(size), f"wall {k}", x * (PEN + 0.5 * thick), y * (PEN + 0.5 * thick), 0.5 * WALL, None)
    put(wb.Box((0.05, 0.6, WALL)), "fence 1", 0.9, 1.2, 0.5 * WALL, None)
    put(wb.Box((0.6, 0.05, WALL)), "fence 2", 1.2, 0.9, 0.5 * WALL, None)
    put(wb.Box((0.7, 0.7, 0.02)), "roof", 1.2, 1.2, WALL + 0.02, None)
    for k in range(PILLAR):
        put(wb.Box((0.12, 0.12, 0.12)), f"pillar {k}", 1.2, 1.2, 0.0601 + 0.1201 * k, wb.Body())
    for k in range(STACK):
        put(wb.Box((0.2, 0.2, 0.1)), f"box {k}", -0.7, -0.7, 0.0501 + 0.1001 * k, wb.Body())
    for k in range(DOMINOES):
        put(wb.Box((0.02, 0.08, 0.16)), f"domino {k}", 0.09 * k - 0.3, 0.3, 0.0801, wb.Body())
    rng = np.random.default_rng(seed)
    for k in range(BALLS):
        forward, left = (float(v) for v in rng.normal(size=2))
        put(wb.Sphere(0.06), f"ball {k}", 0.25 * k - 0.7, -0.2, 0.3, wb.Body(velocity=(forward, left, 0.0)))
    return RigidBodies(scene), names, [name for name in names if name.startswith("pillar")]
