"""Postures on alternate sides of a post, and on one side of it afterwards."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import wholebody as wb
from tests.freeing import begun
from wholebody.figures.figure import Figure
from wholebody.motion.avoider import keep_back

DT = 1 / 30
WAIT = 12  # frames in which the tip of the arm is in the post


def waving(figure: Figure) -> wb.Clip:
    """A straight arm that comes to a post, stays in it, and goes back."""
    angles = np.concatenate([np.linspace(-0.6, 0.0, 10), np.zeros(WAIT), np.linspace(0.0, -0.6, 10)])
    return wb.Clip(figure, np.stack([angles, np.zeros(len(angles))], axis=1), DT)


def with_post(figure: Figure) -> wb.Scene:
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.05), name="post", at=(0.9, 0.0, 0.0))
    return scene


def kept(clip: wb.Clip, scene: wb.Scene, q: np.ndarray) -> tuple[np.ndarray, int]:
    """The postures, and how many programs they took."""
    q = q.copy()
    with begun(clip, scene) as run:
        for gap in range(len(q) - 1):
            keep_back(run, q, gap)
        return q, run.work.programs


def test_frames_on_alternate_sides_of_a_post_come_to_one_side(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.02)
    clip, scene = waving(figure), with_post(figure)
    q = clip.q.copy()
    q[8 : 12 + WAIT, 0] = np.where(np.arange(WAIT + 4) % 2, 0.12, -0.12)  # 0.11 m beside the centre of the post
    before = wb.check(clip.with_q(q), scene)
    assert not before.colliding
    assert before.deepest_between > 0.04
    found, _ = kept(clip, scene, q)
    assert wb.check(clip.with_q(found), scene).deepest_between < 0.01
    assert len(np.unique(np.sign(found[10 : 10 + WAIT, 0] + 0.5 * found[10 : 10 + WAIT, 1]))) == 1
    np.testing.assert_array_equal(found[:7], clip.q[:7])


def test_postures_of_one_side_stay_as_they_are(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.02)
    clip, scene = waving(figure), with_post(figure)
    q = np.minimum(clip.q, [-0.12, 0.0])
    found, programs = kept(clip, scene, q)
    np.testing.assert_array_equal(found, q)
    assert programs == 0


def test_few_frames_take_the_side_of_most_at_both_ends_too(planar_arm: Callable[..., Figure]) -> None:
    """The arm waits in the post from the first to the last frame; both ends are on the farther side."""
    figure = planar_arm((0.5, 0.5), radius=0.02)
    clip, scene = wb.Clip(figure, np.zeros((26, 2)), DT), with_post(figure)
    near, far = -0.1, 0.14  # rad: from 0.9 m away, 90 mm and 126 mm beside the centre of the post
    q = np.stack([np.full(26, near), np.zeros(26)], axis=1)
    q[[0, 1, 2, -2, -1], 0] = far
    assert wb.check(clip.with_q(q), scene).deepest_between > 0.04
    found, _ = kept(clip, scene, q)
    np.testing.assert_array_equal(found[3:-2], q[3:-2])
    assert wb.check(clip.with_q(found), scene).deepest_between < 1e-3
    assert found[:, 0].max() < 0.0
