"""What tests of whole problems use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb


def _least_distance(scene: wb.Scene, q: Any) -> float:
    """Least signed distance of all pairs, from Pinocchio's own loop."""
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.computeDistances(scene.model, data, scene.geometry, placed, q)
    return min((result.min_distance for result in placed.distanceResults), default=np.inf)


@pytest.fixture(scope="session")
def least_distance() -> Callable[..., float]:
    """Return a function: scene, posture -> least signed distance of all pairs."""
    return _least_distance
