"""The method "frames": what holds in one frame does not hold in the next one, and a foot passes the one that stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.avoider import Follower, Work
from wholebody.motion.frame_terms import FrameTerms

DT = 1 / 30


def test_a_foot_is_free_again_in_the_frame_after_its_stand(planar_arm: Callable[..., Figure]) -> None:
    """The tip is held in the first frame alone; where nothing is in the way, the second one is the original."""
    figure = planar_arm((0.5, 0.5))
    scene, q = wb.Scene(figure), np.array([[0.2, 0.4], [0.3, 0.5]])
    terms = FrameTerms(scene, q, DT, (), ((figure.segments[-1],), ()), ((np.zeros(3),), ()))
    follower = Follower(terms, 0.0, Work())
    np.testing.assert_allclose(follower.frame(0, q[0] + 0.1), q[0], atol=1e-3)
    np.testing.assert_allclose(follower.frame(1, q[0]), q[1], atol=2e-3)


def test_a_free_motion_beside_a_stand_that_ends_is_followed_without_lag(planar_arm: Callable[..., Figure]) -> None:
    """An arm presses into a block for some frames, and then leaves it fast."""
    figure = planar_arm((0.5, 0.5), radius=0.02)
    scene = wb.Scene(figure)
    scene.add(wb.Box((0.4, 0.1, 0.4)), name="block", at=(0.8, -0.12, 0.0))
    angle = np.concatenate([np.linspace(0.3, -0.12, 12), np.linspace(-0.12, 1.2, 8)[1:]])
    clip = wb.Clip(figure, np.stack([angle, np.zeros(len(angle))], axis=1), DT)
    found = wb.avoid(clip, scene, method="frames")
    assert found.report.before.colliding >= 2
    assert found.report.solved, found.report.message
    assert np.abs(found.clip.q - clip.q)[-3:].max() < 2e-3
