"""First contact on the way: against dense sampling, and through plates no sampling would see."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.reference.second_order import stays_above
from wholebody import InputError
from wholebody.base.arrays import Array
from wholebody.geometry.continuous import sweep as module
from wholebody.geometry.continuous.sweep import Sweep


class Arena:
    """An arm among thin plates, a ball and a floor; or the same arm flying."""

    def __init__(self, flying: bool) -> None:
        self.model, self.geometry = pin.Model(), pin.GeometryModel()
        joint = 0
        if flying:
            joint = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        kinds: list[Any] = [pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelPX(), pin.JointModelSpherical()]
        kinds += [pin.JointModelRUBX(), pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8]))]
        for k, kind in enumerate(kinds):
            at = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3 if k else 0.0]))
            joint = self.model.addJoint(joint, kind, at, f"joint{k}")
            self.add(joint, (coal.Capsule(0.04, 0.2), coal.Box(0.06, 0.08, 0.2))[k % 2], (0, 0, 0.15))
        moving = self.geometry.ngeoms
        self.add(0, coal.Box(0.001, 1.0, 1.0), (0.5, 0.0, 0.5))
        self.add(0, coal.Box(1.0, 1.0, 0.001), (0.0, 0.2, 1.3))
        self.add(0, coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), (0.0, 0.0, -0.4))
        self.add(0, coal.Sphere(0.15), (-0.5, 0.3, 0.8))
        for i in range(moving):
            for j in [*range(moving, self.geometry.ngeoms), *range(i + 2, moving)]:
                self.geometry.addCollisionPair(pin.CollisionPair(j, i) if (i + j) % 2 else pin.CollisionPair(i, j))
        self.data, self.results = self.model.createData(), pin.GeometryData(self.geometry)

    def add(self, joint: int, shape: Any, at: tuple[float, float, float]) -> None:
        name = f"piece{self.geometry.ngeoms}"
        self.geometry.addGeometryObject(pin.GeometryObject(name, joint, pin.SE3(np.eye(3), np.array(at, float)), shape))

    def distances(self, q: Array) -> Array:
        pin.computeDistances(self.model, self.data, self.geometry, self.results, q)
        return np.array([result.min_distance for result in self.results.distanceResults])


@pytest.mark.parametrize("flying", [False, True])
def test_against_dense_sampling(flying: bool) -> None:
    arena = Arena(flying)
    sweep = Sweep(arena.model, arena.geometry)
    rng = np.random.default_rng(3)
    free = touched = 0
    for _ in range(35):
        q0 = pin.integrate(arena.model, pin.neutral(arena.model), rng.normal(size=arena.model.nv) * 0.8)
        q1 = pin.integrate(arena.model, q0, rng.normal(size=arena.model.nv) * rng.choice([0.05, 0.3, 1.0]))
        found = sweep.first_contact(q0, q1)
        level = np.minimum(arena.distances(q0), 0.0) - 1e-4
        sampled = None
        for t in np.linspace(0, 1, 151):
            if (arena.distances(pin.interpolate(arena.model, q0, q1, t)) < level).any():
                sampled = t
                break
        if found is None:
            assert sampled is None
            free += 1
            continue
        touched += 1
        assert found.certain
        assert sampled is None or found.fraction <= sampled
        there = arena.distances(found.q)
        assert (there >= level - 1e-9).all()
        assert there[found.index] == pytest.approx(found.distance, abs=1e-9)
        assert there[found.index] <= level[found.index] + 0.51e-4
        assert np.allclose(found.q, pin.interpolate(arena.model, q0, q1, found.fraction), atol=1e-9)
        pair = arena.geometry.collisionPairs[found.index]
        assert found.pair == (pair.first, pair.second)
    assert free > 10
    assert touched > 10


@pytest.mark.parametrize("turn", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("length", [0.01, 0.3, 2.0, 200.0])
def test_a_plate_of_a_millimetre_is_never_passed(length: float, turn: float) -> None:
    model, geometry = pin.Model(), pin.GeometryModel()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    geometry.addGeometryObject(pin.GeometryObject("ball", 1, pin.SE3.Identity(), coal.Sphere(0.001)))
    plate = coal.Box(0.001, 500.0, 500.0)
    geometry.addGeometryObject(pin.GeometryObject("plate", 0, pin.SE3.Identity(), plate))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    for share in (0.1, 0.5, 0.987):
        q0, q1 = pin.neutral(model), pin.neutral(model)
        q0[0], q1[0] = -share * length, (1.0 - share) * length
        if share * length < 0.002 or (1.0 - share) * length < 0.002:
            continue
        q1[3:] = pin.Quaternion(pin.exp3(np.array([0.0, turn, 0.2 * turn]))).coeffs()
        found = Sweep(model, geometry).first_contact(q0, q1)
        assert found is not None
        assert found.certain
        assert found.q[0] == pytest.approx(-0.0015, abs=2e-4)


def sole(x: float = 0.0) -> tuple[pin.Model, pin.GeometryModel]:
    """Two boxes in a row, gliding over a floor and turning: a foot with toes."""
    model, geometry = pin.Model(), pin.GeometryModel()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    toe = model.addJoint(root, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0])), "toe")
    for name, joint in (("foot", root), ("toes", toe)):
        at = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.03]))
        geometry.addGeometryObject(pin.GeometryObject(name, joint, at, coal.Box(0.15, 0.1, 0.06)))
    floor = pin.SE3(np.eye(3), np.array([0.0, 0.0, x]))
    geometry.addGeometryObject(pin.GeometryObject("floor", 0, floor, coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)))
    step = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05]))
    geometry.addGeometryObject(pin.GeometryObject("board", 0, step, coal.Box(5.0, 5.0, 0.1)))
    for i in (0, 1):
        for j in (2, 3):
            geometry.addCollisionPair(pin.CollisionPair(i, j))
    return model, geometry


def test_sliding_on_the_floor_is_no_contact_and_is_soon_known(monkeypatch: pytest.MonkeyPatch) -> None:
    model, geometry = sole()
    monkeypatch.setattr(module, "MOST_QUERIES", 60)
    velocity = np.array([0.5, 0.3, 0.0, 0.0, 0.0, 0.4, 0.0])  # all in the plane: 0.6 m and 23 degrees
    q0 = pin.neutral(model)
    assert Sweep(model, geometry).first_contact(q0, pin.integrate(model, q0, velocity)) is None


def test_a_foot_that_rolls_into_the_floor_is_stopped() -> None:
    model, geometry = sole()
    q0 = pin.neutral(model)
    found = Sweep(model, geometry).first_contact(q0, pin.integrate(model, q0, np.array([0.1, 0, 0, 0, 0, 0, 0.2])))
    assert found is not None
    assert 1 in found.pair  # the toes
    assert -1e-4 <= found.distance <= -4e-5
    # The front edge of the toes, 75 mm before the joint, is 0.1 mm deep after 1.3 mrad of the 0.2 rad.
    assert found.fraction == pytest.approx(0.5e-4 / 0.075 / 0.2, rel=1.1)


def test_an_overlap_may_be_left_but_not_made_worse() -> None:
    model, geometry = sole(x=0.02)
    geometry.removeGeometryObject("board")
    sweep, q0 = Sweep(model, geometry), pin.neutral(model)
    up, down = np.zeros(7), np.zeros(7)
    up[2], down[2] = 0.1, -0.001
    assert sweep.first_contact(q0, pin.integrate(model, q0, up)) is None
    found = sweep.first_contact(q0, pin.integrate(model, q0, down))
    assert found is not None
    assert found.fraction == pytest.approx(0.075, abs=0.03)
    assert found.distance == pytest.approx(-0.02, abs=1.1e-4)


def test_giving_up_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    arena = Arena(flying=False)
    monkeypatch.setattr(module, "MOST_QUERIES", 2)
    rng = np.random.default_rng(0)
    q0 = pin.neutral(arena.model)
    found = Sweep(arena.model, arena.geometry).first_contact(q0, pin.integrate(arena.model, q0, rng.normal(size=8)))
    assert found is not None
    assert not found.certain
    level = np.minimum(arena.distances(q0), 0.0) - 1e-4
    for t in np.linspace(0, found.fraction, 200):
        assert (arena.distances(pin.interpolate(arena.model, q0, found.q, t)) >= level).all()


def test_compiled_loops_keep_pairs_apart_as_long_as_array_code() -> None:
    """Of all pairs at random postures, in all kinds of pieces; and no pair comes nearer than that in the time."""
    arena = Arena(flying=True)
    arena.add(6, coal.Ellipsoid(0.04, 0.05, 0.06), (0.1, 0.0, 0.2))
    arena.add(5, wb.Hull(np.random.default_rng(1).normal(size=(12, 3)) * 0.05).pieces()[0].geometry, (0.0, 0.1, 0.1))
    for extra in (10, 11):
        for thing in (6, 7, 8, 9):
            arena.geometry.addCollisionPair(pin.CollisionPair(thing, extra))
    sweep, rng, kept = Sweep(arena.model, arena.geometry), np.random.default_rng(5), 0
    arena.results = pin.GeometryData(arena.geometry)
    numbers = np.arange(len(sweep._pairs))
    for _ in range(15):
        q = pin.integrate(arena.model, pin.neutral(arena.model), rng.normal(size=arena.model.nv))
        velocity = rng.normal(size=arena.model.nv) * 10.0 ** rng.uniform(-2.0, 0.0)
        sweep._place(q, velocity)
        sweep._bounds.update(sweep._data, velocity, sweep._distances.placed[:, 3].copy())
        rows = sweep._distances.measured(numbers).copy()
        level = np.minimum(rows[:, 0], 0.0) - 1e-4
        mine = sweep._second_order(numbers, rows, level, np.zeros(len(numbers)))
        asked = zip(sweep._pairs.tolist(), rows, level, strict=True)
        wanted = [stays_above(sweep, *pair, row, low) for pair, row, low in asked]
        assert mine == pytest.approx(np.array(wanted), rel=1e-9, abs=1e-12)
        kept += int((mine > 0.0).sum())
        for share in (0.3, 0.7, 1.0):
            times = np.minimum(share * mine, 1.0)
            for number in rng.choice(np.flatnonzero(mine > 0.0), 4):
                there = arena.distances(pin.integrate(arena.model, q, times[number] * velocity))
                assert there[number] > level[number] - 2e-6
    assert kept > 100


def test_a_half_space_that_is_carried() -> None:
    model, geometry = pin.Model(), pin.GeometryModel()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "tilt")
    down = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    geometry.addGeometryObject(pin.GeometryObject("deck", 1, pin.SE3.Identity(), down))
    at = pin.SE3(np.eye(3), np.array([3.0, 0.0, 1.0]))
    geometry.addGeometryObject(pin.GeometryObject("ball", 0, at, coal.Sphere(0.1)))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    found = Sweep(model, geometry).first_contact(np.array([0.5]), np.array([-0.5]))
    assert found is not None
    angle = -(np.arctan2(1.0, 3.0) - np.arcsin(0.1 / np.sqrt(10.0)))
    assert found.q[0] == pytest.approx(angle, abs=1e-4)


def test_only_the_pairs_asked_for_and_things_that_moved() -> None:
    arena = Arena(flying=False)
    sweep, q0 = Sweep(arena.model, arena.geometry), pin.neutral(arena.model)
    q1 = pin.integrate(arena.model, q0, np.array([0, 1.5, 0, 0, 0, 0, 0, 0.0]))
    found = sweep.first_contact(q0, q1)
    assert found is not None
    thing = max(found.pair)
    others = [k for k, p in enumerate(arena.geometry.collisionPairs) if thing not in (p.first, p.second)]
    without = sweep.first_contact(q0, q1, np.array(others))
    assert without is None or thing not in without.pair
    arena.geometry.geometryObjects[thing].placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, -50.0]))
    moved = sweep.first_contact(q0, q1)
    assert (None if moved is None else moved.pair) == (None if without is None else without.pair)
    assert sweep.first_contact(q0, q0) is None
    assert sweep.first_contact(q0, q1, np.zeros(0, int)) is None


def test_joints_without_a_bound_are_refused() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelSphericalZYX(), pin.SE3.Identity(), "hip")
    with pytest.raises(InputError, match="hip"):
        Sweep(model, pin.GeometryModel())


def test_a_sweep_ends_with_its_time_and_says_so() -> None:
    scene = wb.Scene(wb.load("avatar"))
    start = scene.figure.posture("standing")
    there = start.copy()
    there[scene.model.joints[scene.figure.joint_id("right_shoulder_flexion")].idx_q] += 1.0
    sweep = scene.workspace().sweep
    assert sweep.first_contact(start, there) is None
    cut = sweep.first_contact(start, there, over=lambda: True)
    assert cut is not None
    assert not cut.certain
    assert 0.0 <= cut.fraction < 1.0
