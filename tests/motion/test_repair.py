"""Repair of postures that are nearly free: dips, holds that are missed, and what stays as it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import wholebody as wb
from tests.freeing import begun
from wholebody.figures.figure import Figure
from wholebody.motion.avoider import AvoidProgress
from wholebody.motion.repair import repaired

DT = 1 / 30


def swing(figure: Figure, frames: int = 40) -> wb.Clip:
    return wb.Clip(figure, np.stack([np.linspace(-1.45, 0.95, frames), np.full(frames, 0.5)], axis=1), DT)


def mended(clip: wb.Clip, scene: wb.Scene, q: np.ndarray, *terms: wb.Hold) -> tuple[np.ndarray, int]:
    with begun(clip, scene, terms) as run:
        return repaired(run, q), run.work.programs


def test_a_needle_between_two_frames_is_passed_beside_and_far_frames_stay(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.002)
    clip, scene = swing(figure), wb.Scene(figure)
    scene.add(wb.Sphere(0.002), name="needle", at=(0.971, 0.0, 0.0))
    before = wb.check(clip, scene)
    assert (before.colliding, before.dips) == (0, 1)
    q, programs = mended(clip, scene, clip.q)
    assert programs > 0
    assert wb.check(clip.with_q(q), scene).free
    gap = int(np.argmax(before.between))
    far = np.abs(np.arange(len(clip)) - gap) > 24  # the widest window that is tried
    np.testing.assert_array_equal(q[far], clip.q[far])


def test_a_limb_that_goes_right_through_is_kept_on_one_side_before_rows_are_tried(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No rows free it: twenty programs were solved in vain."""
    monkeypatch.setattr("wholebody.motion.repair.ClipRun", None)
    shoulder = np.concatenate([np.linspace(-0.9, -0.3, 20), np.linspace(0.3, 0.9, 20)])
    figure = planar_arm((0.5, 0.5), radius=0.03)
    clip, scene = wb.Clip(figure, np.stack([shoulder, np.full(40, 0.1)], axis=1), DT), wb.Scene(figure)
    scene.add(wb.Sphere(0.04), name="pole", at=(0.9, 0.0, 0.0))
    before = wb.check(clip, scene)
    assert (before.colliding, before.dips) == (0, 1)
    assert before.deepest_between > 0.06
    q, _ = mended(clip, scene, clip.q)
    assert wb.check(clip.with_q(q), scene).free


def test_the_caller_ends_it_while_frames_are_kept_on_one_side(planar_arm: Callable[..., Figure]) -> None:
    """A clip of 200 frames on the wrong side of a pole, of which each is followed."""
    shoulder = np.concatenate([np.linspace(-0.9, -0.3, 100), np.linspace(0.3, 0.9, 100)])
    figure = planar_arm((0.5, 0.5), radius=0.03)
    clip, scene = wb.Clip(figure, np.stack([shoulder, np.full(200, 0.1)], axis=1), DT), wb.Scene(figure)
    scene.add(wb.Sphere(0.04), name="pole", at=(0.9, 0.0, 0.0))
    told: list[str] = []

    def stop(progress: AvoidProgress) -> bool:
        told.append(progress.note)
        return len(told) == 3

    with begun(clip, scene, progress=stop) as run:
        repaired(run, clip.q)
    assert len(told) == 3
    assert told[-1].endswith("is kept on one side")
    assert run.work.programs < 100


def test_where_nothing_is_wrong_nothing_is_computed(planar_arm: Callable[..., Figure]) -> None:
    clip = swing(planar_arm((0.5, 0.5)))
    q, programs = mended(clip, wb.Scene(clip.figure), clip.q)
    np.testing.assert_array_equal(q, clip.q)
    assert programs == 0


def test_what_is_held_holds_again_in_a_frame_that_left_it(planar_arm: Callable[..., Figure]) -> None:
    clip = swing(planar_arm((0.5, 0.5)))
    tip = clip.figure.segments[-1]
    left = clip.q.copy()
    left[20] += 0.05
    q, _ = mended(clip, wb.Scene(clip.figure), left, wb.Hold(tip, orientation=False))
    state = wb.Scene(clip.figure).state(q[0])
    number = clip.figure.frame_id(tip)
    for frame in range(len(clip)):
        kept = state.update(clip.q[frame]).frame(number).translation.copy()
        np.testing.assert_allclose(state.update(q[frame]).frame(number).translation, kept, atol=2e-4)
