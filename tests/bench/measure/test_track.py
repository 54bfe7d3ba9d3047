"""The reach of the tools: the same at every call, possible where it should be, and impossible where it should be."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from wholebody.bench.measure.track import SETTING, VARIANTS, Track, smooth_way, track
from wholebody.bench.suite.problem_sets.case import numbers


def test_the_same_reach_is_made_at_every_call(short_free: Track) -> None:
    again = track("free", 8)
    assert (again.targets == short_free.targets).all()
    for name, thing in short_free.scene.objects.items():
        assert again.scene.objects[name].placement == thing.placement
    first, second = (
        [piece.geometry.computeVolume() for piece in each.scene.geometry.geometryObjects]
        for each in (short_free, again)
    )
    assert first == second


@pytest.mark.parametrize("name", VARIANTS)
def test_the_way_begins_at_the_fingertip_and_has_no_jumps(name: str) -> None:
    made = track(name, 200)
    assert made.targets.shape == (200, 3)
    model = made.scene.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, made.start)
    tip = data.oMf[made.scene.figure.frame_id(made.tip)].translation
    way = np.vstack([tip, made.targets])
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() / SETTING.dt < 3.0  # m/s
    assert np.linalg.norm(way[1] - tip) < 1e-4


def test_no_object_is_in_the_way_of_the_free_fingertip(short_free: Track) -> None:
    """A ball as large as a hand passes along the whole way (asked of coal, one object after the other)."""
    long_way = track("free", 100).targets
    ball = coal.Sphere(0.06)
    geometry = short_free.scene.geometry
    for piece in geometry.geometryObjects:
        if piece.parentJoint:
            continue
        place = coal.Transform3s(piece.placement.rotation, piece.placement.translation)
        for point in long_way:
            result = coal.DistanceResult()
            at = coal.Transform3s(np.eye(3), point)
            assert coal.distance(piece.geometry, place, ball, at, coal.DistanceRequest(), result) > 0.0


def test_the_contact_way_leads_into_the_block(short_contact: Track) -> None:
    given = numbers("step")
    inside = np.abs(short_contact.targets - given.block_at_m) < 0.5 * np.array(given.block_m)
    assert inside.all(axis=1).sum() >= 10
    assert not inside[-1].all()


def test_a_smooth_way_is_at_rest_at_both_ends_and_passes_its_places() -> None:
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.5]])
    way = smooth_way(places, 1000)
    assert np.allclose(way[-1], places[-1])
    assert np.linalg.norm(way[:, None] - places, axis=2).min(axis=0).max() < 2e-3
    speed = np.linalg.norm(np.diff(way, axis=0), axis=1)
    assert max(speed[0], speed[-1]) < 1e-4 * speed.max()
