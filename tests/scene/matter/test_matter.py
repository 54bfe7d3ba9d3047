"""Materials, bodies and masses: against the paper's table and closed forms."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.scene.matter.body import MATERIALS, mass_properties, surface

TABLE = {
    ("wood", "wood"): (0.3, 0.3),
    ("wood", "human"): (0.2, 0.2),
    ("wood", "metal"): (0.2, 0.1),
    ("human", "human"): (0.1, 0.1),
    ("human", "metal"): (0.2, 0.1),
    ("metal", "metal"): (0.3, 0.1),
}


@pytest.mark.parametrize(("pair", "values"), TABLE.items())
def test_the_table_is_that_of_the_paper_both_ways(pair: tuple[str, str], values: tuple[float, float]) -> None:
    for one, other in (pair, pair[::-1]):
        assert tuple(surface(MATERIALS[one], MATERIALS[other])) == values


def test_a_material_of_ones_own_says_how_it_touches() -> None:
    rubber = wb.dynamics.Material("rubber", {"wood": (0.8, 0.9)}, others=(0.5, 0.6))
    assert tuple(surface(MATERIALS["wood"], rubber)) == (0.8, 0.9)
    assert tuple(surface(rubber, MATERIALS["metal"])) == (0.5, 0.6)
    assert tuple(surface(pickle.loads(pickle.dumps(rubber)), rubber)) == (0.5, 0.6)
    mend = r"neither material 'wood' nor 'ice' .* wb.dynamics.Material\('ice', others="  # wood is not the user's
    with pytest.raises(InputError, match=mend):
        surface(MATERIALS["wood"], wb.dynamics.Material("ice"))


@pytest.mark.parametrize(
    ("shape", "mass", "inertia"),
    [
        (wb.Box((0.2, 0.4, 0.6)), 48.0, [48 * 0.52 / 12, 48 * 0.40 / 12, 48 * 0.20 / 12]),
        (wb.Sphere(0.1), 4000 * np.pi / 3 * 1e-3, [4000 * np.pi / 3 * 1e-3 * 0.4 * 0.01] * 3),
        (
            wb.Ellipsoid((0.1, 0.2, 0.3)),
            4000 * np.pi / 3 * 6e-3,
            [4000 * np.pi / 3 * 6e-3 / 5 * s for s in (0.13, 0.10, 0.05)],
        ),
    ],
)
def test_masses_and_inertias_are_those_of_closed_forms(shape: wb.Shape, mass: float, inertia: list[float]) -> None:
    found = mass_properties(shape, wb.Body(density=1000.0))
    assert found.mass == pytest.approx(mass)
    assert found.inertia == pytest.approx(np.diag(inertia))
    assert found.centre == pytest.approx(np.zeros(3))


def test_a_capsule_is_a_cylinder_and_two_half_balls() -> None:
    r, length, density = 0.1, 0.4, 1000.0
    found = mass_properties(wb.Capsule(r, length), wb.Body(density=density))
    tube, balls = density * np.pi * r**2 * length, density * 4 / 3 * np.pi * r**3
    along = tube * r**2 / 2 + balls * 0.4 * r**2
    # a half ball's centre is 3/8 r above its face: 2/5 m r^2 + m (L^2/4 + 3/8 L r) for both
    across = tube * (r**2 / 4 + length**2 / 12) + balls * (0.4 * r**2 + length**2 / 4 + 3 / 8 * length * r)
    assert found.mass == pytest.approx(tube + balls)
    assert found.inertia == pytest.approx(np.diag([across, across, along]))


def test_hulls_and_meshes_of_a_box_away_from_their_origin_are_the_box() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 0.2) for y in (0.0, 0.4) for z in (0.0, 0.6)])
    hull = wb.Hull(corners)
    import trimesh

    box = trimesh.convex.convex_hull(corners)
    for shape in (hull, wb.Mesh((box.vertices, box.faces))):
        found = mass_properties(shape, wb.Body(mass=48.0))
        assert found.centre == pytest.approx([0.1, 0.2, 0.3])
        assert found.inertia == pytest.approx(np.diag([48 * 0.52 / 12, 48 * 0.40 / 12, 48 * 0.20 / 12]))


def test_a_half_space_cannot_move() -> None:
    scene = wb.Scene(wb.load("hand"))
    with pytest.raises(InputError, match="'ground' is a half-space, which has no finite mass and cannot move"):
        scene.add(wb.HalfSpace(), name="ground", body=wb.Body())
    assert not scene.objects
