"""A person in spheres meets things as closely as one in hulls: answers are judged by coal on the hulls alone."""

import copy
import pickle
from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

INSIDE = 1e-4  # m: deeper than this a posture is inside something


def shelf(figure, seed):
    """A reach between two boards with a post beside the hand; the answer is among random places before the person."""
    rng = np.random.default_rng(seed)
    target = np.array([rng.uniform(0.35, 0.55), rng.uniform(-0.45, 0.1), rng.uniform(0.8, 1.4)])
    scene = wb.Scene(figure)
    scene.add(wb.Box((0.4, 0.8, 0.02)), name="board", at=target + [0.15, 0.0, -rng.uniform(0.05, 0.08)])
    scene.add(wb.Box((0.4, 0.8, 0.02)), name="top", at=target + [0.15, 0.0, rng.uniform(0.07, 0.12)])
    side = rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.08)
    scene.add(wb.Cylinder(0.02, 2.0), name="post", at=(target[0] - rng.uniform(0.05, 0.15), target[1] + side, 1.0))
    return wb.Problem(
        scene,
        goals=[wb.Point("right_index_tip", target)],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
    )


@pytest.fixture(scope="module")
def hulls():
    return wb.load("human", detail="hulls")


@pytest.fixture(scope="module")
def spheres():
    return wb.load("human", detail="spheres")


def deepest(hulls, things, q):
    """How deep the hulls are in things of the world at q, metres, by one call to coal a pair."""
    data, placed = hulls.model.createData(), hulls.geometry.createData()
    pin.updateGeometryPlacements(hulls.model, data, hulls.geometry, placed, q)
    found = 0.0
    for (number, piece), thing in product(enumerate(hulls.geometry.geometryObjects), things):
        at = coal.Transform3s(placed.oMg[number].rotation, placed.oMg[number].translation)
        for part in thing.shape.pieces():
            place = thing.placement * part.placement
            there = coal.Transform3s(place.rotation, place.translation)
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            found = max(found, -coal.distance(piece.geometry, at, part.geometry, there, request, result))
    return found


@pytest.mark.parametrize("method", ["qp", "newton", "ccd"])
def test_solved_reaches_are_free_by_the_hulls(spheres, hulls, method):
    problems = [shelf(spheres, seed) for seed in range(12 if method == "qp" else 3)]
    answers = [wb.solve(problem, method) for problem in problems]
    inside = [
        deepest(hulls, problem.scene.objects.values(), answer.q)
        for problem, answer in zip(problems, answers, strict=True)
        if answer.solved
    ]
    assert len(inside) >= len(problems) // 2, [answer.message for answer in answers]
    assert max(inside) < INSIDE
