"""Joints of things that move by themselves: closed forms of pendulums, conserved quantities, no drift."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.dynamics.rigid_bodies import RigidBodies

G = 9.81
AWAY = np.array([5.0, 0.0, 0.0])


def elliptic(k: float) -> float:
    """Complete elliptic integral of the first kind, by the arithmetic-geometric mean."""
    a, b = 1.0, float(np.sqrt(1.0 - k * k))
    for _ in range(20):
        a, b = 0.5 * (a + b), float(np.sqrt(a * b))
    return float(0.5 * np.pi / a)


def swung(angle: float, half: float) -> pin.SE3:
    """A rod whose upper end is at the place `AWAY`, turned out of the vertical."""
    turned = pin.utils.rotate("y", -angle)
    return pin.SE3(turned, AWAY - turned @ np.array([0.0, 0.0, half]))


@pytest.mark.parametrize(("kind", "angle"), [("ball", 1.2), ("hinge", 1.2)])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(hand: wb.Figure, angle: float, kind: str) -> None:
    size, half = (0.06, 0.04, 0.8), 0.4
    top = (0.0, 0.0, half)
    joint = wb.dynamics.BallJoint(top) if kind == "ball" else wb.dynamics.Hinge(top, axis=(0.0, 2.0, 0.0))
    scene = wb.Scene(hand).add(wb.Box(size), name="rod", at=swung(angle, half), body=wb.Body(joints=[joint]))
    engine = RigidBodies(scene)
    about = (size[0] ** 2 + size[2] ** 2) / 12.0 + half**2
    period = 4.0 * elliptic(np.sin(0.5 * angle)) / np.sqrt(G * half / about)
    energy, frames, spins = engine.energy(), int(120 * 1.05 * period), []
    weight = engine._pieces.mass[0] * G * half
    for _ in range(frames):
        engine.advance(1 / 120)
        spins.append(engine.twist("rod")[4])
        upper = engine.placement("rod").act(np.array(top))
        assert np.abs(upper - AWAY).max() < 1e-8
        assert abs(engine.energy() - energy) < 1e-3 * weight  # order 2: it swings with the square of the step
    spins = np.array(spins)
    turns = np.flatnonzero(spins[:-1] * spins[1:] < 0.0)
    times = (turns + 1 + spins[turns] / (spins[turns] - spins[turns + 1])) / 120.0
    assert len(times) >= 2
    assert np.diff(times).mean() == pytest.approx(0.5 * period, rel=2e-4)


def test_a_double_pendulum_keeps_its_energy_and_its_joints(hand: wb.Figure) -> None:
    scene = wb.Scene(hand)
    for number, to in ((1, None), (2, "rod 1")):
        place = AWAY + np.array([0.5 * number - 0.25, 0.0, 0.0])
        turned = pin.SE3(pin.utils.rotate("y", -0.5 * np.pi), place)
        joint = wb.dynamics.BallJoint((0.0, 0.0, 0.25), to=to)
        scene.add(wb.Box((0.05, 0.05, 0.5)), name=f"rod {number}", at=turned, body=wb.Body(joints=joint))
    engine = RigidBodies(scene)
    engine.push("rod 2", np.array([0.0, 0.3, 0.0]), AWAY + (1.0, 0.0, 0.0))  # out of the plane too
    start = engine.energy()
    fall = engine._pieces.mass[0] * G * (0.25 + 0.75)
    energies = []
    for _ in range(60):
        frame = engine.advance(1 / 60)
        energies.append(frame.energy)
        first, second = (engine.placement(f"rod {k}") for k in (1, 2))
        assert np.abs(first.act(np.array([0.0, 0.0, 0.25])) - AWAY).max() < 1e-8
        apart = second.act(np.array([0.0, 0.0, 0.25])) - first.act(np.array([0.0, 0.0, -0.25]))
        assert np.abs(apart).max() < 1e-8
    energies = np.array(energies)
    assert np.abs(energies - start).max() < 1e-9 * fall  # RATTLE alone: 2e-3


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_a_ball_that_strikes_a_door_turns_it_as_momentum_about_the_hinge_says(hand: wb.Figure, share: float) -> None:
    stuff = wb.dynamics.Material("stuff", others=(share, 0.0))
    size, radius, speed, out = (0.04, 0.9, 2.0), 0.1, 3.0, 0.3
    door = wb.Body(mass=20.0, material=stuff, joints=[wb.dynamics.Hinge((0.0, -0.45, 0.0), axis=(0.0, 0.0, 1.0))])
    ball = wb.Body(mass=2.0, material=stuff, velocity=(speed, 0.0, 0.0))
    scene = wb.Scene(hand).add(wb.Box(size), name="door", at=AWAY, body=door)
    scene.add(wb.Sphere(radius), name="ball", at=AWAY + (-0.3, out, 0.0), body=ball)
    engine = RigidBodies(scene, gravity=(0.0, 0.0, 0.0))
    while True:
        if engine.advance(1 / 60).events:
            break
    lever = 0.45 + out
    about = 20.0 * (size[0] ** 2 + size[1] ** 2) / 12.0 + 20.0 * 0.45**2
    # of both about the hinge, and the speed of separation along the ball's way
    turn = (1.0 + share) * 2.0 * speed * lever / (about + 2.0 * lever**2)
    assert engine.twist("door")[5] == pytest.approx(-turn, rel=2e-3)
    assert engine.twist("ball")[0] == pytest.approx(turn * lever - share * speed, abs=2e-3 * speed)
    at = engine.placement("door").act(np.array([0.0, -0.45, 1.0]))
    assert at == pytest.approx(AWAY + (0.0, -0.45, 1.0), abs=1e-8)


def test_a_door_against_a_wall_stays_on_its_hinge(hand: wb.Figure) -> None:
    door = wb.Body(mass=20.0, angular_velocity=(0.0, 0.0, 3.0), velocity=(-1.35, 0.0, 0.0),
                   joints=[wb.dynamics.Hinge((0.0, -0.45, 0.0))])  # fmt: skip
    scene = wb.Scene(hand).add(wb.Box((0.04, 0.9, 2.0)), name="door", at=AWAY, body=door)
    scene.add(wb.Box((0.2, 0.2, 2.0)), name="stop", at=AWAY + (-0.5, 0.3, 0.0))
    engine = RigidBodies(scene)
    energy, hits = engine.energy(), 0
    for _ in range(50):
        frame = engine.advance(1 / 60)
        hits += len(frame.events)
        assert frame.energy <= energy + 1e-6
        assert frame.deepest <= 1e-4
        energy = frame.energy
        for end in (-1.0, 1.0):
            corner = engine.placement("door").act(np.array([0.0, -0.45, end]))
            assert np.abs(corner - AWAY - (0.0, -0.45, end)).max() < 1e-8
    assert hits > 0


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_door_bounces_off_a_wall_that_it_touches_beside_its_hinge(hand: wb.Figure, friction: float) -> None:
    stuff = wb.dynamics.Material("stuff", others=(0.3, friction))
    door = wb.Body(mass=12.0, material=stuff, angular_velocity=(0.0, 0.0, -5.0), velocity=(2.25, 0.0, 0.0),
                   joints=[wb.dynamics.Hinge((0.0, -0.45, 0.0))])  # fmt: skip
    scene = wb.Scene(hand).add(wb.Box((0.04, 0.9, 2.0)), name="door", at=AWAY, body=door)
    scene.add(wb.Box((0.1, 0.5, 2.1)), name="wall", at=AWAY - (0.0, 0.73, 0.0))
    engine = RigidBodies(scene, gravity=(0.0, 0.0, 0.0))
    while not engine.advance(1 / 60).events:
        assert engine.time < 1.0
    assert engine.twist("door")[5] == pytest.approx(1.5, rel=1e-6)


def test_a_chain_on_a_thing_that_is_moved_follows_it(hand: wb.Figure) -> None:
    scene = wb.Scene(hand).add(wb.Box((0.1, 0.1, 0.1)), name="beam", at=AWAY)
    above = "beam"
    for number in range(5):
        body = wb.Body(joints=[wb.dynamics.BallJoint((0.0, 0.0, 0.06), to=above)])
        place = AWAY - (0.0, 0.0, 0.06 + 0.12 * number)
        scene.add(wb.Capsule(0.01, 0.09), name=(above := f"link {number}"), at=place, body=body)
    engine = RigidBodies(scene)
    for number in range(30):
        ways = [pin.SE3(np.eye(3), AWAY + (0.5 * k / 60, 0.0, 0.0)) for k in (number, number + 1)]
        engine.advance(1 / 60, {"beam": (ways[0], ways[1])})
        held = engine.placement("link 0").act(np.array([0.0, 0.0, 0.06]))
        assert np.abs(held - ways[1].translation).max() < 1e-7
    for number in range(4):
        low = engine.placement(f"link {number}").act(np.array([0.0, 0.0, -0.06]))
        high = engine.placement(f"link {number + 1}").act(np.array([0.0, 0.0, 0.06]))
        assert np.abs(low - high).max() < 1e-7


def test_an_impulse_on_a_door_moves_it_by_its_inertia_about_the_hinge(hand: wb.Figure) -> None:
    door = wb.Body(mass=20.0, joints=[wb.dynamics.Hinge((0.0, -0.45, 0.0))])
    engine = RigidBodies(wb.Scene(hand).add(wb.Box((0.04, 0.9, 2.0)), name="door", at=AWAY, body=door))
    about = 20.0 * (0.04**2 + 0.9**2) / 12.0 + 20.0 * 0.45**2
    point = AWAY + (0.0, 0.4, 0.2)
    expected = np.zeros((3, 3))
    expected[0, 0] = 0.85**2 / about
    assert engine.mobility("door", point) == pytest.approx(expected, abs=1e-8)
    engine.push("door", np.array([2.0, 0.0, 0.0]), point)
    assert engine.twist("door")[5] == pytest.approx(-2.0 * 0.85 / about, abs=1e-8)


def test_wrong_joints_are_one_sentence(hand: wb.Figure) -> None:
    def scene(to: str) -> wb.Scene:
        return wb.Scene(hand).add(
            wb.Sphere(0.1), name="bag", at=AWAY, body=wb.Body(joints=[wb.dynamics.BallJoint(to=to)])
        )

    with pytest.raises(UnknownNameError, match="the joint of 'bag'"):
        RigidBodies(scene("beam"))
    with pytest.raises(InputError, match="'bag' has a joint to itself"):
        RigidBodies(scene("bag"))
    with pytest.raises(InputError, match=r"Hinge: axis is .*give a vector"):
        wb.dynamics.Hinge(axis=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="Body: joints"):
        wb.Body(joints=["hinge"])  # type: ignore[list-item]
