"""The judge of motions against coal asked pair by pair, and against motions whose figures are known."""

from __future__ import annotations

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.flesh import settle
from wholebody.assessment import motion as motion_assessment
from wholebody.assessment.motion import (
    assess_motion,
    deepened,
    frames_passed_through,
    pairs_along,
    velocities,
)

Arms = Callable[..., wb.Figure]


def test_distances_are_those_of_coal_asked_pair_by_pair() -> None:
    scene = wb.Scene(wb.load("avatar")).add(wb.Box((0.4, 0.4, 0.4)), name="box", at=(0.4, 0.0, 1.0))
    rng = np.random.default_rng(3)
    start, model, geometry = scene.figure.neutral, scene.model, scene.geometry
    postures = np.array([pin.integrate(model, start, 0.3 * rng.normal(size=model.nv)) for _ in range(3)])
    data, placed = model.createData(), pin.GeometryData(geometry)
    for q, pairs in zip(postures, pairs_along(scene, postures), strict=True):
        pin.updateGeometryPlacements(model, data, geometry, placed, q)
        settle(geometry, placed)
        places = [coal.Transform3s(place.rotation, place.translation) for place in placed.oMg]
        shapes = [piece.geometry for piece in geometry.geometryObjects]
        expected = [
            coal.distance(
                shapes[pair.first], places[pair.first], shapes[pair.second], places[pair.second],
                coal.DistanceRequest(), coal.DistanceResult(),
            )
            for pair in geometry.collisionPairs
        ]  # fmt: skip
        np.testing.assert_allclose(pairs.distance, expected, atol=1e-6)


@pytest.fixture
def beside_a_plate(planar_arm: Arms) -> wb.Scene:
    """Return an arm that swings in the plane z = 0, and a thin plate across its way."""
    return wb.Scene(planar_arm((0.4, 0.3))).add(wb.Box((0.6, 0.01, 0.2)), name="plate", at=(0.5, 0.0, 0.0))


def test_a_way_through_a_plate_is_seen_though_both_ends_are_free(beside_a_plate: wb.Scene) -> None:
    before, after = np.array([0.6, 0.0]), np.array([-0.6, 0.0])
    motion = np.array([before, after, after])
    judged = assess_motion(beside_a_plate, motion, 0.1)
    assert judged.depth.max() == 0.0
    assert judged.overlapping.max() == 0
    assert frames_passed_through(beside_a_plate, motion, 1e-3) == (1,)
    assert deepened(beside_a_plate, motion).tolist() == [np.inf, motion_assessment.DEPTHS[0]]


def test_a_thing_that_passes_through_a_resting_arm_is_seen_in_the_frame_in_which_it_does(planar_arm: Arms) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3))).add(wb.Box((0.1, 0.01, 0.2)), name="plate", at=(0.5, 0.4, 0.0))
    at = [pin.SE3(np.eye(3), np.array([0.5, y, 0.0])) for y in (0.4, 0.2, -0.2, -0.4)]
    assert frames_passed_through(scene, np.zeros((4, 2)), 1e-3, {"plate": at}) == (2,)


def test_a_joint_without_limits_has_jerk() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "turn")  # two coordinates, one degree of freedom
    angle = 2.0 * (0.01 * np.arange(8)) ** 3
    motion = np.column_stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(motion_assessment.jerk(model, motion, 0.01), 12.0, rtol=1e-6)


def test_limits_speeds_and_jerk_of_a_known_motion(planar_arm: Arms) -> None:
    """A joint that moves as a t^3 has the third derivative 6 a; a motion without acceleration has none."""
    scene, dt = wb.Scene(planar_arm((0.4, 0.3))), 0.01
    time = dt * np.arange(8)
    motion = np.column_stack([2.0 * time**3, 0.5 * time])
    judged = assess_motion(scene, motion, dt)
    np.testing.assert_allclose(judged.jerk, 12.0 / np.sqrt(2.0), rtol=1e-6)
    np.testing.assert_allclose(judged.velocity[:, 1], 0.5)
    assert judged.limit_violation == 0.0
    limit = float(scene.model.upperPositionLimit[0])
    assert assess_motion(scene, np.array([[limit + 0.1, 0.0]]), dt).limit_violation == pytest.approx(0.1)
    assert velocities(scene.model, motion[:1], dt).shape == (0, 2)
