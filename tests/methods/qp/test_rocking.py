"""Contact rows in a closed loop: bodies that are pushed onto each other do not rock into each other."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.methods.qp.settings import TRACKING

PUSHES = {
    "a corner down": wb.Point("body0", (0.0, 0.0, -0.1), offset=(0.2, 0.1, 0.0)),
    "tilted": wb.Frame("body0", (0.0, 0.0, 0.0, *pin.Quaternion(pin.exp3(np.array([0.5, 0.3, 0.1]))).coeffs())),
    "turned on an edge": wb.Frame(
        "body0", (0.1, 0.0, -0.05, *pin.Quaternion(pin.exp3(np.array([0.0, 0.9, 0.4]))).coeffs())
    ),
}
CLEARANCE = 0.005


def least_distance_while_pushed(free_bodies, push, solver="osqp"):
    """A free box over a table, pulled into it for 200 steps, back and forth."""
    scene = wb.Scene(free_bodies(wb.Box((0.4, 0.2, 0.1))))
    scene.add(wb.Box((0.6, 0.5, 0.1)), name="table", at=(0.0, 0.0, -0.05))
    scene.add(wb.Hull(np.array(list(itertools.product((-0.1, 0.1), repeat=3)))), name="block", at=(0.35, 0.0, 0.1))
    q = scene.figure.neutral
    q[:3] = -0.05, 0.0, 0.1
    problem = wb.Problem(scene, start=q, goals=[push], clearance=CLEARANCE)
    tracker = wb.methods.QP(solver).tracker(problem, 0.01)
    least = np.inf
    for _ in range(200):
        q = tracker.step(q).q
        least = min(least, distances(scene, q).min())
    return least


def distances(scene, q):
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.computeDistances(scene.model, data, scene.geometry, placed, q)
    return np.array([result.min_distance for result in placed.distanceResults])


@pytest.fixture(autouse=True)
def rows_alone(monkeypatch):
    """What is tested here is the rows alone: steps that turn are not looked at where they end."""
    for module in ("tracking", "turning"):
        monkeypatch.setattr(f"wholebody.methods.qp.{module}.TRACKING", TRACKING._replace(unseen=np.inf))


@pytest.mark.parametrize("push", PUSHES.values(), ids=PUSHES.keys())
def test_a_box_pushed_onto_a_table_does_not_rock_into_it(free_bodies, push):
    assert least_distance_while_pushed(free_bodies, push) >= 0.9 * CLEARANCE
