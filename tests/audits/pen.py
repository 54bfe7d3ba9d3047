"""Dominoes, stacks and balls in a pen for minutes: whether they stay apart, lose energy, and leave alone what lies."""

from __future__ import annotations

from functools import partial

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.world import DT
from wholebody.bench.rows import Figure, Row, measured_ms
from wholebody.dynamics.rigid_bodies import RigidBodies

PEN = 1.5  # m: half the side
AWAY = np.array([20.0, 0.0, 0.0])  # from the hand that a scene needs


def long_run(minutes: float, seed: int = 0) -> Row:
    """Things in a pen, kicked now and then.

    The drift is of the stack that nothing can reach, from where it lay after ten seconds; "outside" are things that
    left the pen, or are not finite.
    """
    engine, names, pillar = _engine(seed)
    rng = np.random.default_rng(seed)
    frames, kicks = round(60.0 * minutes / DT), round(10.0 / DT)
    times, impacts, asleep, deepest, grew, energy = [], 0, 0, 0.0, 0.0, engine.energy()
    lay: Array | None = None
    for number in range(frames):
        if number % kicks == kicks - 1:
            _kick(engine, f"ball {rng.integers(6)}", rng)
            energy = engine.energy()
        spent, _, made = measured_ms(partial(engine.advance, DT))
        times.append(spent)
        impacts, deepest = impacts + len(made.events), max(deepest, made.deepest)
        grew, energy, asleep = max(grew, made.energy - energy), made.energy, made.sleeping
        if number == kicks:
            lay = _places(engine, pillar)
    end = _places(engine, names) - AWAY
    inside = (np.abs(end[:, :2]) < PEN).all(axis=1) & (end[:, 2] > 0.0) & (end[:, 2] < 3.0)
    drift = 0.0 if lay is None else float(np.linalg.norm(_places(engine, pillar) - lay, axis=1).max())
    figures: dict[str, Figure] = {
        "things": len(names),
        "CPU s": 1e-3 * sum(times),
        "median ms": float(np.median(times)),
        "p99 ms": float(np.quantile(times, 0.99)),
        "impacts": impacts,
        "deepest mm": 1e3 * deepest,
        "largest gain of energy J": grew,
        "drift mm": 1e3 * drift,
        "outside": int((~inside).sum()),
        "asleep at the end": asleep,
    }
    return Row("a pen", f"{minutes:g} minutes", figures)


def _places(engine: RigidBodies, names: list[str]) -> Array:
    return np.array([engine.placement(name).translation for name in names])


def _kick(engine: RigidBodies, name: str, rng: np.random.Generator) -> None:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    place = engine.placement(name).translation
    mass = 1.0 / engine.mobility(name, place)[0, 0]
    engine.push(name, mass * 2.0 * np.array([np.cos(angle), np.sin(angle), 0.3]), place)


def _engine(seed: int) -> tuple[RigidBodies, list[str], list[str]]:
    """The pen with everything in it; names of all that moves, and of the pillar behind its own fence."""
    scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor")
    names: list[str] = []

    def put(shape: wb.Shape, name: str, x: float, y: float, z: float, body: wb.Body | None) -> None:
        scene.add(shape, name=name, at=AWAY + (x, y, z), body=body)
        if body is not None:
            names.append(name)

    thick, wall = 0.1, 0.6
    for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        size = (thick, 2.0 * PEN, wall) if x else (2.0 * PEN, thick, wall)
        put(wb.Box(size), f"wall {k}", x * (PEN + 0.5 * thick), y * (PEN + 0.5 * thick), 0.5 * wall, None)
    put(wb.Box((0.05, 0.6, wall)), "fence 1", 0.9, 1.2, 0.5 * wall, None)
    put(wb.Box((0.6, 0.05, wall)), "fence 2", 1.2, 0.9, 0.5 * wall, None)
    put(wb.Box((0.7, 0.7, 0.02)), "roof", 1.2, 1.2, wall + 0.02, None)
    for k in range(4):
        put(wb.Box((0.12, 0.12, 0.12)), f"pillar {k}", 1.2, 1.2, 0.0601 + 0.1201 * k, wb.Body())
    for k in range(5):
        put(wb.Box((0.2, 0.2, 0.1)), f"box {k}", -0.7, -0.7, 0.0501 + 0.1001 * k, wb.Body())
    for k in range(8):
        put(wb.Box((0.02, 0.08, 0.16)), f"domino {k}", 0.09 * k - 0.3, 0.3, 0.0801, wb.Body())
    rng = np.random.default_rng(seed)
    for k in range(6):
        forward, left = (float(v) for v in rng.normal(size=2))
        put(wb.Sphere(0.06), f"ball {k}", 0.25 * k - 0.7, -0.2, 0.3, wb.Body(velocity=(forward, left, 0.0)))
    return RigidBodies(scene), names, [name for name in names if name.startswith("pillar")]
