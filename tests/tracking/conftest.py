"""What the tests of this room share: a small scene, and distances pair by pair in coal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coal
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
    """Least signed distance of all collision pairs, by Pinocchio's kinematics and one call of coal a pair."""

    def measure(scene: wb.Scene, q: Any) -> float:
        data = scene.model.createData()
        pin.forwardKinematics(scene.model, data, np.asarray(q))
        pieces = scene.geometry.geometryObjects
        places = [data.oMi[piece.parentJoint] * piece.placement for piece in pieces]
        turned = [coal.Transform3s(place.rotation, place.translation) for place in places]
        request = coal.DistanceRequest()
        return min(
            coal.distance(
                pieces[pair.first].geometry, turned[pair.first], pieces[pair.second].geometry, turned[pair.second],
                request, coal.DistanceResult(),
            )
            for pair in scene.geometry.collisionPairs
        )  # fmt: skip

    return measure
