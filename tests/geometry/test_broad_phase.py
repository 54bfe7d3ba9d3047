"""Pairs of boxes and of pieces against all pairs, one by one."""

from __future__ import annotations

from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
import pytest

from wholebody.geometry import broad_phase
from wholebody.geometry.broad_phase import box_pairs, near_among
from wholebody.geometry.proximity import PairTable


@pytest.mark.parametrize("count", [0, 1, 2, 60])
@pytest.mark.parametrize("at_once", [3, 1_000_000])
def test_pairs_of_boxes_are_those_of_all_pairs(count: int, at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broad_phase, "AT_ONCE", at_once)
    rng = np.random.default_rng(count)
    for _ in range(20):
        low = np.round(rng.uniform(-1.0, 1.0, (count, 3)), 1)  # some touch
        high = low + np.round(rng.uniform(0.0, 0.6, (count, 3)) * (1.0 + 9.0 * (rng.random((count, 1)) < 0.1)), 1)
        expected = {
            (i, j) for i, j in combinations(range(count), 2) if (low[i] <= high[j]).all() and (low[j] <= high[i]).all()
        }
        found = [tuple(pair) for pair in box_pairs(low, high).tolist()]
        assert len(found) == len(set(found))
        assert set(found) == expected


@pytest.mark.parametrize("within", [0.0, 0.05])
def test_near_pieces_are_those_of_coal_over_all_pairs(within: float) -> None:
    rng = np.random.default_rng(0)
    shapes = [coal.Sphere(0.1), coal.Box(0.2, 0.3, 0.1), coal.Capsule(0.05, 0.3), coal.Ellipsoid(0.1, 0.2, 0.15)]
    geometry, places = pin.GeometryModel(), []
    for k in range(60):
        quaternion = pin.Quaternion(*rng.normal(size=4)).normalized()
        at = pin.SE3(quaternion, rng.uniform(-0.6, 0.6, 3))
        shape = coal.Halfspace(np.array([0.0, 0.6, 0.8]), -0.3) if k in (20, 40) else shapes[k % 4]
        geometry.addGeometryObject(pin.GeometryObject(f"p{k}", 0, 0, at, shape))
        places.append(at)
    placements = np.array([[*at.rotation.T, at.translation] for at in places])
    pieces, group = np.arange(60), np.arange(60) // 2
    found = near_among(PairTable(pin.Model(), geometry), placements, pieces, group, within, [(3, 7)])
    expected = {}
    for i, j in combinations(range(60), 2):
        if group[i] == group[j] or (group[i], group[j]) == (3, 7) or {i, j} == {20, 40}:
            continue
        geometries = [geometry.geometryObjects[k].geometry for k in (i, j)]
        transforms = [coal.Transform3s(places[k].rotation, places[k].translation) for k in (i, j)]
        both = geometries[0], transforms[0], geometries[1], transforms[1]
        distance = coal.distance(*both, coal.DistanceRequest(), coal.DistanceResult())
        if distance < within:
            expected[i, j] = distance
    assert {tuple(sorted(pair)) for pair in found.pair.tolist()} == set(expected)
    assert len(expected) > 20
    assert (np.diff(found.distance) >= 0.0).all()
    for pair, distance in zip(found.pair.tolist(), found.distance, strict=True):
        assert distance == pytest.approx(expected[tuple(sorted(pair))], abs=1e-6)
    gaps = ((found.point_b - found.point_a) * found.normal).sum(axis=1)
    assert gaps == pytest.approx(found.distance, abs=1e-5)
