"""Goals of very different weights that can be met together: a tracker meets both as soon as with equal weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import wholebody as wb

ENOUGH = 1e-4  # m, rad
MOST = 20  # frames


def _frames(figure: wb.Figure, start: Any, goals: Sequence[Any]) -> int:
    """Frames until every goal is met."""
    scene = wb.Scene(figure)
    problem = wb.Problem(scene, start, goals=goals)
    tracker, q = wb.methods.Newton().tracker(problem, 1.0 / 60.0), problem.start
    for frame in range(1, MOST + 1):
        q = tracker.step(q).q
        state = scene.state(q)
        if all(np.linalg.norm(goal.error(state)) <= ENOUGH for goal in problem.goals):
            return frame
    return MOST + 1


def test_light_goals_are_met_as_soon_as_with_equal_weights(planar_arm: Callable[..., wb.Figure]) -> None:
    figure, rng = planar_arm((0.4, 0.35, 0.3, 0.2)), np.random.default_rng(8)
    for _ in range(3):
        start = rng.uniform(-0.8, 0.8, size=4)
        there = figure.placement(start + rng.uniform(-0.8, 0.8, size=4), "tip")
        frames = [
            _frames(
                figure,
                start,
                [wb.Point("tip", there.translation, weight=place), wb.Orientation("tip", there.rotation, weight=turn)],
            )
            for place, turn in ((1.0, 1.0), (1e6, 1.0), (1.0, 1e6), (1e3, 1.0))
        ]
        assert max(frames) <= 3 * frames[0] <= MOST


def test_goals_that_conflict_are_met_by_weight(planar_arm: Callable[..., wb.Figure]) -> None:
    """Two places for one tip: the answer lies between them, as the weights say."""
    figure = planar_arm((0.5, 0.4))
    scene, start = wb.Scene(figure), np.array([0.6, 0.7])
    tip = figure.placement(start, "tip").translation
    goals = [wb.Point("tip", tip + (0.05, 0.0, 0.0), weight=9.0), wb.Point("tip", tip - (0.05, 0.0, 0.0), weight=1.0)]
    tracker, q = wb.methods.Newton().tracker(wb.Problem(scene, start, goals=goals), 1.0 / 60.0), start
    for _ in range(10):
        q = tracker.step(q).q
    assert figure.placement(q, "tip").translation == pytest.approx(tip + (0.04, 0.0, 0.0), abs=1e-3)
