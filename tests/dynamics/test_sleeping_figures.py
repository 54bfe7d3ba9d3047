"""A figure that lies still sleeps, and wakes where something moves that it touches, that hits it or that drives it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated

DT = 1.0 / 60.0  # s


def lying_hand() -> wb.World:
    """A limp hand on a loose box, at rest, and a ball far away."""
    hand = wb.load("hand")
    scene, start = wb.Scene(hand).add(wb.HalfSpace(), name="floor"), hand.posture("relaxed").copy()
    scene.add(wb.Box((0.5, 0.5, 0.1)), name="box", at=(0.0, 0.0, 0.0501), body=wb.Body(mass=5.0))
    scene.add(wb.Sphere(0.03), name="ball", at=(2.0, 0.0, 0.0301), body=wb.Body(mass=0.3))
    start[:3] += (0.0, 0.0, 0.2) - hand.placement(start, "right_palm").translation
    world = wb.World(scene, start, spring=wb.Actuated(hand, stiffness=0.0, damping=1e-3))
    for _ in range(150):
        world.step()
    return world


def test_a_figure_at_rest_takes_one_step_a_frame_and_stays_where_it_is() -> None:
    world = lying_hand()
    before, energy = world.q.copy(), world.energy
    for _ in range(5):
        frame = world.step()
        assert frame.loop.iterations == 1  # 4 steps of the engine's while it is awake
        assert (frame.q == before).all()
        assert frame.engine is not None
        assert frame.engine.sleeping == 2
    assert world.energy == pytest.approx(energy, abs=1e-12)
    assert not world.velocity.any()


def test_a_figure_falls_when_what_it_sleeps_on_is_taken_away() -> None:
    world = lying_hand()
    height = world.q[2]
    world.engine.put("box", pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0501])))  # type: ignore[union-attr]
    for _ in range(6):
        frame = world.step()
    assert frame.q[2] - height == pytest.approx(-0.5 * 9.81 * (6 * DT) ** 2, abs=0.01)


def test_a_ball_that_hits_a_sleeping_figure_moves_it_and_what_bears_it_stays() -> None:
    world = lying_hand()
    palm = world.scene.figure.placement(world.q, "right_palm").translation
    engine, before = world.engine, world.q.copy()
    assert engine is not None
    engine.put("ball", pin.SE3(np.eye(3), palm + (-0.2, 0.0, 0.04)))
    engine.push("ball", (0.6, 0.0, 0.1), palm + (-0.2, 0.0, 0.04))  # N s: 2 m/s
    energies = [world.energy]
    for _ in range(20):
        frame = world.step()
        energies.append(world.energy)
        assert frame.deepest < 1e-3
    assert np.diff(energies).max() < 1e-6
    assert np.abs(frame.q[:2] - before[:2]).max() > 2e-3  # m


def test_springs_wake_a_figure_whose_tracker_moves() -> None:
    hand = wb.load("hand")
    start = hand.posture("relaxed")
    world, goal = wb.World(wb.Scene(hand), start, spring=wb.Actuated(hand)), start.copy()
    for _ in range(40):
        frame = world.step(start)
    assert frame.loop.iterations == 1
    goal[0] += 0.05
    for _ in range(60):
        frame = world.step(goal)
    assert frame.q[:3] == pytest.approx(goal[:3], abs=1e-3)


def test_what_a_figure_sleeps_on_bears_it_when_it_wakes() -> None:
    """The floor below the box was not seen: both sank by 0.17 mm into each other, and the box slid on by 5 mm."""
    world = lying_hand()
    engine, before = world.engine, world.q.copy()
    assert engine is not None
    stood = engine.centre("box").copy()
    engine.push("box", (0.01, 0.0, 0.0), stood)  # N s, of which friction leaves nothing
    for _ in range(60):
        frame = world.step()
        assert frame.deepest < 1e-5
    assert engine.centre("box") == pytest.approx(stood, abs=1e-5)
    assert frame.q[:3] == pytest.approx(before[:3], abs=1e-5)


@pytest.mark.parametrize("way", [0.0005, 0.01])
def test_soft_springs_arrive_before_the_figure_sleeps_again(way: float) -> None:
    """Woken for one frame it slept 0.48 mm short of a tracker, and crept to 0.98 mm beside it."""
    hand = wb.load("hand")
    start = hand.posture("relaxed")
    world, goal = wb.World(wb.Scene(hand), start, spring=wb.Actuated(hand, stiffness=1.0)), start.copy()
    for _ in range(40):
        frame = world.step(start)
    assert frame.loop.iterations == 1
    goal[0] += way
    for _ in range(400):
        frame = world.step(goal)
    assert frame.loop.iterations == 1
    assert frame.q[:3] == pytest.approx(goal[:3], abs=1e-4)


def test_what_floats_freely_is_never_stopped() -> None:
    hand = wb.load("hand")
    start, free = hand.posture("relaxed"), wb.Actuated(hand, stiffness=0.0, damping=0.0)
    moving = Articulated(wb.Scene(hand), start, free, None, gravity=np.zeros(3))
    moving.velocity[:3] = 1e-3  # m/s: slower than what sleeps
    began = moving.momentum()
    for _ in range(60):
        moving.advance(start, DT, {}, {})
    assert moving.momentum() == pytest.approx(began, abs=1e-12)
    assert np.linalg.norm(moving.q[:3] - start[:3]) == pytest.approx(np.sqrt(3.0) * 1e-3, rel=1e-3)
