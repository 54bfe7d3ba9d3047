"""Spheres that fill solids, against volumes and distances known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.motion.sphere_filling import Spheres, fill_with_spheres
from wholebody.motion.worn_equipment import torus_mesh

RADIUS, TUBE = 0.13, 0.03


@pytest.fixture(scope="module")
def torus() -> wb.Mesh:
    return wb.Mesh(torus_mesh(RADIUS, TUBE))


def nearest(spheres: Spheres, point: np.ndarray) -> float:
    """Distance of a point from the nearest sphere; negative inside."""
    return float((np.linalg.norm(spheres.centers - point, axis=1) - spheres.radii).min())


def test_one_sphere_fills_a_ball() -> None:
    filling = fill_with_spheres(wb.Sphere(0.1), 1)
    assert np.linalg.norm(filling.shape.centers[0]) < 2e-3
    assert filling.shape.radii[0] == pytest.approx(0.1, abs=2e-3)
    assert filling.volume == pytest.approx(4 / 3 * np.pi * 1e-3, rel=0.02)
    assert filling.uncovered < 0.02
    assert filling.protrusion < 3e-3


def test_uncovered_volume_of_one_sphere_in_a_cube_is_that_of_the_lens_formula() -> None:
    """A ball at the centre of a cube of side s with s/2 < r < s/sqrt(2) loses six caps to the outside."""
    side = 0.2
    filling = fill_with_spheres(wb.Box((side, side, side)), 1)
    r = float(filling.shape.radii[0])
    assert side / 2 < r < side / np.sqrt(2)
    cap = r - side / 2
    caps = 6 * np.pi * cap**2 * (3 * r - cap) / 3
    ball = 4 / 3 * np.pi * r**3
    assert filling.uncovered == pytest.approx((side**3 - (ball - caps)) / side**3, abs=0.03)
    assert filling.outside == pytest.approx(caps / side**3, abs=0.03)
    center = np.abs(filling.shape.centers[0])
    assert center.max() < 6e-3  # half a cell
    assert filling.protrusion == pytest.approx(r - (side / 2 - center.max()), abs=1e-9)
    assert filling.uncovered_depth == pytest.approx(np.linalg.norm(side / 2 + center) - r, abs=1e-9)


def test_a_torus_keeps_its_hole_as_it_stands(torus: wb.Mesh) -> None:
    filling = fill_with_spheres(torus, 24)
    corner = np.pi / 12  # its sections and their polygons lie inside of the round torus
    assert filling.volume == pytest.approx(
        2 * np.pi**2 * RADIUS * TUBE**2 * np.sin(2 * corner) / (2 * corner), rel=0.06
    )
    assert nearest(filling.shape, np.zeros(3)) > 0.5 * (RADIUS - TUBE)
    assert filling.uncovered < 0.05


def test_a_torus_loses_its_hole_by_its_envelope(torus: wb.Mesh) -> None:
    filling = fill_with_spheres(torus, 24, envelope=True)
    assert filling.envelope
    assert nearest(filling.shape, np.zeros(3)) < 0.0
    inside = [nearest(filling.shape, np.array([x, y, 0.0])) for x in (-0.08, 0.0, 0.08) for y in (-0.08, 0.0, 0.08)]
    assert max(inside) < filling.uncovered_depth + 1e-9


def test_what_is_reported_bounds_what_points_of_the_surface_see(torus: wb.Mesh) -> None:
    """Points of the exact torus are no deeper uncovered than said; points of the spheres stand out no farther."""
    filling = fill_with_spheres(torus, 16)
    rng = np.random.default_rng(3)
    around, turn = rng.uniform(0, 2 * np.pi, (2, 500))
    tube = 0.93 * TUBE * np.sqrt(rng.uniform(0, 1, 500))  # within the polygons
    ring = RADIUS * np.cos(np.pi / 16) + tube * np.cos(turn)
    points = np.stack([ring * np.cos(around), ring * np.sin(around), tube * np.sin(turn)], axis=1)
    assert max(nearest(filling.shape, point) for point in points) <= filling.uncovered_depth + 3e-3
    way = rng.normal(size=(500, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    which = rng.integers(0, len(filling.shape.radii), 500)
    out = filling.shape.centers[which] + filling.shape.radii[which, None] * way
    beyond = np.hypot(np.hypot(out[:, 0], out[:, 1]) - RADIUS, out[:, 2]) - TUBE
    assert beyond.max() <= filling.protrusion + 1e-9


def test_more_spheres_fit_better_and_the_same_solid_has_the_same_ones() -> None:
    plate = wb.Box((0.025, 0.24, 0.32))
    few, again, many = (fill_with_spheres(plate, count) for count in (6, 6, 24))
    assert np.array_equal(few.shape.centers, again.shape.centers)
    assert np.array_equal(few.shape.radii, again.shape.radii)
    assert many.protrusion < few.protrusion
    assert many.outside < few.outside
    assert len(many.shape.pieces()) == 24


def test_an_open_mesh_has_no_inside_but_an_envelope() -> None:
    vertices = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]])  # two of the six sides
    mesh = wb.Mesh((vertices, faces))
    with pytest.raises(wb.InputError, match="not closed"):
        fill_with_spheres(mesh, 4)
    assert fill_with_spheres(mesh, 4, envelope=True).volume == pytest.approx(1e-3, rel=0.05)


def test_a_shape_without_triangles_is_refused() -> None:
    with pytest.raises(wb.InputError, match="HalfSpace cannot be filled"):
        fill_with_spheres(wb.HalfSpace(), 3)
