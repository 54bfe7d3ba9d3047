"""How deep objects are in each other, by hand and by brute force."""

from __future__ import annotations

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wholebody import InputError
from wholebody.base.arrays import Array
from wholebody.geometry.minkowski import Placed
from wholebody.geometry.penetration import global_depth, least_separation, object_penetration, object_penetrations
from wholebody.geometry.shapes import Box, Capsule, Ellipsoid, HalfSpace, Hull, Shape, Sphere

seeds = st.integers(0, 2**32 - 1)


def placed(shape: Shape, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> list[Placed]:
    at = pin.SE3(np.eye(3), np.array([x, y, z]))
    return [(piece.geometry, at * piece.placement) for piece in shape.pieces()]


def deepest(a: list[Placed], b: list[Placed], translation: Array) -> float:
    """Depth of the deepest pair with A moved: a plain loop over coal."""
    depth = -np.inf
    for first, at in a:
        for second, to in b:
            result = coal.DistanceResult()
            pose = coal.Transform3s(at.rotation, at.translation + translation)
            coal.distance(
                first, pose, second, coal.Transform3s(to.rotation, to.translation), coal.DistanceRequest(), result
            )
            depth = max(depth, -result.min_distance)
    return depth


def shortest_way_out(a: list[Placed], b: list[Placed], rng: np.random.Generator, near: Array) -> float:
    """First free length along many directions, some near a given one; within its depth a pair cannot end."""
    directions = np.vstack([rng.normal(size=(150, 3)), near + 0.1 * np.linalg.norm(near) * rng.normal(size=(100, 3))])
    best = np.inf
    for direction in directions / np.linalg.norm(directions, axis=1)[:, None]:
        length = 0.0
        while length < best:
            depth = deepest(a, b, length * direction)
            if depth <= 1e-6:
                best = length
            length += max(depth, 1e-3)
    return best


def test_two_boxes() -> None:
    found = object_penetration("a", "b", placed(Box((1, 1, 1)), z=0.9), placed(Box((1, 1, 1))))
    assert found is not None
    assert (found.a, found.b, found.pairs, found.separated) == ("a", "b", 1, True)
    assert np.allclose(found.global_depth, [0, 0, 0.1], atol=1e-6)
    assert np.allclose(found.separation, [0, 0, 0.1], atol=1e-6)


def test_a_corner_by_hand() -> None:
    # A cube 0.1 deep in a floor and 0.2 deep in a wall: PD_g = (0.1^2 z + 0.2^2 x) / 0.3; the way out is both depths.
    corner = placed(Box((4, 4, 1)), z=-0.5) + placed(Box((1, 4, 4)), x=-0.5)
    found = object_penetration("box", "corner", placed(Box((1, 1, 1)), x=0.3, z=0.4), corner)
    assert found is not None
    assert found.pairs == 2
    assert np.allclose(found.global_depth, [0.04 / 0.3, 0, 0.01 / 0.3], atol=1e-6)
    assert np.allclose(found.separation, [0.2, 0, 0.1], atol=1e-6)


def test_opposed_normals_cancel_but_the_way_out_is_found() -> None:
    # Figure 4b: a bar between two walls, 0.05 deep in both. The estimate vanishes; the bar leaves along z.
    walls = placed(Box((0.2, 2, 1)), x=-0.55) + placed(Box((0.2, 2, 1)), x=0.55)
    found = object_penetration("bar", "walls", placed(Box((1.0, 0.3, 0.5))), walls)
    assert found is not None
    assert np.linalg.norm(found.global_depth) < 1e-6
    assert abs(found.separation[2]) == pytest.approx(0.75, abs=1e-6)
    assert found.separated


def test_global_depth_is_equation_1() -> None:
    rng = np.random.default_rng(5)
    depths, normals = rng.uniform(0, 1, 7), rng.normal(size=(7, 3))
    summed = sum(d * d * n for d, n in zip(depths, normals, strict=True)) / sum(depths)
    assert np.allclose(global_depth(depths, normals), summed)
    assert np.array_equal(global_depth(np.zeros(0), np.zeros((0, 3))), np.zeros(3))
    for bad in (([-1.0], [[0, 0, 1]]), ([np.nan], [[0, 0, 1]]), ([1.0], [[0, 0]]), ([1.0, 2.0], [[0, 0, 1]])):
        with pytest.raises(InputError):
            global_depth(*map(np.array, bad))


@given(seeds)
@settings(max_examples=20)
def test_the_estimate_of_one_pair_is_the_way_out(coal_slack: Callable[..., float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    clouds = [rng.normal(size=(10, 3)) for _ in range(2)]
    a, b = (placed(Hull(cloud)) for cloud in clouds)
    found = object_penetration("a", "b", a, b)
    slack = 2.0 * coal_slack("iterated", *(float(np.linalg.norm(cloud, axis=1).max()) for cloud in clouds))
    if found is not None:
        assert np.linalg.norm(found.global_depth) == pytest.approx(np.linalg.norm(found.separation), abs=slack)
        assert np.linalg.norm(found.separation) == pytest.approx(deepest(a, b, np.zeros(3)), abs=slack)


def heap(rng: np.random.Generator, round_pieces: bool) -> list[Placed]:
    pieces: list[Placed] = []
    for _ in range(3):
        shapes: tuple[Shape, ...] = (
            Sphere(0.1),
            Capsule(0.05, 0.2),
            Ellipsoid((0.05, 0.1, 0.15)),
            Box((0.2, 0.1, 0.3)),
        )
        shape = shapes[rng.integers(4)] if round_pieces else Hull(rng.normal(size=(8, 3)) * 0.1)
        at = pin.SE3(Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3) * 0.1)
        pieces += [(piece.geometry, at * piece.placement) for piece in shape.pieces()]
    return pieces


@pytest.mark.parametrize("round_pieces", [False, True])
@pytest.mark.parametrize("seed", range(1))
def test_no_shorter_way_is_found_by_brute_force(seed: int, round_pieces: bool) -> None:
    rng = np.random.default_rng(seed)
    a, b = heap(rng, round_pieces), heap(rng, round_pieces)
    found = object_penetration("a", "b", a, b)
    assert found is not None
    assert found.separated
    assert deepest(a, b, found.separation) < 3e-6
    length = float(np.linalg.norm(found.separation))
    brute = shortest_way_out(a, b, rng, found.separation)
    assert length < brute + 1e-5
    assert length > 0.85 * brute


def test_round_shapes_are_exact_where_one_knows() -> None:
    cases: list[tuple[list[Placed], list[Placed], float]] = [
        (placed(Sphere(0.3), x=0.1), placed(Sphere(0.2)), 0.4),
        (placed(Sphere(0.3)), placed(Sphere(0.2)), 0.5),  # concentric: any direction
        (placed(Sphere(0.1), z=0.02), placed(HalfSpace()), 0.08),
        (placed(HalfSpace()), placed(Sphere(0.1), z=0.02), 0.08),
        (placed(Capsule(0.1, 1.0), y=0.05), placed(Capsule(0.1, 1.0)), 0.15),
        (placed(Capsule(0.1, 1.0)), placed(Capsule(0.2, 1.0)), 0.3),  # on one axis: coal gives no normal
    ]
    for a, b, expected in cases:
        found = object_penetration("a", "b", a, b)
        assert found is not None
        assert found.separated
        assert np.linalg.norm(found.separation) == pytest.approx(expected, abs=1e-5)


def test_crossing_capsules_have_a_direction() -> None:
    lying = pin.SE3(Rotation.from_euler("x", 90, degrees=True).as_matrix(), np.zeros(3))
    (piece,) = Capsule(0.1, 1.0).pieces()
    found = object_penetration("a", "b", [(piece.geometry, lying)], placed(Capsule(0.1, 1.0)))
    assert found is not None
    assert np.allclose(np.abs(found.global_depth), [0.2, 0, 0], atol=1e-6)
    assert np.allclose(np.abs(found.separation), [0.2, 0, 0], atol=1e-5)


def test_what_cannot_be_taken_apart_is_said() -> None:
    ground, ceiling = placed(HalfSpace()), placed(HalfSpace((0, 0, -1), -0.1))
    found = object_penetration("ball", "slot", placed(Sphere(0.2), z=0.05), ground + ceiling)
    assert found is not None
    assert not found.separated
    assert np.isfinite(found.global_depth).all()


def test_apart_is_none_and_zero() -> None:
    a, b = placed(Box((1, 1, 1)), z=1.5), placed(Box((1, 1, 1)))
    assert object_penetration("a", "b", a, b) is None
    assert np.array_equal(least_separation(a, b).translation, np.zeros(3))


def test_owners_of_a_geometry_model() -> None:
    geometry = pin.GeometryModel()
    owners = ("table", "table", "box", "ball")
    things = [*placed(Box((2, 2, 0.1))), *placed(Box((0.1, 0.1, 1)), z=-0.5)]
    things += [*placed(Box((0.4, 0.4, 0.4)), z=0.22), *placed(Sphere(0.1), x=0.8, z=0.05)]
    for k, (shape, at) in enumerate(things):
        geometry.addGeometryObject(pin.GeometryObject(f"p{k}", 0, at, shape))
    for i, j in ((2, 0), (1, 2), (0, 3), (1, 3), (2, 3)):
        geometry.addCollisionPair(pin.CollisionPair(i, j))
    model, results = pin.Model(), pin.GeometryData(geometry)
    pin.updateGeometryPlacements(model, model.createData(), geometry, results, np.zeros(0))
    placements = np.array([[*at.rotation.T, at.translation] for at in results.oMg])
    found = object_penetrations(geometry, placements, owners, np.array([[2, 0], [0, 3]]))
    assert [(one.a, one.b) for one in found] == [("table", "ball"), ("table", "box")]
    assert np.allclose(found[0].separation, [0, 0, -0.1], atol=1e-5)
    assert np.allclose(found[1].separation, [0, 0, -0.03], atol=1e-5)


def test_pairs_that_may_overlap_do_not_count() -> None:
    a = placed(Box((1, 1, 1)), z=0.9)
    b = placed(Box((1, 1, 1))) + placed(Box((1, 1, 1)), z=0.5)
    found = object_penetration("a", "b", a, b, allowed=np.array([[True, False]]))
    assert found is not None
    assert found.pairs == 1
    assert np.allclose(found.separation, [0, 0, 0.1], atol=1e-6)
