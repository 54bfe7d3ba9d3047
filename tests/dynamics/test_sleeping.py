"""Sleepers: what touches them wakes them however slowly it moves, or if it is taken away."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.dynamics.step_program import SKIN

MOVED = 1e-4  # m: by which what touches a sleeper may have moved before it wakes
HALF = 0.1  # m: of the box


FRAME = 1.0 / 60.0  # s
SHELF = wb.Box((1.0, 1.0, 0.2))


def at(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def on_shelf(support: wb.Shape, place: pin.SE3) -> wb.Scene:
    """A box on a fixed thing whose upper face is at z = 0, far from a hand."""
    scene = wb.Scene(wb.load("hand")).add(support, name="shelf", at=place)
    return scene.add(wb.Box((2 * HALF,) * 3), name="box", at=(3.0, 0.0, HALF + SKIN), body=wb.Body())


def asleep(scene: wb.Scene, frames: int = 35) -> RigidBodies:
    """The engine of a scene whose one body sleeps."""
    engine = RigidBodies(scene)
    for _ in range(frames):
        frame = engine.advance(FRAME)
    assert frame.sleeping == 1
    return engine


def height(engine: RigidBodies) -> float:
    """How far the box's lower face is above z = 0, metres."""
    return float(engine.placement("box").translation[2]) - HALF


def test_a_sleeper_follows_what_creeps_under_it() -> None:
    step = -1e-5
    engine = asleep(on_shelf(SHELF, at(3.0, 0.0, -0.1)))
    for k in range(25):
        before, after = (at(3.0, 0.0, step * n - 0.1) for n in (k, k + 1))
        frame = engine.advance(FRAME, {"shelf": (before, after)})
        assert -1e-5 <= height(engine) - step * (k + 1) <= MOVED + SKIN
        assert frame.deepest <= MOVED
    for _ in range(35):
        frame = engine.advance(FRAME)
    assert frame.sleeping == 1  # and sleeps again once it stands


def test_a_sleeper_falls_when_what_bears_it_is_taken_away() -> None:
    scene = on_shelf(SHELF, at(3.0, 0.0, -0.1))
    world = wb.World(scene)
    for _ in range(35):
        frame = world.step()
    assert frame.engine is not None
    assert frame.engine.sleeping == 1
    scene.move("shelf", at=(3.0, 5.0, -0.1))
    for _ in range(12):
        world.step()
    assert world.engine is not None
    fallen = -0.5 * 9.81 * (12 * FRAME) ** 2
    assert height(world.engine) == pytest.approx(fallen, abs=2e-3)


def test_a_sleeper_slides_when_the_ground_tilts_beyond_its_friction() -> None:
    engine = asleep(on_shelf(wb.HalfSpace(), at(0.0, 0.0, 0.0)))  # wood on wood, which holds up to 16.7 degrees
    centre = np.array([3.0, 0.0, 0.0])

    def tilted(degrees: float) -> pin.SE3:
        turn = pin.exp3(np.deg2rad(degrees) * np.array([0.0, 1.0, 0.0]))
        return pin.SE3(turn, centre - turn @ centre)

    for k in range(20):
        frame = engine.advance(FRAME, {"shelf": (tilted(k), tilted(k + 1))})
        assert frame.deepest <= MOVED
    for _ in range(30):
        engine.advance(FRAME)
    assert engine.placement("box").translation[0] > 3.02


def test_what_creeps_against_a_sleeper_pushes_it() -> None:
    scene = on_shelf(wb.HalfSpace(), at(0.0, 0.0, 0.0))
    scene.add(wb.Box((2 * HALF,) * 3), name="wall", at=at(2.798, 0.0, HALF + 0.01))  # 2 mm away
    engine = asleep(scene)
    for k in range(60):
        before, after = (at(2.798 + 5e-5 * n, 0.0, HALF + 0.01) for n in (k, k + 1))
        frame = engine.advance(FRAME, {"wall": (before, after)})
        assert frame.deepest <= MOVED
    gap = engine.placement("box").translation[0] - after.translation[0] - 2 * HALF
    assert -1e-5 <= gap < 1e-3


def test_what_is_put_into_a_sleeper_wakes_it() -> None:
    engine = asleep(on_shelf(SHELF, at(3.0, 0.0, -0.1)))
    engine.advance(FRAME, {"shelf": (at(3.0, 0.0, -0.0995),) * 2})
    for _ in range(20):
        engine.advance(FRAME)
    assert height(engine) >= 5e-4 - MOVED


def test_a_sleeper_hangs_on_what_holds_it() -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.Box((0.1, 0.1, 0.1)), name="beam", at=(3.0, 0.0, 2.0))
    held = wb.dynamics.BallJoint(at=(0.0, 0.0, 0.8), to="beam")
    scene.add(wb.Capsule(0.15, 0.5), name="bag", at=(3.0, 0.0, 1.2), body=wb.Body(mass=15.0, joints=[held]))
    engine = asleep(scene, frames=60)
    for k in range(40):
        before, after = (at(3.0, 0.0, 2.0 - 2e-5 * n) for n in (k, k + 1))
        engine.advance(FRAME, {"beam": (before, after)})
    assert engine.placement("bag").translation[2] == pytest.approx(1.2 - 8e-4, abs=MOVED)
