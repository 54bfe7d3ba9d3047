"""Impulses of a figure obey the laws of contact, and pairs are looked for as far as they can approach each other."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.dynamics.coupling import approaches
from wholebody.dynamics.impulse_kernel import add_bodies, by_inertia, impulses, mobilities, solve


def test_few_of_many_points_bear_what_the_laws_of_contact_ask() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(40, 40))
    inertia = root @ root.T + 5.0 * np.eye(40)
    rows = rng.normal(size=(3 * 60, 40))  # more than joints: most points part by the impulses of others
    speed, friction = rows @ rng.normal(size=40), rng.uniform(0.0, 0.8, 60)
    target = np.where(np.arange(60) < 20, 0.0, -4.0 - rng.uniform(size=60))
    impulse, after = impulses(mobilities(inertia, rows), speed, friction, target)
    assert np.abs(speed + rows @ by_inertia(inertia, rows.T @ impulse.ravel()) - after).max() < 1e-9
    normal, along = after[::3] - target, after.reshape(-1, 3)[:, 1:]
    bearing, room = impulse[:, 0], friction * impulse[:, 0] - np.linalg.norm(impulse[:, 1:], axis=1)
    assert bearing.min() >= 0.0
    assert room.min() > -1e-12
    assert 5 < (bearing > 0.0).sum() < 40
    assert normal.min() > -1e-5
    assert np.abs(normal[bearing > 0.0]).max() < 1e-5
    sticking = (bearing > 0.0) & (room > 1e-6)
    assert np.abs(along[sticking]).max(initial=0.0) < 1e-5
    sliding = (bearing > 0.0) & ~sticking & (friction > 0.0)
    against = (impulse[sliding, 1:] * along[sliding]).sum(axis=1)
    lengths = np.linalg.norm(impulse[sliding, 1:], axis=1) * np.linalg.norm(along[sliding], axis=1)
    assert np.allclose(against, -lengths, atol=1e-5)


def test_impulses_that_begin_at_others_end_at_the_same_velocities() -> None:
    """Without friction the velocities are those of a convex program, and do not depend on the start."""
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(3 * 20, 12))  # more points than freedoms: many impulses are right
    mobility, none = mobilities(np.eye(12), rows), np.zeros(20)
    speed = rows @ rng.normal(size=12)
    impulse, after = impulses(mobility, speed, none, none - 3.0)
    other, also = np.abs(rng.normal(size=(20, 3))), speed.copy()
    other[::3, 0] = 0.0
    solve(mobility, also, (none, none - 3.0), other, 1000, 1e-7)
    assert (impulse[:, 0] > 0.0).any()
    assert other[:, 0].min() >= 0.0
    np.testing.assert_allclose(also, after, atol=1e-4)
    np.testing.assert_allclose(speed + mobility @ other.ravel(), also, atol=1e-9)


def test_bodies_that_are_touched_add_their_mobilities() -> None:
    rng = np.random.default_rng(5)
    things, found = rng.normal(size=(12, 18)), np.eye(12)
    things[:6, 6:12] = 0.0  # some touch one of three bodies
    things[3:, :6] = 0.0
    root = rng.normal(size=(3, 6, 6))
    responses = root @ root.transpose(0, 2, 1)
    whole = np.zeros((18, 18))
    for b in range(3):
        whole[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = responses[b]
    add_bodies(found, things, responses)
    np.testing.assert_allclose(found, np.eye(12) + things @ whole @ things.T, atol=1e-12)


def test_distances_fall_no_faster_than_the_bound_of_their_pair() -> None:
    rng, short = np.random.default_rng(1), 1e-5
    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.3, 0.2, 0.1)), name="box", at=(0.6, 0.1, 1.0))
    work, tight = scene.workspace(), 0
    for _ in range(4):
        velocity = rng.normal(size=scene.model.nv)
        start = pin.integrate(scene.model, scene.figure.posture("standing"), 0.2 * rng.normal(size=scene.model.nv))
        before = work.near(start, 10.0)
        state = work.state
        twist = ((state.support * state.spread(velocity)) @ state.columns)[work.table.joint]
        bound = approaches(work.table, before.placements[:, 3], twist)
        after = work.near(pin.integrate(scene.model, start, short * velocity), 10.0)
        assert (before.number == after.number).all()
        falls = (before.distance - after.distance) / short
        assert (falls < bound[before.number] + 0.02).all()
        tight += int((falls > 0.5 * bound[before.number]).sum())
    assert tight > 50  # else the bound says little


def test_what_is_lifted_off_a_figure_takes_no_momentum_from_both() -> None:
    figure, rng = wb.load("avatar"), np.random.default_rng(142)
    way = rng.normal(size=3) * (1.0, 1.0, 0.3)
    way /= np.linalg.norm(way)
    place = np.array((0.0, 0.0, rng.uniform(0.3, 1.5))) + 0.9 * way
    body = wb.Body(mass=8.4, velocity=-7.4 * way)
    scene = wb.Scene(figure).add(wb.Box((0.15, 0.1, 0.12)), name="box", at=place, body=body)
    limp = wb.Actuated(figure, stiffness=0.0, damping=0.0)
    world = wb.World(scene, figure.posture("standing"), spring=limp)
    mass = pin.computeTotalMass(figure.model) + 8.4

    def momentum() -> np.ndarray:
        own = pin.computeCentroidalMomentum(figure.model, figure.model.createData(), world.q, world.velocity)
        return own.linear + 8.4 * world.engine.twist("box")[:3] + (0.0, 0.0, 9.81 * mass * world.time)  # type: ignore[union-attr]

    began = momentum()
    for _ in range(10):
        world.step()
    assert np.abs(momentum() - began).max() < 1e-8  # it missed 10 mN s of 62 N s
