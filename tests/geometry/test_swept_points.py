"""Cores: points plus radius give back the support of the shape, faces hold it, reach contains it."""

from __future__ import annotations

import coal
import numpy as np
import pytest

import wholebody as wb
from wholebody.geometry.pieces import swept_points, swept_points_of

DIRECTIONS = np.random.default_rng(0).normal(size=(200, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
POINTS = np.random.default_rng(1).normal(size=(25, 3)) * (0.2, 0.1, 0.05)


def supports(shape):
    """Greatest n . x over a shape, from formulas, for all directions n."""
    d = DIRECTIONS
    if isinstance(shape, wb.Sphere):
        return np.full(len(d), shape.radius)
    if isinstance(shape, wb.Capsule):
        return shape.radius + 0.5 * shape.length * np.abs(d[:, 2])
    if isinstance(shape, wb.Box):
        return np.abs(d) @ np.array(shape.size) / 2
    if isinstance(shape, wb.Ellipsoid):
        return np.linalg.norm(d * shape.semi_axes, axis=1)
    if isinstance(shape, wb.Cylinder):  # a prism around it
        angles = 2 * np.pi * np.arange(64) / 64
        ring = shape.radius / np.cos(np.pi / 64) * np.column_stack([np.cos(angles), np.sin(angles)])
        return (d[:, :2] @ ring.T).max(axis=1) + 0.5 * shape.length * np.abs(d[:, 2])
    return (d @ (POINTS - shape.pieces()[0].placement.translation).T).max(axis=1)


SHAPES = [
    wb.Sphere(0.1),
    wb.Capsule(0.05, 0.3),
    wb.Box((0.4, 0.2, 0.1)),
    wb.Ellipsoid((0.3, 0.2, 0.1)),
    wb.Hull(POINTS),
    wb.Cylinder(0.05, 0.3),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_core_and_shape_have_the_same_support(shape):
    swept, expected = swept_points(shape.pieces()[0].geometry), supports(shape)
    if len(swept.points):
        assert (swept.points @ DIRECTIONS.T).max(axis=0) + swept.radius == pytest.approx(expected, abs=1e-12)
    assert swept.reach >= expected.max() - 1e-12
    assert swept.reach <= 1.8 * expected.max()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_width_is_the_least_distance_of_parallel_planes_around_it(shape):
    swept = swept_points(shape.pieces()[0].geometry)
    both = supports(shape) + supports_of_opposite(shape)
    assert swept.width <= both.min() + 1e-12
    assert swept.width >= 0.75 * both.min()


def supports_of_opposite(shape):
    if isinstance(shape, wb.Hull):
        centre = shape.pieces()[0].placement.translation
        return (-DIRECTIONS @ (POINTS - centre).T).max(axis=1)
    return supports(shape)


def test_many_pieces_have_each_their_own_in_the_order_given():
    sizes = [(0.4, 0.2, 0.1), (0.1, 0.3, 0.2)]
    first, second = (coal.Box(*size) for size in sizes)
    found = swept_points_of([second, coal.Sphere(0.1), first, coal.Capsule(0.05, 0.3), second])
    assert [len(each.points) for each in found] == [8, 1, 8, 2, 8]
    for each, size in ((found[0], sizes[1]), (found[2], sizes[0]), (found[4], sizes[1])):
        assert each.points.max(axis=0) - each.points.min(axis=0) == pytest.approx(size)
        assert each.faces[:3, 3] == pytest.approx(0.5 * np.array(size))
        assert (each.reach, each.width) == (pytest.approx(0.5 * np.linalg.norm(size)), min(size))


@pytest.mark.parametrize("shape", [SHAPES[2], *SHAPES[4:]], ids=["box", "hull", "cylinder"])
def test_faces_hold_the_core_points_and_are_touched_by_three(shape):
    swept = swept_points(shape.pieces()[0].geometry)
    height = swept.points @ swept.faces[:, :3].T - swept.faces[:, 3]
    assert height.max() < 1e-12
    assert (np.abs(height) < 1e-9).sum(axis=0).min() >= 3
    assert np.linalg.norm(swept.faces[:, :3], axis=1) == pytest.approx(1.0)
    assert len(np.unique(np.round(swept.faces, 6), axis=0)) == len(swept.faces)


def test_coplanar_triangles_are_one_face():
    cube = wb.Hull([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    assert len(swept_points(cube.pieces()[0].geometry).faces) == 6


def test_faces_of_a_wrongly_wound_hull_point_outwards():
    right = wb.Hull(POINTS).pieces()[0].geometry
    triangles = coal.StdVec_Triangle()
    for k in range(right.num_polygons):
        t = right.polygons(k)
        triangles.append(coal.Triangle(t[0], t[2], t[1]))
    points = coal.StdVec_Vec3s()
    points.extend(list(right.points()))
    swept = swept_points(coal.Convex(points, triangles))
    assert (swept.points @ swept.faces[:, :3].T - swept.faces[:, 3]).max() < 1e-12


def test_half_space_and_capsule_say_what_is_flat_about_them():
    half = swept_points(coal.Halfspace(np.array([0.0, 0.6, 0.8]), 0.3))
    assert half.faces == pytest.approx(np.array([[0.0, 0.6, 0.8, 0.3]]))
    assert (half.reach, half.width, len(half.points)) == (np.inf, np.inf, 0)
    capsule = swept_points(coal.Capsule(0.05, 0.3))
    assert sorted(capsule.faces[:, 2]) == [-1.0, 1.0]
    assert capsule.faces[:, 3] == pytest.approx(0.15)
    assert capsule.axis.tolist() == [0.0, 0.0, 1.0]


def test_other_geometries_are_refused():
    with pytest.raises(wb.InputError, match="Cone is not a convex piece"):
        swept_points(coal.Cone(0.1, 0.2))
