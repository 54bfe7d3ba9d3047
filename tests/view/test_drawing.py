"""Surfaces and placements, against analytic volumes and scipy."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from wholebody.base.errors import InputError
from wholebody.geometry.placement import quaternions, steady
from wholebody.view import drawing
from wholebody.view.style import LOOK

directions = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda d: np.linalg.norm(d) > 1e-3)


def volume(vertices: Any, faces: Any) -> float:
    """Volume inside a closed surface by the divergence theorem; positive if the faces wind outwards."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_a_capsule_is_where_the_capsule_is() -> None:
    radius, half = 0.07, 0.2
    vertices, faces, normals = drawing.capsule_surface(radius, half)
    nearest = np.column_stack([np.zeros((len(vertices), 2)), np.clip(vertices[:, 2], -half, half)])
    np.testing.assert_allclose(np.linalg.norm(vertices - nearest, axis=1), radius, atol=1e-12)
    np.testing.assert_allclose(vertices - nearest, radius * normals, atol=1e-12)
    exact = np.pi * radius**2 * (2 * half + 4 / 3 * radius)
    assert 0.97 * exact < volume(vertices, faces) < exact


def test_a_cylinder_is_along_z() -> None:
    """Three.js has cylinders along y."""
    made = drawing.piece(coal.Cylinder(0.1, 0.6), "post", LOOK.figure)
    shape, matrix = made["geometries"][0], np.array(made["object"]["matrix"]).reshape(4, 4).T
    assert (shape["radiusTop"], shape["radiusBottom"], shape["height"]) == pytest.approx((0.1, 0.1, 0.6))
    np.testing.assert_allclose(np.abs(matrix @ (0.0, 0.3, 0.0, 1.0)), (0.0, 0.0, 0.3, 1.0), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)


def test_the_faces_of_a_hull_wind_outwards() -> None:
    cloud = np.random.default_rng(3).normal(size=(50, 3)) + 5.0
    points = coal.StdVec_Vec3s()
    points.extend(list(cloud))
    convex = coal.Convex.convexHull(points, True, None)
    found = volume(np.asarray(convex.points()), drawing.convex_faces(convex))
    assert found == pytest.approx(ConvexHull(cloud).volume, rel=1e-9)
    faces = coal.StdVec_Triangle()
    for number in range(convex.num_polygons):  # as a file may have them: some one way round, some the other
        corner = convex.polygons(number)
        order = (0, 2, 1) if number % 2 else (0, 1, 2)
        faces.append(coal.Triangle(*(corner[k] for k in order)))
    points = coal.StdVec_Vec3s()
    points.extend(list(np.asarray(convex.points())))
    mixed = coal.Convex(points, faces)
    assert volume(np.asarray(mixed.points()), drawing.convex_faces(mixed)) == pytest.approx(found, rel=1e-9)


@given(directions, st.floats(0.01, 2.0))
def test_an_arrow_points_where_it_should(direction: Any, length: float) -> None:
    start = np.array([1.0, -2.0, 3.0])
    placement = drawing.arrow_placement(start, direction, length)
    tip = placement @ (0.0, 0.0, 1.0, 1.0)
    np.testing.assert_allclose(tip[:3], start + length * direction / np.linalg.norm(direction), atol=1e-12)
    assert np.linalg.det(placement[:3, :3]) > 0
    gram = placement[:3, :3].T @ placement[:3, :3]
    np.testing.assert_allclose(gram, np.diag(np.diag(gram)), atol=1e-12)


def test_a_rod_joins_two_points_and_vanishes_between_equal_ones() -> None:
    start, end = np.array([0.1, 0.2, 0.3]), np.array([-1.0, 0.5, 0.3])
    placement = drawing.rod_placement(start, end, 0.01)
    assert placement is not None
    np.testing.assert_allclose(placement @ (0, 0, 1, 1), [*end, 1], atol=1e-12)
    np.testing.assert_allclose(placement @ (0, 0, 0, 1), [*start, 1], atol=1e-12)
    assert drawing.rod_placement(start, start, 0.01) is None


@given(directions, st.floats(-2.0, 2.0))
def test_the_plate_of_a_half_space_has_its_upper_face_in_the_plane(normal: Any, offset: float) -> None:
    normal = normal / np.linalg.norm(normal)
    placement = drawing.plate_placement(normal, offset)
    corners = np.array([[x, y, 0.5] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * LOOK.plate
    np.testing.assert_allclose((corners @ placement[:3, :3].T + placement[:3, 3]) @ normal, offset, atol=1e-12)


def test_a_geometry_that_cannot_be_drawn_is_named() -> None:
    with pytest.raises(InputError, match=r"spike.*Plane"):
        drawing.piece(coal.Plane(np.array([0.0, 0.0, 1.0]), 0.0), "spike", LOOK.figure)


def test_quaternions_of_a_turn_have_no_jumps() -> None:
    rng = np.random.default_rng(0)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    rotations = np.array([pin.exp3(angle * axis) for angle in np.linspace(0, 4 * np.pi, 200)])
    found = steady(quaternions(rotations))
    for rotation, q in zip(rotations, found, strict=True):
        np.testing.assert_allclose(pin.Quaternion(q).matrix(), rotation, atol=1e-12)
    assert np.abs(np.diff(found, axis=0)).max() < 0.1
    half = np.array([pin.exp3(np.pi * axis) for axis in np.eye(3)])
    for rotation, q in zip(half, quaternions(half), strict=True):
        np.testing.assert_allclose(pin.Quaternion(q).matrix(), rotation, atol=1e-9)
