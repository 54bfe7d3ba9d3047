"""Surfaces of fields whose volume and area are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from wholebody.figures.surface.fields import ball, ellipsoid, half_space, intersection, round_cone, union, without
from wholebody.figures.surface.nets import coarsened, triangles

LOW, HIGH = np.full(3, -0.2), np.full(3, 0.2)


def test_a_ball_has_its_volume_its_area_and_its_normals() -> None:
    found = triangles(ball((0.01, 0.0, 0.02), 0.1), LOW, HIGH, 0.01)
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=0.01)
    assert mesh.area == pytest.approx(4 * np.pi * 0.1**2, rel=0.01)
    outward = (found.vertices - [0.01, 0.0, 0.02]) / 0.1
    np.testing.assert_allclose(found.normals, outward, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-6)


def test_a_round_cone_is_the_hull_of_its_two_balls() -> None:
    a, b = np.array([0.0, 0.0, -0.05]), np.array([0.02, 0.03, 0.08])
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (2000, 3))
    shares = np.linspace(0.0, 1.0, 4001)
    centers, radii = a + shares[:, None] * (b - a), 0.06 + shares * (0.03 - 0.06)
    nearest = np.array([(np.linalg.norm(centers - point, axis=1) - radii).min() for point in points])
    np.testing.assert_allclose(round_cone(a, b, 0.06, 0.03)(points), nearest, atol=1e-6)
    np.testing.assert_allclose(round_cone(b, a, 0.03, 0.06)(points), nearest, atol=1e-6)


def test_a_ball_within_the_other_is_left_out() -> None:
    points = np.random.default_rng(2).uniform(-0.2, 0.2, (100, 3))
    large = ball((0.0, 0.0, 0.0), 0.1)(points)
    np.testing.assert_allclose(round_cone((0.0, 0.0, 0.0), (0.02, 0.0, 0.0), 0.1, 0.05)(points), large)
    np.testing.assert_allclose(round_cone((0.02, 0.0, 0.0), (0.0, 0.0, 0.0), 0.05, 0.1)(points), large)


def test_union_and_difference_divide_the_volume() -> None:
    first, second = ball((0.0, 0.0, 0.0), 0.1), half_space((0.0, 0.0, 0.03), (0.0, 0.0, 1.0))
    cap = np.pi * 0.07**2 * (3 * 0.1 - 0.07) / 3
    for field, volume in (
        (without(first, second), cap),
        (intersection(first, second), 4 / 3 * np.pi * 0.1**3 - cap),
        (union([first, ellipsoid((0.0, 0.0, 0.0), (0.02, 0.02, 0.03))]), 4 / 3 * np.pi * 0.1**3),
    ):
        found = triangles(field, LOW, HIGH, 0.008)
        mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
        assert mesh.volume == pytest.approx(volume, rel=0.02)


def test_a_smooth_union_only_adds() -> None:
    points = np.random.default_rng(3).uniform(-0.2, 0.2, (1000, 3))
    parts = [ball((-0.05, 0.0, 0.0), 0.07), ellipsoid((0.06, 0.0, 0.0), (0.08, 0.05, 0.04))]
    sharp, smooth = union(parts)(points), union(parts, 0.04)(points)
    assert (smooth <= sharp).all()
    assert (sharp - smooth).max() <= 0.01 + 1e-12


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.3, 0.2, 0.9)])
def test_the_edge_of_a_cut_is_sharp_on_a_coarse_grid(normal: tuple[float, float, float]) -> None:
    """A rod of radius 80 mm, cut off: its edge is an ellipse, and triangles of 20 mm keep to it."""
    radius, plane = 0.08, np.array(normal) / np.linalg.norm(normal)
    rod = round_cone((0.0, 0.0, -0.1), (0.0, 0.0, 0.15), radius, radius)
    found = triangles(rod, LOW, np.array([0.2, 0.2, 0.3]), 0.02, [half_space((0.0, 0.0, 0.03), normal)])
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    forth = [tuple(edge) for edge in mesh.edges.tolist()]
    assert sorted(forth) == sorted((b, a) for a, b in forth)  # closed
    angles = np.linspace(0.0, 2.0 * np.pi, 400)
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    edge = np.column_stack([x, y, 0.03 - (plane[0] * x + plane[1] * y) / plane[2]])
    _, distance, _ = trimesh.proximity.closest_point_naive(mesh, edge)
    sag = radius - np.sqrt(radius**2 - (0.5 * 1.5 * 0.02) ** 2)  # of a chord of one and a half cells
    assert distance.max() < 1.2 * sag
    points, _ = trimesh.sample.sample_surface(mesh, 4000, seed=1)
    beyond = np.maximum(rod(points), (points - [0.0, 0.0, 0.03]) @ plane)
    assert np.abs(beyond).max() < 0.003


@pytest.mark.parametrize("tilt", [0.2, 0.4, 0.6, 1.0])
def test_few_triangles_keep_the_wall_of_a_tube_at_its_cut_end(tilt: float) -> None:
    """A sleeve, and points 0.72 of its radius from its axis, 6 mm from its end: what it covers."""
    along = np.array([np.sin(tilt), 0.3 * np.sin(tilt), np.cos(tilt)])
    along /= np.linalg.norm(along)
    tube = round_cone(-0.3 * along, 0.2 * along, 0.04, 0.04)
    surface = triangles(tube, np.full(3, -0.4), np.full(3, 0.15), 0.02, [half_space((0.0, 0.0, 0.0), along)])
    first = np.cross(along, (0.0, 1.0, 0.0))
    first /= np.linalg.norm(first)
    turn = np.linspace(0.0, 2.0 * np.pi, 60)[:, None]
    within = -0.006 * along + 0.029 * (np.cos(turn) * first + np.sin(turn) * np.cross(along, first))
    few = trimesh.Trimesh(surface.vertices, coarsened(surface), process=False)
    a, b, c = np.moveaxis(few.triangles[None] - within[:, None, None], 2, 0)  # solid angles: van Oosterom and Strackee
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    ab, bc, ca = ((one * other).sum(-1) for one, other in ((a, b), (b, c), (c, a)))
    turned = np.arctan2((a * np.cross(b, c)).sum(-1), la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    np.testing.assert_allclose(turned, 2.0 * np.pi, atol=1e-6)
