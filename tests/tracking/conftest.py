"""What the tests of this room share: a small scene, and distances of all pairs by Pinocchio."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

Least = Callable[[wb.Scene, Any], float]


@pytest.fixture(scope="session")
def hand() -> wb.Figure:
    return wb.load("hand")


@pytest.fixture
def scene(hand: wb.Figure) -> wb.Scene:
    """A hand above a thick table whose top is z = 0."""
    return wb.Scene(hand).add(wb.Box((2.0, 2.0, 0.3)), name="table", at=(0.0, 0.0, -0.15))


@pytest.fixture(scope="session")
def least() -> Least:
    """Least signed distance of all collision pairs, by Pinocchio's kinematics and distances, without a guess."""

    def measure(scene: wb.Scene, q: Any) -> float:
        data, results = scene.model.createData(), scene.geometry.createData()
        pin.computeDistances(scene.model, data, scene.geometry, results, np.asarray(q))
        return min(result.min_distance for result in results.distanceResults)

    return measure
