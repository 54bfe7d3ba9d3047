"""Limbs that are tracked through the body: judged by points and formulas, without coal."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.assessment.motion import assess_motion
from wholebody.tracking import follow

ALONG, ACROSS = 21, 7  # points on a capsule's axis, and along each edge of a box


@pytest.fixture(scope="module")
def avatar() -> wb.Figure:
    return wb.load("avatar")


def spheres(shape: Any) -> tuple[Any, float]:
    """Balls that fill a capsule nearly, or points of a box: (k, 3) and a radius."""
    if isinstance(shape, coal.Capsule):
        heights = np.linspace(-shape.halfLength, shape.halfLength, ALONG)
        return np.column_stack([0.0 * heights, 0.0 * heights, heights]), shape.radius
    edge = np.linspace(-1.0, 1.0, ACROSS)
    return np.stack(np.meshgrid(edge, edge, edge), -1).reshape(-1, 3) * np.array(shape.halfSide), 0.0


def signed_distance(shape: Any, points: Any) -> Any:
    """From the surface of a capsule or box to points (k, 3) of its frame, negative inside."""
    if isinstance(shape, coal.Capsule):
        axis = np.clip(points[:, 2], -shape.halfLength, shape.halfLength)
        return np.linalg.norm(points - axis[:, None] * [0.0, 0.0, 1.0], axis=1) - shape.radius
    beyond = np.abs(points) - np.array(shape.halfSide)
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def sampled_depth(scene: wb.Scene, q: Any) -> float:
    """Depth of the deepest ball of any piece in any other piece that it may not enter: at most the true depth."""
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, np.asarray(q))
    pieces = scene.geometry.geometryObjects
    places = [data.oMi[piece.parentJoint] * piece.placement for piece in pieces]
    filled = [spheres(piece.geometry) for piece in pieces]
    deepest = 0.0
    for pair in scene.geometry.collisionPairs:
        for a, b in ((pair.first, pair.second), (pair.second, pair.first)):
            points, radius = filled[a]
            way = places[b].actInv(places[a])
            distance = signed_distance(pieces[b].geometry, points @ way.rotation.T + way.translation)
            deepest = max(deepest, radius - float(distance.min()))
    return deepest


def through_the_torso(avatar: wb.Figure) -> list[Any]:
    standing = avatar.posture("standing")
    across = {"flexion": 0.4, "rotation": 0.9, "abduction": -0.2}
    inside = {f"right_shoulder_{name}": value for name, value in across.items()} | {"right_elbow_flexion": 1.6}
    return [standing, avatar.with_joints(standing, inside), standing]


def test_no_limb_enters_the_body(avatar: wb.Figure) -> None:
    scene = wb.Scene(avatar)
    there, inside, back = through_the_torso(avatar)
    shares = np.sin(np.linspace(0.0, 0.5 * np.pi, 15)) ** 2
    tracked = [np.asarray(pin.interpolate(avatar.model, there, inside, share)) for share in shares]
    tracked = [*tracked, *[inside] * 3, *tracked[::-1], *[back] * 20]
    recording = follow(scene, wb.Clip(avatar, tracked, 1 / 60), overlap="ccd")
    assert sampled_depth(scene, inside) > 0.02
    assert sampled_depth(scene, inside) == pytest.approx(
        assess_motion(scene, np.array([inside]), 1.0).depth[0], rel=0.25
    )
    assert max(sampled_depth(scene, q) for q in recording.q[::6]) < 1e-3
    assert np.abs(pin.difference(avatar.model, recording.q[-1], back)).max() < 1e-3
