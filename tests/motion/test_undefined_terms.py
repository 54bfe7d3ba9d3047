"""A constraint of one's own that is not finite where a method leads a clip: the clip stays, and the term is named."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb


class Near(wb.Constraint):
    """Finite at the original posture alone."""

    def __init__(self, part: str, start: np.ndarray | None = None) -> None:
        self.part, self.start = part, start

    def resolve(self, scene, start):
        return type(self)(self.part, start.copy())

    def _answer(self, part, state, usual):
        return usual * (np.nan if part == self.part and (state.q != self.start).any() else 1.0)

    def value(self, state):
        return self._answer("value", state, np.ones(1))

    def jacobian(self, state):
        return self._answer("jacobian", state, np.full((1, state.model.nv), 1e-9))


@pytest.mark.parametrize(
    ("method", "part"),
    [("trajectory", "value"), ("bisection", "value"), ("bisection", "jacobian")],
)
def test_the_clip_stays_and_the_term_is_named(method: str, part: str) -> None:
    figure = wb.load("hand")
    scene = wb.Scene(figure)
    tip = scene.state(figure.neutral).frame(figure.frame_id("right_index_tip")).translation
    scene.add(wb.Sphere(0.01), name="ball", at=tip)
    clip = wb.Clip(figure, np.array([figure.neutral] * 6), 0.05)
    freed = wb.avoid(clip, scene, method=method, constraints=[Near(part)])
    assert not freed.report.solved
    assert np.array_equal(freed.clip.q, clip.q)
    assert f"Near: its {part} has nan at a posture near frame " in freed.report.message
