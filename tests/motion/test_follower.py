"""What follows the original postures: what holds in one frame does not hold in the next one."""

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
