"""Whether a step jumped over something, against dense sampling of the way."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.geometry.continuous.moved_pairs import QueryResult, far_moved
from wholebody.geometry.continuous.passing_through import first_passed, last_free, passes_through

WITHIN = 0.05


def placed(scene, q):
    with scene.borrow() as workspace:
        return QueryResult(workspace.near(q, WITHIN), WITHIN)


def doubted(scene, q0, q1):
    return far_moved(scene.pair_table, placed(scene, q0), placed(scene, q1))


def jumped(scene, q0, q1):
    before, after = placed(scene, q0), placed(scene, q1)
    with scene.borrow() as workspace:
        return passes_through(workspace, before, after, q0, q1)


def passed_first(scene, q0, q1, overlap=2e-4):
    before, after = placed(scene, q0), placed(scene, q1)
    with scene.borrow() as workspace:
        return first_passed(workspace, before, after, q0, q1, overlap)


def depth_on_the_way(scene, q0, q1, count=200):
    """Least distance of any pair at the start, at the end, and between."""
    data, results = scene.model.createData(), pin.GeometryData(scene.geometry)
    least = []
    for share in np.linspace(0.0, 1.0, count):
        q = pin.interpolate(scene.model, q0, q1, share)
        pin.computeDistances(scene.model, data, scene.geometry, results, q)
        least.append(min(result.min_distance for result in results.distanceResults))
    return least[0], least[-1], min(least)


def plate_and(free_bodies, shape, thickness=0.001):
    return wb.Scene(free_bodies(shape)).add(wb.Box((thickness, 2.0, 2.0)), name="plate")


@pytest.mark.parametrize("radius", [0.004, 0.03])
@pytest.mark.parametrize("thickness", [0.001, 0.02])
def test_a_fast_piece_through_a_plate_is_caught_at_any_length(free_bodies, radius, thickness):
    scene = plate_and(free_bodies, wb.Sphere(radius), thickness)
    q0, q1 = scene.figure.neutral, scene.figure.neutral
    for before in (radius + 0.5 * thickness + 1e-3, 0.04, 0.3):
        for beyond in (radius + 0.5 * thickness + 1e-3, 0.04, 0.3, 3.0):
            q0[0], q1[0] = -before, beyond
            assert len(doubted(scene, q0, q1)) == 1
            assert jumped(scene, q0, q1)
            assert jumped(scene, q1, q0)
            hit = passed_first(scene, q0, q1)
            surface = radius + 0.5 * thickness
            assert hit.pair in ((0, 1), (1, 0))
            assert -surface - 1e-9 <= hit.q[0] <= -surface + 4e-4


def test_a_slow_piece_is_not_doubted_and_one_that_goes_along_is_no_jump(free_bodies):
    scene = plate_and(free_bodies, wb.Sphere(0.03))
    q0, q1 = scene.figure.neutral, scene.figure.neutral
    q0[0], q1[0] = -0.04, -0.035
    q1[1] = 0.01
    assert len(doubted(scene, q0, q1)) == 0
    q1[1] = 0.5
    assert not jumped(scene, q0, q1)


def test_bumping_into_a_plate_is_no_jump(free_bodies):
    scene = plate_and(free_bodies, wb.Sphere(0.03), 0.1)
    q0, q1 = scene.figure.neutral, scene.figure.neutral
    q0[0], q1[0] = -0.3, -0.06
    assert not jumped(scene, q0, q1)
    assert passed_first(scene, q0, q1) is None


def test_no_jump_is_missed_by_an_arm_among_plates(planar_arm):
    """A long fast arm; whatever sampling sees inside a plate, with both ends of the way free, is a jump."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    for k, angle in enumerate((0.3, 1.9, 3.5)):
        turn = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, angle]))).coeffs()
        at = (0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.0, *turn)
        scene.add(wb.Box((0.5, 0.001, 0.3)), name=f"plate{k}", at=at)
    scene.add(wb.Sphere(0.01), name="bead", at=(-0.2, -0.7, 0.0))
    rng = np.random.default_rng(6)
    through = free = 0
    for _ in range(130):
        q0 = rng.uniform(-2.5, 2.5, 3)
        q1 = np.clip(q0 + rng.choice([0.1, 0.4, 1.0]) * rng.normal(size=3), -3.0, 3.0)
        first, last, least = depth_on_the_way(scene, q0, q1)
        if min(first, last) < 0.0:
            continue
        if least < -0.002:
            assert jumped(scene, q0, q1)
            assert passed_first(scene, q0, q1) is not None
            through += 1
        elif least > 0.0:
            assert not jumped(scene, q0, q1)
            assert passed_first(scene, q0, q1) is None
            free += 1
    assert min(through, free) > 10


def test_turning_bodies_are_judged_by_their_farthest_points(free_bodies):
    """A long rod that spins half a turn passes everything within its length."""
    scene = wb.Scene(free_bodies(wb.Capsule(0.01, 1.0))).add(wb.Sphere(0.01), name="bead", at=(0.4, 0.0, 0.0))
    q0, q1 = scene.figure.neutral, scene.figure.neutral
    q0[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, np.pi / 2 - 0.3, 0.0]))).coeffs()
    q1[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, np.pi / 2 + 0.3, 0.0]))).coeffs()
    first, last, least = depth_on_the_way(scene, q0, q1)
    assert min(first, last) > 0.05 > 0.0 > least
    assert jumped(scene, q0, q1)


@pytest.mark.parametrize("halvings", [1, 5, 12])
def test_the_end_is_free_and_as_near_to_the_wall_as_was_asked(halvings: int) -> None:
    model, wall, asked = pin.Model(), 0.7, []
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")

    def overlaps(q: np.ndarray) -> bool:
        asked.append(float(q[0]))
        return bool(q[0] > wall)

    q = last_free(model, np.array([0.0]), np.array([2.0]), overlaps, halvings)
    assert wall - 2.0 * 0.5**halvings <= q[0] <= wall
    assert len(asked) == halvings
