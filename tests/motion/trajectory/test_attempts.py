"""Where motions between frames dip, and attempts that end early."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.dips import dips
from wholebody.motion.trajectory.sqp import Found, WindowProgram


def among_needles(planar_arm: Callable[..., Figure], shares: list[tuple[float, float]]) -> dict[int, list[float]]:
    """Dips of a straight arm that turns from 0 to 0.4 rad, past needles at shares of the way and distances."""
    figure = planar_arm((0.5, 0.5), radius=0.002)
    scene = wb.Scene(figure)
    for number, (share, reach) in enumerate(shares):
        at = (reach * np.cos(0.4 * share), reach * np.sin(0.4 * share), 0.0)
        scene.add(wb.Sphere(0.002), name=f"needle {number}", at=at)
    with scene.borrow() as workspace:
        return dips(workspace, np.array([[0.0, 0.0], [0.4, 0.0]]), [0])


def test_each_needle_passed_in_a_gap_is_told_where_the_arm_meets_it(planar_arm: Callable[..., Figure]) -> None:
    found = among_needles(planar_arm, [(0.27, 0.9), (0.71, 0.8)])
    assert sorted(found[0]) == pytest.approx([0.27, 0.71], abs=3e-3)


def test_needles_met_at_nearly_the_same_share_are_told_once(planar_arm: Callable[..., Figure]) -> None:
    assert among_needles(planar_arm, [(0.6, 0.9), (0.604, 0.7)])[0] == pytest.approx([0.602], abs=5e-3)


def test_attempts_that_end_early_are_begun_again(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = planar_arm((0.5, 0.5))
    clip = wb.Clip(figure, np.stack([np.linspace(-0.8, 0.8, 30), np.full(30, 0.5)], axis=1), 1 / 30)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.06), name="ball", at=(0.9, 0.1, 0.0))
    assert not wb.check(clip, scene).free
    run, ended = WindowProgram.run, []

    def hurried(self: WindowProgram, x: np.ndarray, *given: Any) -> Found:
        if not given[-1]:
            return run(self, x, *given)
        ended.append(x)
        return Found(x, 0.0, 1.0, met=False, programs=0, cancelled=False, early=True)

    monkeypatch.setattr(WindowProgram, "run", hurried)
    freed = wb.avoid(clip, scene, method="trajectory")
    assert len(ended) >= 2
    assert freed.report.message.startswith("nothing collides")
    assert wb.check(freed.clip, scene).free
