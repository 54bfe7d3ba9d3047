"""Reach cones against brute force on the sphere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wholebody.base.errors import InputError
from wholebody.figures import ReachCone, load
from wholebody.figures.human.figure import human_cones

NAMES = ("left_shoulder", "right_shoulder", "left_hip", "right_hip")


def random_directions(count, seed):
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


def winding(vertices, direction):
    """Angle that the polygon turns around a direction: 2 pi inside; arcs are followed in small steps."""
    helper = np.cross(direction, [0.3, 0.5, 0.81])
    e1 = helper / np.linalg.norm(helper)
    e2 = np.cross(direction, e1)
    points = []
    for a, b in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        for t in np.linspace(0, 1, 60, endpoint=False):
            points.append((1 - t) * a + t * b)
    points = np.array(points)
    angle = np.arctan2(points @ e2, points @ e1)
    step = np.diff(np.r_[angle, angle[0]])
    return ((step + np.pi) % (2 * np.pi) - np.pi).sum()


def boundary(cone, steps=2000):
    points = [
        (1 - t) * a + t * b
        for a, b in zip(cone.vertices, np.roll(cone.vertices, -1, axis=0), strict=True)
        for t in np.linspace(0, 1, steps, endpoint=False)
    ]
    points = np.array(points)
    return points / np.linalg.norm(points, axis=1)[:, None]


@pytest.mark.parametrize("name", NAMES)
def test_contains_agrees_with_counting_crossings_from_the_visible_point(name):
    cone = human_cones()[name].cone
    directions = random_directions(60, 1)
    # Inside is what an arc from the visible point reaches with an even number of crossings of the edges.
    edge = boundary(cone, 300)
    for direction in directions:
        if np.abs(edge @ direction).max() > np.cos(0.02):
            continue
        way = np.array([direction * (1 - t) + cone.visible * t for t in np.linspace(0, 1, 400)])
        if np.linalg.norm(way, axis=1).min() < 0.05:
            continue
        way /= np.linalg.norm(way, axis=1)[:, None]
        crossings = count_crossings(cone, way)
        assert cone.contains(direction) == (crossings % 2 == 0)


def count_crossings(cone, way):
    """How often a path of short arcs crosses the polygon's edges: by the signs of four determinants."""
    a, b = way[:-1, None, :], way[1:, None, :]
    p, r = cone.vertices[None], np.roll(cone.vertices, -1, axis=0)[None]
    n_path, n_edge = np.cross(a, b), np.cross(p, r)
    s1, s2 = (n_path * p).sum(-1), (n_path * r).sum(-1)
    s3, s4 = (n_edge * a).sum(-1), (n_edge * b).sum(-1)
    same_half = ((a + b) * (p + r)).sum(-1) > 0
    return int(((s1 * s2 < 0) & (s3 * s4 < 0) & same_half).sum())


@pytest.mark.parametrize("name", NAMES)
def test_visible_point_is_inside_and_its_antipode_is_not(name):
    cone = human_cones()[name].cone
    assert cone.contains(cone.visible)
    assert cone.contains([0.0, 0.0, -1.0])
    assert not cone.contains(-cone.visible)
    assert abs(abs(winding(cone.vertices, cone.visible)) - 2 * np.pi) < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_the_angle_agrees_with_a_dense_boundary(name):
    cone = human_cones()[name].cone
    directions, edge = random_directions(300, 2), boundary(cone)
    angle = np.array([cone.signed_angle(each)[0] for each in directions])
    assert np.abs(angle) == pytest.approx(np.arccos(np.clip((directions @ edge.T).max(axis=1), -1, 1)), abs=2e-5)


@settings(max_examples=20)
@given(st.sampled_from(NAMES), st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_gradient_is_the_derivative(name, vector):
    cone = human_cones()[name].cone
    direction = np.array(vector) / np.linalg.norm(vector)
    angle, gradient = cone.signed_angle(direction)
    assert abs(gradient @ direction) < 1e-9
    assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-9)
    tangent = np.linalg.svd(direction[None])[2][1:]
    h = 1e-5
    slopes = [
        (cone.signed_angle(direction + h * t)[0] - cone.signed_angle(direction - h * t)[0]) / (2 * h) for t in tangent
    ]
    # Across the line where another edge becomes the nearest the angle has a kink: there each one-sided slope counts.
    curved = [
        abs(cone.signed_angle(direction + h * t)[0] + cone.signed_angle(direction - h * t)[0] - 2 * angle)
        for t in tangent
    ]
    if max(curved) < 1e-8:
        assert slopes == pytest.approx([gradient @ t for t in tangent], abs=1e-4)


def test_on_the_edge_the_gradient_points_inwards():
    cone = human_cones()["right_hip"].cone
    middle = cone.vertices[0] + cone.vertices[1]
    middle /= np.linalg.norm(middle)
    angle, gradient = cone.signed_angle(middle)
    assert angle == pytest.approx(0.0, abs=1e-12)
    inside, _ = cone.signed_angle(middle + 1e-3 * gradient)
    assert inside == pytest.approx(1e-3, rel=1e-3)


def test_left_is_the_mirror_of_right():
    cones, directions = human_cones(), random_directions(200, 5)
    flipped = directions * [1, -1, 1]
    for joint in ("shoulder", "hip"):
        left, right = cones[f"left_{joint}"].cone, cones[f"right_{joint}"].cone
        for direction, mirrored in zip(directions, flipped, strict=True):
            assert left.signed_angle(direction)[0] == pytest.approx(right.signed_angle(mirrored)[0], abs=1e-12)


def test_spherical_triangle_of_an_octant():
    cone = ReachCone(np.eye(3), [1, 1, 1])
    directions = random_directions(500, 7)
    assert [cone.contains(each) for each in directions] == (directions > 0).all(axis=1).tolist()
    assert cone.signed_angle([0.0, 0.0, -1.0])[0] == pytest.approx(-np.pi / 2)


@pytest.mark.parametrize(
    ("vertices", "visible"),
    [
        (np.eye(3), [1, 1, -3]),
        (np.eye(3)[:2], [1, 1, 1]),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 0]], [1, 1, 1]),
        ([[1, 0, 0], [1, 0, 0], [0, 0, 1]], [1, 1, 1]),
        (np.eye(3), [np.nan, 1, 1]),
    ],
)
def test_polygons_that_are_none_are_refused(vertices, visible):
    with pytest.raises(InputError):
        ReachCone(vertices, visible)


def test_figure_says_where_its_cones_stand():
    figure = load("human")
    assert set(figure.cones) == set(NAMES)
    assert figure.cones["left_shoulder"].reference == "thorax"
    assert figure.cones["left_hip"].limb == "left_thigh"
