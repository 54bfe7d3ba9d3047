"""Frames each for itself, against what trigonometry says of an arm beside a ball."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import wholebody as wb
from wholebody.bench.measure.motion.nearest import nearest
from wholebody.figures.figure import Figure

RADIUS, PLACE = 0.1, 0.9  # of the ball, and how far from the first joint it is
ARM = 0.02  # half the arm's thickness


def beside(figure: Figure) -> tuple[wb.Clip, wb.Scene, float]:
    """A clip of an arm of one joint that jumps into a ball, and the angle at which it touches the ball."""
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(RADIUS), name="ball", at=(PLACE, 0.0, 0.0))
    touches = float(np.arcsin((RADIUS + ARM) / PLACE))
    return wb.Clip(figure, np.array([[0.4], [0.05], [0.02], [0.5]]), 1 / 30), scene, touches


def test_each_frame_is_as_near_as_it_can_be_whatever_its_neighbours(planar_arm: Callable[..., Figure]) -> None:
    clip, scene, touches = beside(planar_arm((1.0,), radius=ARM))
    far = clip.with_q(np.array([[0.9], [0.9], [0.9], [0.9]]))
    farther = clip.with_q(np.array([[-0.9], [-0.9], [-0.9], [0.9]]))  # on the other side of the ball
    found = nearest(clip, scene, (), [farther, far])
    assert found is not None
    np.testing.assert_allclose(found.q[:, 0], [0.4, touches, touches, 0.5], atol=1e-3)


def test_no_answer_is_none(planar_arm: Callable[..., Figure]) -> None:
    clip, scene, _ = beside(planar_arm((1.0,), radius=ARM))
    assert nearest(clip, scene, (), []) is None


def test_joints_stay_within_their_limits(planar_arm: Callable[..., Figure]) -> None:
    clip, scene, touches = beside(planar_arm((1.0,), radius=ARM, limit=0.1))
    assert touches > 0.1
    within = clip.with_q(np.clip(clip.q, -0.1, 0.1))
    assert nearest(clip, scene, (), [within]) is None
