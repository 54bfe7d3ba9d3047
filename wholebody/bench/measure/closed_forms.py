"""Motions whose outcome is known by formula, or of which it is known that they lose energy and end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.drops import GRAVITY
from wholebody.bench.measure.throws import DT
from wholebody.bench.rows import Row
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.dynamics.step_program import SKIN

FAR = 5.0  # m: from the hand that a scene needs
LOW = -2.0  # m: height of the floor


def _row(motion: str, quantity: str, measured: float, expected: float, most: float) -> Row:
    """One quantity of one motion, beside the formula; `most` is the bound that the tests of the package hold it to."""
    off = abs(measured - expected)
    figures = {"measured": measured, "by formula": expected, "off": off, "at most": most}
    return Row(motion, quantity, figures | {"held": "yes" if off <= most else "no"})


def closed_forms() -> Iterator[Row]:
    """All of them; about a minute."""
    for measure in MOTIONS:
        yield from measure()


def _engine(
    *things: tuple[wb.Shape, Any, wb.Body],
    floor: tuple[float, float, float] | None = (0.0, 0.0, 1.0),
    weight: bool = True,
) -> RigidBodies:
    """Things named 0, 1, ... above a floor, or none."""
    scene = wb.Scene(wb.load("hand"))
    if floor is not None:
        scene.add(wb.HalfSpace(floor, LOW), name="floor")
    for number, (shape, at, body) in enumerate(things):
        scene.add(shape, name=str(number), at=at, body=body)
    return RigidBodies(scene, gravity=(0.0, 0.0, -GRAVITY if weight else 0.0))


def _pass(engine: RigidBodies, frames: int) -> None:
    for _ in range(frames):
        engine.advance(DT)


def _grown(engine: RigidBodies, frames: int) -> float:
    """Largest gain of energy in one of some frames, joules; at least 0."""
    energies = [engine.energy(), *(engine.advance(DT).energy for _ in range(frames))]
    return max(0.0, float(np.diff(energies).max()))


def _stuff(restitution: float, friction: float) -> wb.dynamics.Material:
    return wb.dynamics.Material("stuff", others=(restitution, friction))


def _bouncing() -> list[Row]:
    share, height, bounces = 0.5, 1.0, 7
    engine = _engine((wb.Sphere(0.05), (FAR, 0.0, LOW + 0.05 + height), wb.Body(1e3, material=_stuff(share, 0.3))))
    first = float(np.sqrt(2.0 * (height - SKIN) / GRAVITY))
    times, speeds = [], []
    for frame in range(180):
        for event in engine.advance(DT).events:
            times.append(frame * DT + event.time)
            speeds.append(event.speed)
    flights = sum(2.0 * first * share**k for k in range(1, bounces))
    return [
        _row("bouncing ball", "time of the 7th impact, s", times[bounces - 1], first + flights, 1e-4),
        _row("bouncing ball", "its speed, m/s", speeds[bounces - 1], GRAVITY * first * share ** (bounces - 1), 1e-3),
        _row("bouncing ball", "speed after 3 s, m/s", float(np.abs(engine.twist("0")).max()), 0.0, 1e-9),
    ]


def _sliding() -> list[Row]:
    speed, friction = 2.0, 0.3
    body = wb.Body(mass=1.0, velocity=(speed, 0.0, 0.0))
    engine = _engine((wb.Box((0.2, 0.2, 0.1)), (FAR, 0.0, LOW + 0.05 + SKIN), body))
    _pass(engine, 60)
    way = float(engine.placement("0").translation[0]) - FAR
    return [_row("box slides to rest", "way, m", way, speed**2 / (2.0 * friction * GRAVITY), 5e-3)]


def _slope() -> list[Row]:
    rows = []
    for tangent in (0.29, 0.31):
        angle = float(np.arctan(tangent))
        turned = pin.utils.rotate("y", angle)
        start = pin.SE3(turned, turned @ np.array([FAR, 0.0, LOW + 0.05 + SKIN]))
        body = (wb.Box((0.2, 0.2, 0.1)), start, wb.Body(mass=1.0))
        engine = _engine(body, floor=(float(np.sin(angle)), 0.0, float(np.cos(angle))))
        _pass(engine, 60)
        way = float((turned.T @ (engine.placement("0").translation - start.translation))[0])
        pull = max(0.0, 0.5 * GRAVITY * float(np.sin(angle) - 0.3 * np.cos(angle)))
        rows.append(_row(f"slope of {tangent}, friction 0.3", "way in 1 s, m", way, pull, 3e-4))
    return rows


def _cradle() -> list[Row]:
    pitch, steel = 0.1 + SKIN, _stuff(1.0, 0.0)
    come = (wb.Sphere(0.05), (FAR - 0.2, 0, 0), wb.Body(8e3, material=steel, velocity=(1.5, 0.0, 0.0)))
    row = [(wb.Sphere(0.05), (FAR + pitch * k, 0, 0), wb.Body(8e3, material=steel)) for k in range(1, 5)]
    engine = _engine(come, *row, floor=None, weight=False)
    _pass(engine, 60)
    speeds = [float(engine.twist(str(k))[0]) for k in range(5)]
    return [
        _row("Newton's cradle of five", "speed of the last, m/s", speeds[-1], 1.5, 1e-9),
        _row("Newton's cradle of five", "greatest speed of the others, m/s", max(map(abs, speeds[:-1])), 0.0, 1e-9),
    ]


def _rolling() -> list[Row]:
    angle = 0.2
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    start = normal * (LOW + 0.1 + SKIN)
    ball = (wb.Sphere(0.1), start, wb.Body(material=_stuff(0.0, 0.5)))
    engine = _engine(ball, floor=(float(normal[0]), 0.0, float(normal[2])))
    _pass(engine, 60)
    speed = float(engine.twist("0")[:3] @ np.array([np.cos(angle), 0.0, -np.sin(angle)]))
    return [_row("ball rolls down a slope", "speed after 1 s, m/s", speed, 5.0 / 7.0 * GRAVITY * np.sin(angle), 1e-3)]


def colliding(rng: np.random.Generator, at: float) -> list[tuple[wb.Shape, Array, wb.Body]]:
    """Four things around (at, at, at) that fly towards each other, about a metre a second fast."""
    shapes = (wb.Box((0.2, 0.3, 0.1)), wb.Sphere(0.1), wb.Capsule(0.05, 0.2), wb.Box((0.1, 0.1, 0.3)))
    things = []
    for k, shape in enumerate(shapes):
        place = at + 0.5 * np.array([k % 2, k // 2, 0.0])
        speed = -2.0 * (place - at - 0.25) + 0.2 * rng.normal(size=3)
        body = wb.Body(velocity=tuple(speed), angular_velocity=tuple(rng.normal(size=3)))
        things.append((shape, place, body))
    return things


def _collisions() -> list[Row]:
    engine = _engine(*colliding(np.random.default_rng(0), FAR), floor=None, weight=False)
    momentum, grew = engine.momentum(), _grown(engine, 22)
    off = float(np.abs(engine.momentum() - momentum).max())
    return [
        _row("four things collide freely", "change of momentum, kg m/s and kg m2/s", off, 0.0, 1e-10),
        _row("four things collide freely", "largest gain of energy in a frame, J", grew, 0.0, 1e-10),
    ]


def _pendulums() -> list[Row]:
    half, angle = 0.4, 1.2
    size = (0.06, 0.04, 2.0 * half)
    turned = pin.utils.rotate("y", -angle)
    rod = wb.Body(joints=[wb.dynamics.BallJoint((0.0, 0.0, half))])
    start = pin.SE3(turned, np.array([FAR, 0.0, 0.0]) - turned @ np.array([0.0, 0.0, half]))
    engine = _engine((wb.Box(size), start, rod), floor=None)
    spins = []
    for _ in range(400):
        engine.advance(0.5 * DT)
        spins.append(float(engine.twist("0")[4]))
    turns = [k for k in range(len(spins) - 1) if spins[k] * spins[k + 1] < 0.0]
    times = [(k + 1 + spins[k] / (spins[k] - spins[k + 1])) * 0.5 * DT for k in turns]
    about = (size[0] ** 2 + size[2] ** 2) / 12.0 + half**2
    a, b = 1.0, float(np.cos(0.5 * angle))  # the elliptic integral by the arithmetic-geometric mean
    for _ in range(20):
        a, b = 0.5 * (a + b), float(np.sqrt(a * b))
    period = 2.0 * np.pi / a / float(np.sqrt(GRAVITY * half / about))
    rows = [_row("pendulum from 69 degrees", "period, s", 2.0 * float(np.diff(times).mean()), period, 2e-4 * period)]
    links = []
    for k in (0, 1):
        joint = wb.dynamics.BallJoint((0.0, 0.0, 0.25), to=None if k == 0 else "0")
        place = pin.SE3(pin.utils.rotate("y", -0.5 * np.pi), np.array([FAR + 0.25 + 0.5 * k, 0.0, 0.0]))
        links.append((wb.Box((0.05, 0.05, 0.5)), place, wb.Body(joints=[joint])))
    engine = _engine(*links, floor=None)
    energy = engine.energy()
    changes = [engine.advance(DT).energy - energy for _ in range(600)]
    fall = 700.0 * 0.05 * 0.05 * 0.5 * GRAVITY  # J by a metre
    worst = float(np.abs(changes).max()) / fall
    return [
        *rows,
        _row("double pendulum, 10 s", "change of energy, parts of its weight times 1 m", worst, 0.0, 1e-9),
    ]


def _door() -> list[Row]:
    share, speed, out = 0.6, 3.0, 0.3
    stuff = _stuff(share, 0.0)
    door = wb.Body(mass=20.0, material=stuff, joints=[wb.dynamics.Hinge((0.0, -0.45, 0.0))])
    ball = wb.Body(mass=2.0, material=stuff, velocity=(speed, 0.0, 0.0))
    panel = (wb.Box((0.04, 0.9, 2.0)), (FAR, 0.0, 0.0), door)
    engine = _engine(panel, (wb.Sphere(0.1), (FAR - 0.3, out, 0.0), ball), floor=None, weight=False)
    _pass(engine, 10)
    lever, about = 0.45 + out, 20.0 * (0.04**2 + 0.9**2) / 12.0 + 20.0 * 0.45**2
    turn = (1.0 + share) * 2.0 * speed * lever / (about + 2.0 * lever**2)
    return [_row("ball strikes a door", "its turning, rad/s", -float(engine.twist("0")[5]), turn, 2e-3 * turn)]


def _ending() -> list[Row]:
    """What has no solution with acceleration alone, or turns round by itself: it ends, and gains nothing."""
    turned, half = pin.utils.rotate("y", -0.6), 0.5
    low = turned @ np.array([0.0, 0.0, -half])
    start = pin.SE3(turned, np.array([FAR, 0.0, LOW + 0.01 + SKIN]) - low)
    rod = wb.Body(mass=1.0, material=_stuff(0.0, 2.0), velocity=(-3.0, 0.0, 0.0))
    stone = wb.Body(mass=0.1, angular_velocity=(0.0, 0.3, -5.0))
    place = pin.SE3(pin.utils.rotate("z", 0.1), np.array([FAR, 0.0, LOW + 0.01 + 1e-4]))
    cases = (
        ("Painleve's rod, friction 2", (wb.Capsule(0.01, 2.0 * half), start, rod), 1e-10),
        ("rattleback", (wb.Ellipsoid((0.1, 0.02, 0.01)), place, stone), 1e-10),
    )
    rows = []
    for name, thing, most in cases:
        grew = _grown(_engine(thing), 120)
        rows.append(_row(name, "largest gain of energy in a frame, J", grew, 0.0, most))
    return rows


MOTIONS: tuple[Callable[[], list[Row]], ...] = (
    _bouncing, _sliding, _slope, _cradle, _rolling, _collisions, _pendulums, _door, _ending,
)  # fmt: skip
