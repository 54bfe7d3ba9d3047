"""What is released suddenly is back at the tracked posture to 1 mrad within thirty frames, by both methods."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.tracking import FrameLoop

FACE = 0.55  # m: how far before the avatar's place the wall begins
IN_TIME = 30


@pytest.fixture(scope="module")
def avatar() -> wb.Figure:
    return wb.load("avatar")


def ahead(avatar: wb.Figure, x: float, elbow: float = 0.4) -> Any:
    """Both arms ahead, a little bent, the root at x."""
    bent = {"left_elbow_flexion": elbow, "right_elbow_flexion": elbow}
    q = avatar.with_joints(avatar.posture("arms_forward"), bent)
    q[0] = x
    return q


def step_back(avatar: wb.Figure) -> Any:
    return ahead(avatar, -0.25)


def arms_down(avatar: wb.Figure) -> Any:
    """The arms fall where the avatar stands, hands and wrists bent at the wall: a shoulder has to begin."""
    q = avatar.posture("standing")
    q[0] = 0.2
    return q


def arms_up(avatar: wb.Figure) -> Any:
    up = {"left_shoulder_flexion": 2.6, "right_shoulder_flexion": 2.6}
    q = avatar.with_joints(avatar.posture("standing"), up)
    q[0] = 0.2
    return q


@pytest.mark.parametrize(("overlap", "release"), [("ccd", step_back), ("qp", arms_down), ("qp", arms_up)])
def test_two_arms_come_back_from_a_wall(avatar: wb.Figure, overlap: str, release: Any, least_distance: Any) -> None:
    scene = wb.Scene(avatar).add(wb.Box((0.2, 3.0, 3.0)), name="wall", at=(FACE + 0.1, 0.0, 1.5))

    def away(q: Any) -> float:
        return float(np.abs(pin.difference(avatar.model, loop.shown, q)).max())

    loop = FrameLoop(scene, ahead(avatar, -0.25), overlap=overlap)
    assert not loop.frame(ahead(avatar, -0.25)).note
    for x in [*np.linspace(-0.25, 0.2, 20), *[0.2] * 5]:
        loop.frame(ahead(avatar, x))
        assert least_distance(scene, loop.shown) > -1e-3
    assert least_distance(scene, ahead(avatar, 0.2)) < -0.1
    assert away(ahead(avatar, 0.2)) > 0.1
    free = release(avatar)
    assert least_distance(scene, free) > 0.005
    for _ in range(IN_TIME):
        loop.frame(free)
        assert least_distance(scene, loop.shown) > -1e-3
    assert away(free) < 1e-3
