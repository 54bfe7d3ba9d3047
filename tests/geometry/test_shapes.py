"""Shapes: analytic distances and volumes, and refusal of everything that coal cannot be trusted with."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from wholebody import InputError
from wholebody.geometry.hull import enclosing_ball, hull_piece
from wholebody.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Mesh, Shape, Sphere, Torus

Slack = Callable[..., float]
size = st.floats(0.01, 2.0)
seed = st.integers(0, 2**32 - 1)


def distance(first: Shape, at: pin.SE3, second: Shape, to: pin.SE3) -> float:
    (a,), (b,) = first.pieces(), second.pieces()
    poses = [coal.Transform3s(p.rotation, p.translation) for p in (at * a.placement, to * b.placement)]
    return float(
        coal.distance(a.geometry, poses[0], b.geometry, poses[1], coal.DistanceRequest(), coal.DistanceResult())
    )


def random_placement(rng: np.random.Generator, spread: float = 1.0) -> pin.SE3:
    return pin.SE3(Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3) * spread)


def segment_gap(p: Any, u: Any, q: Any, v: Any) -> float:
    """Distance of the segments p +- u and q +- v: a convex quadratic, least inside a square, on a side or a corner."""
    w = p - q
    a, b, c, d, e = u @ u, u @ v, v @ v, u @ w, v @ w
    places = [(s, t) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    places += [(s, np.clip((b * s + e) / c, -1.0, 1.0)) for s in (-1.0, 1.0)]
    places += [(np.clip((b * t - d) / a, -1.0, 1.0), t) for t in (-1.0, 1.0)]
    if a * c - b * b > 1e-14 * a * c:
        inner = np.array([b * e - c * d, a * e - b * d]) / (a * c - b * b)
        places += [tuple(inner)] if np.abs(inner).max() <= 1.0 else []
    return float(min(np.linalg.norm(w + s * u - t * v) for s, t in places))


@given(size, size, seed)
def test_spheres(coal_slack: Slack, r1: float, r2: float, number: int) -> None:
    rng = np.random.default_rng(number)
    at, to = random_placement(rng), random_placement(rng)
    expected = np.linalg.norm(at.translation - to.translation) - r1 - r2
    slack = coal_slack("formula", r1, r2, abs(expected))
    assert distance(Sphere(r1), at, Sphere(r2), to) == pytest.approx(expected, abs=slack)


@given(size, size, size, size, seed)
def test_capsules(coal_slack: Slack, r1: float, l1: float, r2: float, l2: float, number: int) -> None:
    rng = np.random.default_rng(number)
    at, to = random_placement(rng), random_placement(rng)
    gap = segment_gap(at.translation, at.rotation[:, 2] * l1 / 2, to.translation, to.rotation[:, 2] * l2 / 2)
    slack = coal_slack("formula", r1, l1, r2, l2, gap)
    assert distance(Capsule(r1, l1), at, Capsule(r2, l2), to) == pytest.approx(gap - r1 - r2, abs=slack)


@given(st.tuples(size, size, size), size, seed)
def test_box_and_sphere(coal_slack: Slack, sides: tuple[float, float, float], radius: float, number: int) -> None:
    rng = np.random.default_rng(number)
    at, to = random_placement(rng), random_placement(rng)
    excess = np.abs(at.actInv(to.translation)) - np.array(sides) / 2
    outside = float(np.linalg.norm(np.maximum(excess, 0.0)))
    expected = (outside if outside > 0 else excess.max()) - radius
    slack = coal_slack("formula", *sides, radius, abs(expected))
    assert distance(Box(sides), at, Sphere(radius), to) == pytest.approx(expected, abs=slack)


@given(st.tuples(size, size, size), seed)
def test_ellipsoid_above_a_half_space(coal_slack: Slack, axes: tuple[float, float, float], number: int) -> None:
    rng = np.random.default_rng(number)
    at, normal = random_placement(rng), rng.normal(size=3)
    space = HalfSpace(tuple(normal), 0.3)
    unit = normal / np.linalg.norm(normal)
    reach = np.linalg.norm(np.array(axes) * (at.rotation.T @ unit))
    expected = unit @ at.translation - 0.3 - reach
    slack = coal_slack("formula", *axes, abs(expected))
    assert distance(Ellipsoid(axes), at, space, pin.SE3.Identity()) == pytest.approx(expected, abs=slack)


@given(st.tuples(*[st.floats(0.1, 1.0)] * 3), st.sampled_from((0.01, 1.0, 100.0)), seed)
def test_ellipsoid_and_sphere(coal_slack: Slack, axes: tuple[float, float, float], scale: float, number: int) -> None:
    rng = np.random.default_rng(number)
    at, to = random_placement(rng, scale), random_placement(rng, scale)
    half, place = scale * np.array(axes), at.actInv(to.translation)
    assume(((place / half) ** 2).sum() > 1.1)
    # the nearest point x of the surface: place - x is along the normal, so x = half^2 place / (half^2 + t)
    off = brentq(lambda t: ((half * place / (half**2 + t)) ** 2).sum() - 1.0, 0.0, 1e4 * scale**2, rtol=1e-15)
    expected = np.linalg.norm(place - half**2 * place / (half**2 + off)) - 0.1 * scale
    found = distance(Ellipsoid(tuple(half)), at, Sphere(0.1 * scale), to)
    assert found == pytest.approx(expected, abs=coal_slack("ellipsoid", half.max(), 0.1 * scale, abs(expected)))


@settings(max_examples=20)
@given(seed, st.integers(4, 60))
def test_hull_keeps_what_was_given(number: int, count: int) -> None:
    rng = np.random.default_rng(number)
    points = rng.normal(size=(count, 3)) * 0.3
    assume(np.linalg.svd(points - points.mean(axis=0))[1].min() > 1e-3)  # thinner ones are refused
    points += rng.normal(size=3) * 5.0
    (piece,) = Hull(np.vstack([points, points])).pieces()
    kept = np.asarray(piece.geometry.points()) + piece.placement.translation
    reference = ConvexHull(points)
    assert np.allclose(np.unique(kept, axis=0), np.unique(points[reference.vertices], axis=0), atol=1e-12)
    assert piece.volume == pytest.approx(reference.volume, rel=1e-9)
    assert piece.geometry.computeVolume() == pytest.approx(reference.volume, rel=1e-9)  # triangles turned outwards


@settings(max_examples=20)
@given(seed, st.integers(4, 60))
def test_hull_distance_is_that_of_its_planes(coal_slack: Slack, number: int, count: int) -> None:
    rng = np.random.default_rng(number)
    points = rng.normal(size=(count, 3))
    hull = ConvexHull(points)
    inside = points.mean(axis=0)
    depth = -(hull.equations[:, :3] @ inside + hull.equations[:, 3]).max()
    found = distance(Hull(points), pin.SE3.Identity(), Sphere(0.01), pin.SE3(np.eye(3), inside))
    reach = float(np.linalg.norm(points - inside, axis=1).max())
    assert found == pytest.approx(-depth - 0.01, abs=coal_slack("iterated", reach, 0.01))


@settings(max_examples=20)
@given(seed, st.integers(1, 80), st.booleans())
def test_enclosing_ball_is_the_smallest(number: int, count: int, spherical: bool) -> None:
    rng = np.random.default_rng(number)
    points = rng.normal(size=(count, 3))
    if spherical:
        points /= np.linalg.norm(points, axis=1)[:, None]
    center, radius = enclosing_ball(points)
    gaps = np.linalg.norm(points - center, axis=1)
    assert gaps.max() <= radius + 1e-9
    touching = points[gaps > radius - 1e-7]
    # The ball is smallest exactly when its centre is a convex combination of the points it touches.
    from scipy.optimize import nnls

    weights, residual = nnls(np.vstack([(touching - center).T, np.ones(len(touching))]), np.array([0, 0, 0, 1.0]))
    assert residual < 1e-6 * max(radius, 1.0)
    assert weights.sum() == pytest.approx(1.0, abs=1e-6)


def test_volumes_and_conventions() -> None:
    assert Box((1, 2, 3)).pieces()[0].volume == 6.0
    assert Sphere(0.5).pieces()[0].volume == pytest.approx(math.pi / 6)
    assert Capsule(0.5, 2.0).pieces()[0].volume == pytest.approx(math.pi * (0.25 * 2.0 + 0.5**3 * 4 / 3))
    assert Ellipsoid((1, 2, 3)).pieces()[0].volume == pytest.approx(8 * math.pi)
    assert math.isinf(HalfSpace().pieces()[0].volume)
    capsule = Capsule(0.1, 1.0).pieces()[0].geometry
    assert (capsule.radius, capsule.halfLength) == (0.1, 0.5)
    assert all(shape.added_volume == 0.0 for shape in (Box((1, 1, 1)), Sphere(1), HalfSpace(), Hull(np.eye(4, 3))))
    below = distance(HalfSpace(), pin.SE3.Identity(), Sphere(0.1), pin.SE3(np.eye(3), np.array([0, 0, -1.0])))
    assert below == pytest.approx(-1.1)


def test_shapes_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Box((1, 1, 1)).size = (2, 2, 2)  # type: ignore[misc]
    points = np.random.default_rng(0).normal(size=(8, 3))
    hull = Hull(points)
    volume = hull.pieces()[0].volume
    points *= 2.0
    assert hull.pieces()[0].volume == volume
    with pytest.raises(ValueError, match="read-only"):
        hull.points[0] = 0.0
    assert Box((1, 2, 3)) == Box([1.0, 2.0, 3.0])  # type: ignore[arg-type]
    assert len({Sphere(1.0), Sphere(1), Sphere(2)}) == 2


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Box((1, 1)), "give 3 numbers"),  # type: ignore[arg-type]
        (lambda: Box("abc"), r"numbers of shape \(3,\)"),  # type: ignore[arg-type]
        (lambda: Box((1, NAN, 1)), "finite"),
        (lambda: Box((1, INF, 1)), "finite"),
        (lambda: Box((1, -1, 1)), "-1"),
        (lambda: Box((1, 1e-5, 1)), "0.0001"),  # coal reads its gaps as zero
        (lambda: Box((1, 2e4, 1)), "10000"),
        (lambda: Sphere(-0.1), "-0.1"),
        (lambda: Sphere(NAN), "nan"),
        (lambda: Sphere(None), "None"),  # type: ignore[arg-type]
        (lambda: Capsule(0.1, 0), "length"),
        (lambda: Capsule(0, 0.1), "radius"),
        (lambda: Ellipsoid((0.1, 0, 0.1)), "semi_axes"),
        (lambda: HalfSpace((0, 0, 0)), "direction"),
        (lambda: HalfSpace((0, 0, 1), INF), "finite"),
        (lambda: Hull([]), "shape"),  # type: ignore[arg-type]
        (lambda: Hull(np.zeros((9, 3))), "different"),
        (lambda: Hull(np.ones((9, 2))), "shape"),
        (lambda: Mesh(3), "pair"),  # type: ignore[arg-type]
        (lambda: Mesh((np.eye(3), [[0, 1, 3]])), "indices"),
        (lambda: Mesh((np.eye(3), [[0, 1, -1]])), "indices"),
        (lambda: Mesh((np.eye(3), [[0, 1, 1.5]])), "indices"),
        (lambda: Mesh((np.eye(3), np.zeros((0, 3), int))), "no triangles"),
        (lambda: Mesh((np.eye(3) * NAN, [[0, 1, 2]])), "vertex 0"),
        (lambda: Mesh((np.eye(3), [[0, 1, 2]]), scale=0.0), "scale"),
        (lambda: Mesh((np.eye(3), [[0, 1, 2]]), scale=1e6), "scale"),
        (lambda: Mesh((np.eye(3), [[0, 1, 2]]), up="x"), "up"),  # type: ignore[arg-type]
        (lambda: Mesh((np.eye(3), [[0, 1, 2]]), max_vertices=3).pieces(), "max_vertices"),
        (lambda: Mesh((np.eye(3), [[0, 1, 2]]), threshold=0.0).pieces(), "threshold"),
    ],
)
def test_bad_values_never_reach_coal(make: Any, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        make()


@settings(max_examples=20)
@given(seed, st.integers(1, 40), st.floats(0.0, 0.9e-4), st.integers(0, 2))
def test_flat_points_are_refused_before_coal_crashes(number: int, count: int, thickness: float, kind: int) -> None:
    rng = np.random.default_rng(number)
    points = rng.normal(size=(count, 3)) * np.array([[1, 1, 0], [1, 0, 0], [0, 0, 0]])[kind]
    points += rng.uniform(-0.5, 0.5, size=points.shape) * thickness / math.sqrt(3)
    turned = points @ Rotation.random(random_state=rng).as_matrix().T + rng.normal(size=3)
    with pytest.raises(InputError):
        Hull(turned)


@pytest.mark.parametrize("bad", [NAN, INF])
def test_points_that_are_not_finite_are_refused(bad: float) -> None:
    points = np.random.default_rng(0).normal(size=(9, 3))
    points[4, 1] = bad
    with pytest.raises(InputError, match="point 4"):
        hull_piece(points)


def test_thin_but_solid_is_taken() -> None:
    plate = Hull([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 2e-4)])  # type: ignore[arg-type]
    assert plate.pieces()[0].volume == pytest.approx(2e-4)


@pytest.mark.parametrize("place", [(0.9, 0.0, 0.1), (0.0, 0.0, 0.75), (0.2, 0.15, 0.0), (0.6, 0.6, 0.4)])
def test_cylinder_against_its_formula(place: tuple[float, float, float]) -> None:
    """Distance of a point from a cylinder of radius 0.4 and length 0.6, to the 0.12 % that the prism is larger."""
    (piece,) = Cylinder(0.4, 0.6).pieces()
    across, along = np.hypot(place[0], place[1]) - 0.4, abs(place[2]) - 0.3
    outside = float(np.hypot(max(across, 0.0), max(along, 0.0)))
    exact = outside if outside > 0.0 else max(across, along)
    assert _distance(piece, place) == pytest.approx(exact, abs=5e-4 + 1e-6)


@pytest.mark.parametrize("place", [(0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (0.2, 0.25, 0.1), (0.2974, 0.0392, 0.0)])
def test_torus_against_its_formula(place: tuple[float, float, float]) -> None:
    """Distance of a point from a ring of the radii 0.3 and 0.02."""
    exact = float(np.hypot(np.hypot(place[0], place[1]) - 0.3, place[2])) - 0.02
    pieces = Torus(0.3, 0.02).pieces()
    assert min(_distance(piece, place) for piece in pieces) == pytest.approx(exact, abs=5e-3)
    assert 0.0 < Torus(0.3, 0.02).added_volume < 0.1


def _distance(piece: Any, place: Any) -> float:
    at = coal.Transform3s(piece.placement.rotation, piece.placement.translation)
    point = coal.Transform3s(np.eye(3), np.array(place, dtype=float))
    result = coal.DistanceResult()
    return float(coal.distance(piece.geometry, at, coal.Sphere(1e-9), point, coal.DistanceRequest(), result))


def test_a_mesh_of_trimesh() -> None:
    mesh = trimesh.creation.box((0.2, 0.3, 0.4))
    shape = Mesh(mesh, scale=0.5)
    np.testing.assert_allclose(shape.vertices, 0.5 * mesh.vertices)
    assert sum(piece.volume for piece in shape.pieces()) == pytest.approx(0.003)
