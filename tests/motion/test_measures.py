"""What is measured of clips: against motions whose measures are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.motion.measures import deviation, foot_sliding, jerk_ratio
from wholebody.motion.stance import foot_points, slid, sliding


def test_deviation_of_an_arm(planar_arm: Callable[..., Any]) -> None:
    """The second of two joints stands 0.5 m from the first: turning the first by 0.2 moves it along a chord."""
    figure = planar_arm([0.5, 0.5])
    before = wb.Clip(figure, np.zeros((4, 2)), 0.1)
    after = before.with_q(np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.0], [0.0, 0.0]]))
    found = deviation(before, after)
    assert found.angle == pytest.approx(np.sqrt(2 * 0.04 / 8))
    chord = 2 * 0.5 * np.sin(0.1)
    assert found.distance == pytest.approx(np.sqrt(2 * chord**2 / 8))


def test_the_root_counts_in_places_only(free_bodies: Callable[..., Any]) -> None:
    figure = wb.load("human")
    q = np.tile(figure.posture("standing"), (3, 1))
    moved = q.copy()
    moved[:, 1] += 0.1
    found = deviation(wb.Clip(figure, q, 0.1), wb.Clip(figure, moved, 0.1))
    assert found.angle == 0.0
    assert found.distance == pytest.approx(0.1)


def test_jerk_ratio(planar_arm: Callable[..., Any]) -> None:
    times = 0.02 * np.arange(20)
    clip = wb.Clip(planar_arm([0.5, 0.5]), np.column_stack([times**3, 0 * times]), 0.02)
    assert jerk_ratio(clip, clip.with_q(1.5 * clip.q)) == pytest.approx(1.5)
    still = clip.with_q(0.0 * clip.q)
    assert jerk_ratio(still, still) == 1.0
    assert jerk_ratio(still, clip) == np.inf


def test_a_point_slides_from_where_it_stood_first() -> None:
    path = np.zeros((12, 3))
    path[:, 0] = [0.0, 0.01, 0.02, 0.5, 1.0, 1.0, 1.0, 0.97, 0.98, 1.5, 2.0, 2.0]
    path[:, 2] = np.linspace(0.0, 1.0, 12)  # heights do not count
    stands = np.array([True] * 3 + [False] + [True] * 5 + [False] + [True] * 2)
    assert slid(path, stands) == (pytest.approx(0.03), 7)
    assert slid(path, np.zeros(12, dtype=bool)) == (0.0, 0)


def test_feet_of_a_person() -> None:
    figure = wb.load("human")
    assert set(foot_points(figure)) == {f"{side}_{point}" for side in ("left", "right") for point in POINTS}
    assert foot_points(wb.load("hand")) == ()
    q = np.tile(figure.posture("standing"), (40, 1))
    q[:, 0] += np.linspace(0.0, 0.05, 40)  # glides
    found = sliding(figure, q, 1 / 30)
    assert all(each.distance == pytest.approx(0.05) and each.stands.all() and each.at == 39 for each in found)


POINTS = ("heel", "ball", "toe_tip")


def test_sliding_is_what_was_not_there_before() -> None:
    figure = wb.load("human")
    q = np.tile(figure.posture("standing"), (40, 1))
    q[:, 0] += np.linspace(0.0, 0.05, 40)
    before = wb.Clip(figure, q, 1 / 30)
    aside, back = q.copy(), q.copy()
    aside[:, 1] += 0.1  # another place, but no more sliding
    assert foot_sliding(before, before.with_q(aside)) == pytest.approx(0.0, abs=1e-12)
    back[20:, 1] += 0.02
    assert foot_sliding(before, before.with_q(back)) == pytest.approx(0.02)


def test_clips_of_different_lengths_are_refused(planar_arm: Callable[..., Any]) -> None:
    clip = wb.Clip(planar_arm([0.5, 0.5]), np.zeros((4, 2)), 0.1, "wave")
    for measure in (deviation, jerk_ratio, foot_sliding):
        with pytest.raises(wb.InputError, match=r"wave has 3 frames .* wave 4 of .*; give two of the same"):
            measure(clip, clip[:3])
