"""Sleepers: what touches them wakes them however slowly it moves, or if it is taken away."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.dynamics.step_program import SKIN

MOVED = 1e-4  # m: by which what touches a sleeper may have moved before it wakes
HALF = 0.1  # m: of the box


def asleep(support: wb.Shape, at: tuple[float, ...], start: np.ndarray | None = None) -> tuple[wb.World, wb.Scene]:
    """A box that sleeps on a fixed thing whose upper face is at z = 0, far from a hand."""
    scene = wb.Scene(wb.load("hand")).add(support, name="shelf", at=at)
    scene.add(wb.Box((2 * HALF,) * 3), name="box", at=(3.0, 0.0, HALF + SKIN), body=wb.Body())
    world = wb.World(scene)
    for _ in range(40):
        frame = world.step()
    assert frame.engine is not None
    assert frame.engine.sleeping == 1
    return world, scene


def height(world: wb.World) -> float:
    """How far the box's lower face is above z = 0, metres."""
    assert world.engine is not None
    return float(world.engine.placement("box").translation[2]) - HALF


@pytest.mark.parametrize("step", [-1e-5, 1e-5, -5e-5, 5e-5])
@pytest.mark.parametrize("over", [True, False])
def test_a_sleeper_follows_what_creeps_under_it(step: float, over: bool) -> None:
    world, scene = asleep(wb.Box((1.0, 1.0, 0.2)), (3.0, 0.0, -0.1))
    top = 0.0
    for _ in range(200):
        top += step
        scene.move("shelf", at=(3.0, 0.0, top - 0.1), over=world.dt if over else None)
        frame = world.step()
        assert -1e-5 <= height(world) - top <= MOVED + SKIN
        assert frame.engine is not None
        assert frame.engine.deepest <= MOVED
    for _ in range(60):
        frame = world.step()
    assert frame.engine.sleeping == 1  # and sleeps again once it stands


@pytest.mark.parametrize("away", [(3.0, 0.0, -3.1), (3.0, 5.0, -0.1), (3.0, 0.0, -0.1005)])
def test_a_sleeper_falls_when_what_bears_it_is_taken_away(away: tuple[float, float, float]) -> None:
    world, scene = asleep(wb.Box((1.0, 1.0, 0.2)), (3.0, 0.0, -0.1))
    scene.move("shelf", at=away)
    seconds = 12 * world.dt
    for _ in range(12):
        world.step()
    lowest = max(-0.5 * 9.81 * seconds**2, away[2] + 0.1 if away[1] == 0.0 else -np.inf)
    assert height(world) == pytest.approx(lowest, abs=2e-3 if lowest < -0.01 else 1e-4)


def test_a_sleeper_slides_when_the_ground_tilts_slowly_beyond_its_friction() -> None:
    world, scene = asleep(wb.HalfSpace(), (0.0, 0.0, 0.0))  # wood on wood, which holds up to 16.7 degrees
    axis = np.array([0.0, 1.0, 0.0])
    for frame in range(80):
        turn = pin.exp3(np.deg2rad(0.25 * (frame + 1)) * axis)
        at = pin.SE3(turn, np.array([3.0, 0.0, 0.0]) - turn @ np.array([3.0, 0.0, 0.0]))
        scene.move("shelf", at=at, over=world.dt)
        made = world.step()
        assert made.engine is not None
        assert made.engine.deepest <= MOVED
    for _ in range(30):
        world.step()
    assert world.engine is not None
    assert world.engine.placement("box").translation[0] > 3.02


def test_what_creeps_against_a_sleeper_pushes_it() -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor")
    scene.move("floor", at=(0.0, 0.0, -1.0))
    scene.add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(3.0, 0.0, -0.9 + SKIN), body=wb.Body())
    scene.add(wb.Box((0.2, 0.2, 0.2)), name="wall", at=(2.79, 0.0, -0.89))  # 10 mm away
    world = wb.World(scene)
    for _ in range(40):
        world.step()
    x = 2.79
    for _ in range(300):
        x += 5e-5
        scene.move("wall", at=(x, 0.0, -0.89), over=world.dt)
        frame = world.step()
        assert frame.engine is not None
        assert frame.engine.deepest <= MOVED
    assert world.engine is not None
    gap = world.engine.placement("box").translation[0] - 0.1 - (x + 0.1)
    assert -1e-5 <= gap < 1e-3


def test_what_is_put_into_a_sleeper_wakes_it() -> None:
    world, scene = asleep(wb.Box((1.0, 1.0, 0.2)), (3.0, 0.0, -0.1))
    scene.move("shelf", at=(3.0, 0.0, -0.0995))
    for _ in range(30):
        frame = world.step()
    assert frame.engine is not None
    assert height(world) >= 5e-4 - MOVED


def test_a_sleeper_hangs_on_what_holds_it(hung: Callable[[], wb.Scene]) -> None:
    scene = hung()
    world = wb.World(scene)
    for _ in range(60):
        frame = world.step()
    assert frame.engine is not None
    assert frame.engine.sleeping == 1
    for k in range(100):
        scene.move("beam", at=(3.0, 0.0, 2.0 - 1e-5 * (k + 1)), over=world.dt)
        world.step()
    assert world.engine is not None
    assert world.engine.placement("bag").translation[2] == pytest.approx(1.2 - 1e-3, abs=MOVED)


@pytest.fixture
def hung() -> Callable[[], wb.Scene]:
    """A bag that hangs still from a beam."""

    def made() -> wb.Scene:
        scene = wb.Scene(wb.load("hand")).add(wb.Box((0.1, 0.1, 0.1)), name="beam", at=(3.0, 0.0, 2.0))
        held = wb.BallJoint(at=(0.0, 0.0, 0.8), to="beam")
        return scene.add(wb.Capsule(0.15, 0.5), name="bag", at=(3.0, 0.0, 1.2), body=wb.Body(mass=15.0, joints=[held]))

    return made
