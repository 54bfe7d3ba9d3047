"""Models of many pieces: the same as Pinocchio builds one piece after the other, and quickly."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.geometry import large_models
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.pieces import COAL_ACCURACY
from wholebody.geometry.proximity import SINGLY


def pieces(count: int) -> list[pin.GeometryObject]:
    """Random boxes and spheres, most of them in the world."""
    rng = np.random.default_rng(count)
    shapes = [coal.Sphere(0.1), coal.Box(0.1, 0.2, 0.3)]
    return [
        pin.GeometryObject(f"piece {k}", int(k < 3), 0, pin.SE3(np.eye(3), rng.normal(size=3)), shapes[k % 2])
        for k in range(count)
    ]


@pytest.mark.parametrize("count", [large_models.MANY - 1, large_models.MANY, 411])
def test_a_model_made_at_once_is_the_model_made_one_by_one(count: int) -> None:
    slow = pin.GeometryModel()
    for piece in pieces(count):
        slow.addGeometryObject(piece)
    fast = geometry_model(pieces(count))
    for model in (slow, fast):
        for second in range(3, count):
            model.addCollisionPair(pin.CollisionPair(1, second))
    assert fast == slow
    assert fast.saveToString() == slow.saveToString()
    assert fast.getGeometryId("piece 7") == 7
    assert fast.findCollisionPair(pin.CollisionPair(1, count - 1)) == count - 4


def test_a_pinocchio_that_writes_otherwise_is_served_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_models, "_tokens", lambda count, paired: ["no", "archive"] * (count + 1))
    made = geometry_model(pieces(large_models.MANY + 1))
    assert made.ngeoms == large_models.MANY + 1 == len(made.geometryObjects)


def test_contacts_among_a_thousand_things_are_those_of_coal_on_every_pair() -> None:
    rng = np.random.default_rng(0)
    scene = wb.Scene(wb.load("hand"))
    q = scene.figure.neutral
    center = scene.contacts(q, within=0.2).point_a.mean(axis=0)
    for k in range(250):
        scene.add(wb.Sphere(0.01), name=f"ball {k}", at=center + rng.uniform(-0.4, 0.4, 3))
    geometry = scene.geometry
    assert len(geometry.collisionPairs) > SINGLY
    data, results = scene.model.createData(), pin.GeometryData(geometry)
    pin.updateGeometryPlacements(scene.model, data, geometry, results, q)
    pin.computeDistances(geometry, results)
    every = np.array([result.min_distance for result in results.distanceResults])
    found = scene.contacts(q, within=0.05)
    assert sorted(found.number.tolist()) == np.flatnonzero(every < 0.05).tolist()
    np.testing.assert_allclose(found.distance, every[found.number], atol=COAL_ACCURACY)
