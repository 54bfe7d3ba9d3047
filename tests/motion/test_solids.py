"""Solids of many pieces against all pieces one by one."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.motion import solids
from wholebody.motion.solids import Solid, least_distance
from wholebody.motion.thing_contacts import said_of_many

POINT = coal.Sphere(1e-6)


def placed(rng: np.random.Generator, count: int) -> list[solids.Placed]:
    shapes = [coal.Box(0.1, 0.3, 0.05), coal.Sphere(0.08), coal.Capsule(0.05, 0.2), coal.Cylinder(0.1, 0.1)]
    return [(shapes[k % 4], pin.SE3(pin.SE3.Random().rotation, rng.uniform(-1.0, 1.0, 3))) for k in range(count)]


@pytest.mark.parametrize("count", [1, 60])
def test_distances_of_points_and_shapes_are_those_of_all_pieces(count: int) -> None:
    rng = np.random.default_rng(count)
    pieces = placed(rng, count)
    solid, others = Solid(pieces), placed(rng, 6)
    for point in [*rng.uniform(-1.2, 1.2, (60, 3)), *(at.translation for _, at in pieces)]:
        all_gaps = [least_distance([(POINT, pin.SE3(np.eye(3), point))], [piece]) for piece in pieces]
        gap, place, normal = solid.nearest(point)
        assert gap == pytest.approx(min(all_gaps), abs=2e-5)
        assert place + gap * normal == pytest.approx(point, abs=1e-4)
        within, _, _ = solid.nearest(point, 0.1)
        assert within == gap if gap <= 0.1 else within > 0.1
    for other in others:
        assert solid.distance([other]) == pytest.approx(least_distance([other], pieces), abs=1e-5)
    assert solid.distance(others) == pytest.approx(least_distance(others, pieces), abs=1e-5)


def test_few_pieces_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plate of 900 boxes: coal is asked for the few near a point, and not for each."""
    boxes = [(coal.Box(0.1, 0.1, 0.1), pin.SE3(np.eye(3), np.array([0.1 * k, 0.1 * j, 0.0]))) for k in range(30)
             for j in range(30)]  # fmt: skip
    solid, asked = Solid(boxes), 0
    real = coal.distance

    def counted(*arguments: object) -> float:
        nonlocal asked
        asked += 1
        return real(*arguments)

    monkeypatch.setattr(coal, "distance", counted)
    gap, place, normal = solid.nearest(np.array([1.03, 0.52, 0.25]))
    assert gap == pytest.approx(0.2, abs=1e-5)
    assert [*place, *normal] == pytest.approx([1.03, 0.52, 0.05, 0.0, 0.0, 1.0], abs=1e-4)
    assert solid.distance([(coal.Sphere(0.1), pin.SE3(np.eye(3), np.array([1.0, 0.5, 0.25])))]) == pytest.approx(0.1)
    assert asked <= 12


def test_what_a_vertical_line_meets_is_below() -> None:
    floor = (coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), pin.SE3.Identity())
    steps = [(coal.Box(1.0, 1.0, 0.2), pin.SE3(np.eye(3), np.array([float(k), 0.0, 0.2 * k]))) for k in range(4)]
    solid = Solid([floor, *steps])

    def numbers(place: tuple[float, float, float], deep: float) -> list[int]:
        found = solid.below(np.array(place), deep)
        return [k for k, each in enumerate([floor, *steps]) if any(each is one for one in found)]

    assert numbers((2.2, 0.1, 1.0), 2.0) == [0, 3]
    assert numbers((1.5, 0.1, 1.0), 2.0) == [0, 2, 3]  # on the edge of two
    assert numbers((2.2, 0.1, 1.0), 0.4) == [0]
    assert numbers((3.0, 0.0, 0.4), 2.0) == [0]  # below the highest step
    assert numbers((9.0, 0.0, 1.0), 2.0) == [0]


def test_a_scan_of_a_thousand_triangles_is_told() -> None:
    x, y = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(0.0, 1.0, 24)]))
    corners = np.stack([x, y, 0.3 + 0.1 * np.sin(7.0 * x) * np.cos(5.0 * y)], axis=1)
    first = (np.arange(23)[:, None] * 24 + np.arange(23)).ravel()
    faces = np.vstack(
        [np.stack([first, first + 1, first + 25], axis=1), np.stack([first, first + 25, first + 24], axis=1)]
    )
    scene = wb.Scene(wb.load("hand")).add(wb.Box((0.1, 0.1, 0.1)), name="box")
    assert said_of_many(scene) == ""
    scene.add(wb.Mesh((corners, faces)), name="scan", at=(3.0, 0.0, 0.0))
    assert said_of_many(scene).startswith("scan is 1058 pieces, which may take seconds a frame")
