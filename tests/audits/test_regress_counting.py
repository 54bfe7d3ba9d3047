"""What is counted, on calls whose work is known."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits.regress.counting import counting, peak_bytes
from wholebody.assessment.all_pairs import AllPairs


def made(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Sphere(0.1)))
    return scene.add(wb.Sphere(0.2), name="ball", at=(0.0, 1.0, 0.0)), scene.figure.neutral


def test_passes_calls_and_pairs(free_bodies):
    scene, q = made(free_bodies)
    model, geometry = scene.model, scene.geometry
    data, results = model.createData(), pin.GeometryData(geometry)
    assert len(geometry.collisionPairs) == 3
    whole = pin.computeDistances, pin.forwardKinematics, AllPairs.move
    with counting() as counts:
        pin.forwardKinematics(model, data, q)
        pin.computeJointJacobians(model, data, q)
        pin.computeJointJacobians(model, data)  # of the pass before
        pin.updateGeometryPlacements(model, data, geometry, results)
        pin.computeDistances(geometry, results)
        results.deactivateCollisionPair(1)
        pin.computeDistances(geometry, results)
        pin.computeDistance(geometry, results, 0)
    assert (counts.passes, counts.calls, counts.pairs) == (2, 3, 3 + 2 + 1)
    assert (pin.computeDistances, pin.forwardKinematics, AllPairs.move) == whole
    pin.computeDistances(geometry, results)
    assert counts.pairs == 6


def test_what_the_assessment_asks_is_left_out(free_bodies):
    scene, q = made(free_bodies)
    problem = wb.Problem(scene, q)
    wb.assess(problem, q)
    scene.contacts(q)  # what both need is made
    with counting() as counts:
        wb.assess(problem, q)
        assert (counts.passes, counts.calls, counts.pairs) == (0, 0, 0)
        scene.contacts(q, within=10.0)
    assert (counts.passes, counts.pairs) == (1, 3)


def test_counting_ends_with_an_error(free_bodies):
    whole = pin.computeDistances
    with pytest.raises(ZeroDivisionError), counting():
        _ = 1 / 0
    assert pin.computeDistances is whole


def test_peak_bytes_are_those_of_the_call_alone():
    kept = np.zeros(100_000)
    assert 800_000 <= peak_bytes(lambda: np.zeros(100_000)) < 810_000
    assert peak_bytes(lambda: (np.zeros(50_000), None)[1] or np.zeros(50_000)) < 810_000
    assert peak_bytes(lambda: None) < 2_000
    assert len(kept) == 100_000
