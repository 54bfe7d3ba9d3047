"""The engine against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.dynamics.step_program import SKIN

G = 9.81


def floor(hand: wb.Figure, normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> wb.Scene:
    return wb.Scene(hand).add(wb.HalfSpace(normal, -2.0), name="floor")


def test_a_ball_bounces_as_the_closed_form_says(hand: wb.Figure) -> None:
    share, height = 0.5, 1.0
    rubber = wb.dynamics.Material("rubber", others=(share, 0.3))
    scene = floor(hand).add(wb.Sphere(0.05), name="ball", at=(3, 0, height - 1.95), body=wb.Body(1e3, material=rubber))
    engine = RigidBodies(scene)
    first = np.sqrt(2.0 * (height - SKIN) / G)
    speed = G * first
    times, speeds = [], []
    for frame in range(180):
        for event in engine.advance(1 / 60).events:
            times.append(frame / 60 + event.time)
            speeds.append(event.speed)
    expected = [speed * share**k for k in range(len(speeds))]
    assert len(speeds) >= 7  # the eighth falls 20 um: the ball of Zeno ends
    assert speeds[:7] == pytest.approx(expected[:7], rel=1e-3)
    whole = [first + sum(2.0 * speed * share**j / G for j in range(1, k + 1)) for k in range(7)]
    assert times[:7] == pytest.approx(whole, abs=1e-4)
    assert np.abs(engine.twist("ball")).max() < 1e-9
    assert engine.placement("ball").translation[2] == pytest.approx(-1.95 + SKIN, abs=2e-6)


def test_a_thrown_body_follows_its_parabola_and_keeps_momentum_and_energy(hand: wb.Figure) -> None:
    body = wb.Body(mass=2.0, velocity=(1.0, 2.0, 3.0), angular_velocity=(0.3, 8.0, 0.2))
    scene = wb.Scene(hand).add(wb.Box((0.1, 0.2, 0.4)), name="box", at=(3.0, 0.0, 5.0), body=body)
    engine = RigidBodies(scene)
    energy, momentum = engine.energy(), engine.momentum()
    for _ in range(60):
        engine.advance(1 / 60)
    at = engine.placement("box").translation
    assert at == pytest.approx([4.0, 2.0, 8.0 - 0.5 * G], abs=1e-10)
    assert engine.energy() == pytest.approx(energy, abs=1e-9)
    own = engine.momentum()[3:] - np.cross(at, engine.momentum()[:3])
    before = momentum[3:] - np.cross((3.0, 0.0, 5.0), momentum[:3])
    assert own == pytest.approx(before, abs=1e-10)


def test_a_box_slides_as_far_as_friction_lets_it(hand: wb.Figure) -> None:
    speed, mu = 2.0, 0.3
    body = wb.Body(mass=1.0, velocity=(speed, 0.0, 0.0))
    scene = floor(hand).add(wb.Box((0.2, 0.2, 0.1)), name="box", at=(3, 0, -1.95 + SKIN), body=body)
    engine = RigidBodies(scene)
    deepest = max(engine.advance(1 / 60).deepest for _ in range(60))
    whole = speed**2 / (2 * mu * G) - speed / 480  # a step moves a body with its velocity at the end: short by v h / 2
    assert engine.placement("box").translation[0] - 3.0 == pytest.approx(whole, abs=5e-4)
    assert np.abs(engine.twist("box")).max() < 1e-6
    assert deepest == 0.0


@pytest.mark.parametrize("slope", [0.29, 0.31])
def test_a_box_on_a_slope_slides_where_the_slope_is_above_mu(hand: wb.Figure, slope: float) -> None:
    angle = np.arctan(slope)
    turned = pin.utils.rotate("y", float(angle))
    scene = floor(hand, (float(np.sin(angle)), 0.0, float(np.cos(angle))))
    start = pin.SE3(turned, turned @ np.array([0.0, 0.0, -1.95 + SKIN]))
    scene.add(wb.Box((0.2, 0.2, 0.1)), name="box", at=start, body=wb.Body(mass=1.0))
    engine = RigidBodies(scene)
    for _ in range(60):
        engine.advance(1 / 60)
    way = turned.T @ (engine.placement("box").translation - start.translation)
    expected = max(0.0, 0.5 * G * (np.sin(angle) - 0.3 * np.cos(angle)))
    assert way[0] == pytest.approx(expected, abs=3e-4)
    assert abs(way[2]) < 1e-4


@pytest.mark.parametrize(
    ("shape", "turn", "height", "place"),
    [
        (wb.Box((0.2, 0.2, 0.2)), 0.0, 0.1, (0.1, 0.05)),
        (wb.Capsule(0.05, 0.3), 0.5 * np.pi, 0.05, (0.0, 0.0)),  # on a line
    ],
)
def test_what_stands_on_a_turntable_turns_with_it(
    hand: wb.Figure, shape: wb.Shape, turn: float, height: float, place: tuple[float, float]
) -> None:
    angle, frames = 0.6, 60
    rubber = wb.dynamics.Material("rubber", others=(0.0, 0.6))
    scene = wb.Scene(hand).add(wb.Box((0.4, 0.4, 0.2)), name="table", at=(3.0, 0.0, -0.1))
    start = pin.SE3(pin.utils.rotate("y", turn), np.array([3.0 + place[0], place[1], height + SKIN]))
    scene.add(shape, name="thing", at=start, body=wb.Body(mass=2.0, material=rubber))
    engine = RigidBodies(scene)
    energy = engine.energy()
    ways = [pin.SE3(pin.utils.rotate("z", angle * k / frames), np.array([3.0, 0.0, -0.1])) for k in range(frames + 1)]
    for before, after in pairwise(ways):
        frame = engine.advance(1 / 60, {"table": (before, after)})
        assert frame.energy <= energy + frame.work + 1e-9
        energy = frame.energy
    at = engine.placement("thing")
    way = at.translation - ways[-1].rotation @ (start.translation - ways[0].translation) - ways[0].translation
    assert 0.95 * angle < pin.log3(at.rotation @ start.rotation.T)[2] <= angle + 1e-4
    assert np.abs(way).max() < 1e-3


def test_friction_at_its_corners_stops_a_box_that_spins(hand: wb.Figure) -> None:
    spin, mu, size = 6.0, 0.3, 0.2
    body = wb.Body(mass=1.0, angular_velocity=(0.0, 0.0, spin))
    engine = RigidBodies(floor(hand).add(wb.Box((size,) * 3), name="box", at=(3, 0, -1.9 + SKIN), body=body))
    slowing = mu * G * (size / np.sqrt(2.0)) / (size**2 / 6.0)  # rad/s2: torque over moment of inertia, per kg
    for k in range(1, 8):
        engine.advance(1 / 60)
        assert engine.twist("box")[5] == pytest.approx(max(0.0, spin - slowing * k / 60), abs=0.03)
    assert engine.placement("box").translation == pytest.approx([3.0, 0.0, -1.9 + SKIN], abs=1e-5)


def test_a_stack_of_ten_stands_and_sleeps(hand: wb.Figure) -> None:
    scene = floor(hand)
    for k in range(10):
        at = (3.0, 0.0, -1.9 + 0.2 * k + SKIN * (k + 1))
        scene.add(wb.Box((0.2, 0.2, 0.2)), name=f"box {k}", at=at, body=wb.Body())
    engine = RigidBodies(scene)
    frames = [engine.advance(1 / 60) for _ in range(120)]
    assert frames[-1].sleeping == 10
    assert max(frame.deepest for frame in frames) <= 1e-4
    for k in range(10):
        away = engine.placement(f"box {k}").translation - (3.0, 0.0, -1.9 + 0.2 * k)
        assert np.abs(away).max() < 2e-3


def test_what_overlaps_at_the_start_is_refused(hand: wb.Figure) -> None:
    scene = floor(hand).add(wb.Sphere(0.05), name="ball", at=(3, 0, -1.96), body=wb.Body())
    with pytest.raises(InputError, match="'floor' and 'ball' overlap by 10 mm at the start; move one of them away"):
        RigidBodies(scene)


def test_a_scene_without_bodies_is_refused(hand: wb.Figure) -> None:
    with pytest.raises(InputError, match="nothing in the scene moves by itself"):
        RigidBodies(floor(hand))


@pytest.mark.parametrize("dt", [0.0, 1e5, float("nan")])
def test_a_frame_that_would_not_end_is_refused(hand: wb.Figure, dt: float) -> None:
    scene = floor(hand).add(wb.Sphere(0.05), name="ball", at=(3, 0, 0), body=wb.Body())
    with pytest.raises(InputError, match=r"dt is .*give a"):
        RigidBodies(scene).advance(dt)


def test_what_is_taken_back_leaves_nothing_behind(hand: wb.Figure) -> None:
    """A box that slides at another one; the contacts it has are those of where it is again, and what follows too."""
    scene = floor(hand)
    for name, x, speed in (("sliding", 3.0, 2.0), ("still", 3.15, 0.0)):
        at, body = (x, 0.0, -1.95 + SKIN), wb.Body(velocity=(speed, 0.0, 0.0))
        scene.add(wb.Box((0.1, 0.1, 0.1)), name=name, at=at, body=body)
    engine = RigidBodies(scene)
    engine.advance(1 / 240)
    before = engine.contacts(["sliding"])
    told, back = (engine.energy(), engine.time, *engine.momentum()), engine.way_back()
    once = engine.advance(1 / 30)
    ended = engine.placement("still")
    back()
    after = engine.contacts(["sliding"])
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    assert (engine.energy(), engine.time, *engine.momentum()) == told
    twice = engine.advance(1 / 30)
    assert len(once.events) == len(twice.events) > 0
    np.testing.assert_allclose(engine.placement("still").homogeneous, ended.homogeneous, atol=1e-9)


@pytest.mark.parametrize("dt", [1.0 / 240.0, 1.0 / 120.0, 1.0 / 60.0])
def test_a_body_that_a_push_bears_stays_where_it_is_however_many_steps_a_frame_has(dt: float) -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 0.0), body=wb.Body(mass=2.0))
    scene.add(wb.Box((0.5, 0.5, 0.1)), name="lid", at=(1.0, 0.0, 0.1502))  # it rose to it by a part of the push
    engine = RigidBodies(scene)
    for _ in range(30):
        engine.push("ball", -dt * engine.weight("ball"), engine.centre("ball"))
        frame = engine.advance(dt, borne={"ball"})
        assert not frame.impulses
        assert engine.placement("ball").translation == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)
