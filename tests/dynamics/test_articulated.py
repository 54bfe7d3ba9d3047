"""A figure that yields: impulses, momentum and energy against closed forms; ragdolls, pushes, catches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.rigid_bodies import RigidBodies

DT = 1.0 / 60.0
NO_WEIGHT = (0.0, 0.0, 0.0)


def two_links(planar_arm: Callable[..., wb.Figure], material: wb.dynamics.Material, x: float, speed: float) -> Any:
    """An arm of links of 0.5 and 0.4 m, masses in their joints, and a ball of 0.5 kg that flies at the second link."""
    figure = planar_arm([0.5, 0.4])
    ball = wb.Body(mass=0.5, material=material, velocity=(0.0, -speed, 0.0))
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(x, 0.2, 0.0), body=ball)
    engine = RigidBodies(scene, NO_WEIGHT, figure.neutral)
    free = wb.Actuated(figure, stiffness=0.0, damping=0.0)
    return Articulated(scene, figure.neutral, free, engine), engine, scene


@pytest.mark.parametrize("bounce", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("x", [0.65, 0.85])
def test_a_blow_moves_the_whole_arm_as_equation_9_says(planar_arm: Any, bounce: float, x: float) -> None:
    material = wb.dynamics.Material("test", {"human": (bounce, 0.0)})
    arm, engine, scene = two_links(planar_arm, material, x, 2.0)
    segments = {name: scene.frame_id(name) for name in ("link0", "link1")}
    while not arm.impulses:
        arm.advance(arm.q, 1e-3, {}, segments)
    arm.advance(arm.q, 1e-3, {}, segments)  # what does not bounce comes to rest against it in two steps
    own, mass, ball = 0.4 * 0.1**2, 1.0, 0.5
    inertia = np.array([[2.0 * own + mass * 0.5**2, own], [own, own]])  # joint angles, the arm straight
    row = np.array([x, x - 0.5])  # of the place that is hit, along y
    impulse = (1.0 + bounce) * 2.0 / (1.0 / ball + row @ np.linalg.solve(inertia, row))
    met = engine.twist("ball")[1]
    assert met == pytest.approx(-2.0 + impulse / ball, abs=2e-3)
    # the arm turns on freely after the blow: its angular momentum about the fixed joint and its energy stay
    began = 0.5 * ball * 2.0**2
    after = 0.5 * ball * met**2 + arm.energy()
    lost = 0.5 * (1.0 - bounce**2) * 2.0**2 / (1.0 / ball + row @ np.linalg.solve(inertia, row))
    assert after == pytest.approx(began - lost, rel=2e-3)


def test_a_ragdoll_falls_and_rests_and_its_energy_never_grows() -> None:
    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    figure = scene.figure
    start = figure.posture("standing").copy()
    start[2] += 0.02
    world = wb.World(scene, start, spring=wb.Actuated(figure, stiffness=0.0, damping=2.0))
    energies, speeds = [], []
    for _ in range(240):
        frame = world.step()
        assert frame.deepest < 2e-3
        energies.append(world.energy)
        speeds.append(np.abs(world.velocity).max())
    assert np.diff(energies).max() < 1e-6
    assert energies[0] - energies[-1] > 200.0  # J
    assert max(speeds[-30:]) < 0.05
    assert np.isfinite(frame.q).all()
