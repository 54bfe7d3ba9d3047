"""The support polygon, by brute force and by scipy."""

from __future__ import annotations

import warnings
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay

import wholebody as wb
from wholebody import InputError
from wholebody.figures.state import State
from wholebody.tasks import Balance
from wholebody.tasks.balance import DOWN, convex_polygon, polygon, shrunk, standing_points
from wholebody.tasks.surfaces import outermost


def test_rows_are_positive_exactly_where_the_centre_of_mass_is_over_the_feet(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    balance = Balance(("lfoot", "rfoot")).resolve(humanoid, q)
    state = State(humanoid.model).update(q)
    corners = []
    for piece in humanoid.geometry.geometryObjects:
        place = state.data.oMi[piece.parentJoint] * piece.placement
        corners += [place.act(np.array([x, y, -0.02]))[:2] for x in (-0.12, 0.12) for y in (-0.05, 0.05)]
    # Inside by brute force: in one of the triangles that the corners span.
    triangles = Delaunay(np.array(corners))
    centre = state.center_of_mass()[:2].copy()
    rng = np.random.default_rng(0)
    seen = set()
    for shift in rng.uniform(-0.3, 0.3, size=(300, 2)):
        moved = q.copy()
        moved[:2] += shift
        inside = bool(triangles.find_simplex(centre + shift) >= 0)
        value = balance.value(state.update(moved))
        assert ((value >= balance.lower) & (value <= balance.upper)).all() == inside
        seen.add(inside)
    assert seen == {True, False}


def test_the_margin_is_metres_from_the_edge(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    balance = Balance(("lfoot", "rfoot"), margin=0.03).resolve(humanoid, q)
    np.testing.assert_array_equal(balance.lower, 0.03)
    state = State(humanoid.model)
    front = max(
        (state.update(q).data.oMi[piece.parentJoint] * piece.placement).act(np.array([0.12, 0.0, 0.0]))[0]
        for piece in humanoid.geometry.geometryObjects
    )
    moved = q.copy()
    moved[0] += front - state.center_of_mass()[0] - 0.03
    np.testing.assert_allclose(balance.value(state.update(moved)).min(), 0.03, atol=2e-6)


def test_nobody_stands_on_a_half_space_that_a_foot_carries() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    feet, q = ("left_foot", "right_foot"), scene.figure.neutral
    alone = standing_points(scene, q, feet)
    scene.attach(wb.HalfSpace(), to="left_foot", name="slope", at=(0.0, 0.0, -0.5))
    np.testing.assert_array_equal(standing_points(scene, q, feet), alone)
    scene.attach(wb.Box((0.3, 0.3, 0.1)), to="left_foot", name="clog", at=(0.0, 0.0, -0.3))
    assert standing_points(scene, q, feet)[:, 2].min() < alone[:, 2].min() - 0.1


def test_one_foot_is_a_smaller_polygon(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    state = State(humanoid.model).update(q)
    both = Balance(("lfoot", "rfoot")).resolve(humanoid, q).value(state)
    one = Balance(("lfoot",)).resolve(humanoid, q).value(state)
    assert one.min() < both.min()


def test_standing_on_corners_is_refused(humanoid: Any, random_posture: Any) -> None:
    q = random_posture(humanoid.model, np.random.default_rng(0))
    with pytest.raises(InputError, match="stand on a line"):
        Balance(("lfoot", "rfoot")).resolve(humanoid, q)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 40))
def test_convex_polygon_is_scipys_hull(seed: int, count: int) -> None:
    points = np.random.default_rng(seed).uniform(-0.2, 0.2, size=(count, 2))
    try:
        corners, normals, offsets, _ = convex_polygon(points)
    except InputError:
        assert count < 6
        return
    hull = ConvexHull(points)
    area = 0.5 * sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True))
    np.testing.assert_allclose(area, hull.volume, atol=1e-6)
    assert (points @ normals.T - offsets).min() > -2e-6
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


@pytest.mark.parametrize("points", [[(0, 0)] * 4, [(0, 0), (1, 1), (2, 2), (0.5, 0.5)], [(0, 0), (1, 0), (0.5, 1e-6)]])
def test_points_on_a_line_are_no_polygon(points: Any) -> None:
    with pytest.raises(InputError, match="stand on a line"):
        convex_polygon(np.array(points, dtype=float))


def test_shrinking_cuts_the_margin_off_every_side() -> None:
    square = polygon(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
    rest = shrunk(square, 0.2)
    np.testing.assert_allclose(sorted(map(tuple, rest.round(9))), [(0.2, 0.2), (0.2, 0.8), (0.8, 0.2), (0.8, 0.8)])
    assert len(shrunk(square, 0.51)) == 0
    triangle = convex_polygon(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]]))
    assert len(shrunk(triangle, 0.999)) > 0
    assert len(shrunk(triangle, 1.001)) == 0  # the inscribed circle of the 3-4-5 triangle has radius 1


@pytest.mark.parametrize(
    "geometry",
    [coal.Sphere(0.1), coal.Capsule(0.05, 0.3), coal.Box(0.1, 0.2, 0.3), coal.Ellipsoid(0.1, 0.2, 0.35)],
    ids=lambda geometry: type(geometry).__name__,
)
def test_low_points_touch_the_ground_first(geometry: Any) -> None:
    rng = np.random.default_rng(0)
    ground = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    for _ in range(20):
        placement = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3) + np.array([0.0, 0.0, 5.0]))
        result = coal.DistanceResult()
        there = coal.Transform3s(placement.rotation, placement.translation)
        height = coal.distance(geometry, there, ground, coal.Transform3s(), coal.DistanceRequest(), result)
        points = outermost(geometry, placement, DOWN)
        lowest = points[np.argmin(points[:, 2])]
        np.testing.assert_allclose(lowest[2], height, atol=1e-6)
        np.testing.assert_allclose(lowest[:2], result.getNearestPoint1()[:2], atol=1e-3)


def test_a_hand_that_touches_nothing_is_told_of() -> None:
    """Its balance was taken from a hand in the air, without a word; a `Touch` may bring it to what bears it."""
    person = wb.load("human")
    for feet in (["left_foot", "right_foot", "left_hand"], ["left_foot", "right_hand"]):
        for term in (Balance(feet), wb.ergonomics.LoadedBalance([], feet=feet)):
            with pytest.warns(UserWarning, match="touches nothing") as told:
                wb.Problem(wb.Scene(person), constraints=[term])
            assert [str(one.message).count("touches nothing") for one in told] == [1]
            assert repr(feet[-1]) in str(told[0].message)
    palm = person.placement(person.posture("standing"), "left_palm").translation
    desk = wb.Scene(person).add(wb.Box((0.3, 0.3, 0.02)), name="desk", at=(palm[0], palm[1], palm[2] - 0.16))
    with warnings.catch_warnings(record=True) as untold:
        wb.Problem(desk, constraints=[Balance(["left_foot", "right_foot", "left_hand"])])
    assert not untold
