"""Bounds on jerk, speed and deviation: sines with known ratios, methods that jump, and ends that stay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

import wholebody as wb
from tests.freeing import begun
from wholebody.bench.measure.motion import synthetic
from wholebody.figures.figure import Figure
from wholebody.motion.avoider import MethodResult, Run
from wholebody.motion.measures import excess, jerk_ratio, resolved
from wholebody.motion.repair import smoothed

DT = 1 / 30
FRAMES = 90


def waves(figure: Figure, size: float) -> wb.Clip:
    """One joint that swings at 10 rad/s: speed and jerk are its size times known factors."""
    t = DT * np.arange(FRAMES)
    return wb.Clip(figure, np.stack([size * np.sin(10.0 * t), np.zeros(FRAMES)], axis=1), DT, "waves")


def everywhere(bounds: wb.motion.MotionBounds, count: int = FRAMES) -> wb.motion.MotionBounds:
    return resolved(bounds, np.ones(count, dtype=bool), np.zeros(count, dtype=bool))


def test_jerk_speed_and_deviation_of_sines_are_their_ratios(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5))
    before, after = waves(figure, 0.5), waves(figure, 0.9)
    found = excess(before, after, everywhere(wb.motion.MotionBounds(jerk=1.7, speed=1.9, deviation=0.3)))
    assert found.jerk == pytest.approx(1.8, rel=1e-9)
    assert found.speed == pytest.approx(1.8, rel=1e-9)
    assert found.deviation == pytest.approx(np.abs(before.q - after.q).max())
    assert [said.split()[0] for said in found.said] == ["jerk", "the"]
    assert not excess(before, before, everywhere(wb.motion.MotionBounds())).said
    assert not excess(before, after, everywhere(wb.motion.MotionBounds(None, None, None))).said


def test_one_jump_in_a_long_calm_clip_is_seen_where_it_is(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5))
    before = wb.Clip(figure, np.zeros((FRAMES, 2)), DT)
    q = before.q.copy()
    q[40:, 1] = 0.3
    found = excess(before, before.with_q(q), everywhere(wb.motion.MotionBounds()))
    assert len(found.said) == 2  # 9 rad/s, and its jerk; no deviation
    assert {40, 41} <= set(np.flatnonzero(found.beyond).tolist())
    assert not found.beyond[:28].any()
    assert not found.beyond[55:].any()


def test_what_a_method_leaves_rough_is_made_smooth(human: Figure) -> None:
    """Interpolated frames have kinks at their ends: without the bounds the jerk is 3.5 times the original's."""
    original, method = synthetic("squat", human), "bisection"
    rough = wb.avoid(original, method=method, constraints=[wb.motion.MotionBounds(None, None, None)])
    assert rough.report.solved
    assert jerk_ratio(original, rough.clip) > 3.0
    smooth = wb.avoid(original, method=method)
    assert smooth.report.solved, smooth.report.message
    assert smooth.report.smoothed
    assert jerk_ratio(original, smooth.clip) < 1.5
    assert wb.check(smooth.clip).free


@dataclass(frozen=True)
class Jumps:
    """Adds a jump to frames, where nothing collides."""

    first: int
    end: int
    by: float
    name: str = "jumps"
    clearance: float = 0.0
    dynamics: None = None

    def avoid(self, run: Run) -> MethodResult:
        q = np.array(run.clip.q)
        q[self.first : self.end, 1] += self.by
        run.watch.tell(1.0, "done")
        return MethodResult(q)


@pytest.mark.parametrize("jump", [Jumps(30, 31, 0.4)])
def test_a_jump_of_any_method_is_repaired(planar_arm: Callable[..., Figure], jump: Jumps) -> None:
    figure = planar_arm((0.5, 0.5))
    clip = waves(figure, 0.4)
    found = wb.avoid(clip, method=jump)
    assert found.report.solved, found.report.message
    np.testing.assert_allclose(found.clip.q, clip.q, atol=0.05)
    assert found.report.smoothed


def test_only_what_is_beyond_the_bounds_is_made_smooth(planar_arm: Callable[..., Figure]) -> None:
    """The whole clip is shifted by 0.2 rad, and one frame jumps: the window ends at frames that stay shifted."""
    figure = planar_arm((0.5, 0.5))
    clip = waves(figure, 0.4)
    shifted = clip.with_q(clip.q + np.array([0.0, 0.2]))
    q = np.array(shifted.q)
    q[30, 1] += 0.4
    with begun(clip, wb.Scene(figure)) as run:
        found, count = smoothed(run, q, everywhere(wb.motion.MotionBounds()))
    assert count == 1
    np.testing.assert_array_equal(found[60:], shifted.q[60:])
    assert not excess(clip, clip.with_q(found), everywhere(wb.motion.MotionBounds())).said
    assert np.abs(np.diff(found[:, 1])).max() < 0.05


def test_what_is_not_repaired_is_not_solved(planar_arm: Callable[..., Figure]) -> None:
    """The caller ends it after the method, so nothing is repaired."""
    clip = waves(planar_arm((0.5, 0.5)), 0.4)
    found = wb.avoid(clip, method=Jumps(70, FRAMES, 1.3), progress=lambda _: True)
    assert found.report.after.free
    assert not found.report.solved
    assert found.report.rough
    for said in ("jerk is", "speed is", "which was free and may move by 0.75, moved by 1.3"):
        assert said in found.report.message


@pytest.mark.parametrize("method", ["trajectory", "bisection"])
def test_ends_stay_where_they_are_free(planar_arm: Callable[..., Figure], method: str) -> None:
    """The ends are so near to the ball that the way around it changes them where they may change."""
    figure = planar_arm((0.5, 0.5), radius=0.02)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 0.0))
    q = np.stack([np.linspace(-0.8, 0.5, 16), np.full(16, 0.5)], axis=1)
    clip = wb.Clip(figure, q, DT)
    found = wb.avoid(clip, scene, method=method, keep_ends=True)
    assert found.report.before.colliding
    assert not found.report.before.depth[[0, -1]].any()
    np.testing.assert_array_equal(found.clip.q[[0, -1]], q[[0, -1]])
    assert found.report.solved, found.report.message


def test_an_end_that_collides_is_freed_all_the_same(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.02)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.95, 0.0, 0.0))
    q = np.stack([np.linspace(-0.6, -0.2, 24), np.full(24, 0.5)], axis=1)
    found = wb.avoid(wb.Clip(figure, q, DT), scene, keep_ends=True)
    assert found.report.before.depth[-1] > 0.0
    assert found.report.solved, found.report.message
