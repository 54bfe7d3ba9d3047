"""Smoothness that the jerk of the answer asks for: jerk is bounded, and the deviation is what is least."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.motion.measures import deviation, jerk_ratio

DT = 1 / 30


def past_a_ball(figure: Figure, brief: int, shake: float) -> tuple[wb.Clip, wb.Scene]:
    """A straight arm that swings 0.05 rad into a ball and back in 2 s, its joints shaken as those of recordings are.

    A larger even number `brief` makes it stay there for a shorter time.
    """
    touching = 0.5 - np.arcsin(0.12 / 0.9)
    turn = -0.5 + (touching + 0.05) * np.sin(np.linspace(0.0, np.pi, 60)) ** brief
    q = np.stack([turn, np.zeros(60)], axis=1) + shake * np.random.default_rng(0).normal(size=(60, 2))
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.9, 0.0, 0.0))
    return wb.Clip(figure, q, DT), scene


def found(clip: wb.Clip, scene: wb.Scene, method: wb.motion.Trajectory) -> tuple[float, float]:
    """Deviation in radians, and jerk in parts of that before."""
    freed = wb.avoid(clip, scene, method=method)
    assert freed.report.solved, freed.report.message
    return deviation(clip, freed.clip).angle, jerk_ratio(clip, freed.clip)


def with_ball(human: Figure, at: Array) -> wb.Scene:
    """A person on a floor, and a ball of a centimetre."""
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    return scene.add(wb.Sphere(0.01), name="ball", at=at)


def test_a_clip_that_shakes_anyhow_is_left_by_less(planar_arm: Callable[..., Figure]) -> None:
    case = past_a_ball(planar_arm((0.5, 0.5), radius=0.02), 4, 2e-3)
    angle, jerk = found(*case, wb.motion.Trajectory())
    smooth, _ = found(*case, wb.motion.Trajectory(time=0.1))
    assert angle < 0.9 * smooth
    assert jerk <= 1.2


def test_an_answer_that_jerks_is_made_smoother(planar_arm: Callable[..., Figure]) -> None:
    case = past_a_ball(planar_arm((0.5, 0.5), radius=0.02), 4, 0.0)
    _, jerk = found(*case, wb.motion.Trajectory())
    _, before = found(*case, wb.motion.Trajectory(time=0.1))
    assert jerk <= 1.2 < before


def test_what_would_jerk_stays_as_smooth_as_it_is(planar_arm: Callable[..., Figure]) -> None:
    case = past_a_ball(planar_arm((0.5, 0.5), radius=0.02), 8, 0.0)
    angle, jerk = found(*case, wb.motion.Trajectory())
    nearer, rough = found(*case, wb.motion.Trajectory(time=0.04))
    assert jerk <= 1.2 < rough
    assert nearer < angle


def test_soles_that_sink_a_little_between_frames_cost_no_deviation(human: Figure) -> None:
    scene, clips = wb.Scene(human).add(wb.HalfSpace(), name="floor"), []
    q, feet = human.posture("standing"), [wb.Hold("left_foot"), wb.Hold("right_foot")]
    pelvis, tip = (human.placement(q, frame).translation.copy() for frame in ("pelvis", "right_index_tip"))
    for k in range(6):
        lower, reach = pelvis - (0.0, 0.0, 0.05 + 0.006 * k), tip + (0.25, -0.02, 0.15 + 0.03 * k)
        goals = [wb.Point("pelvis", lower), wb.Point("right_index_tip", reach)]
        q = wb.solve(wb.Problem(scene, q, goals=goals, constraints=feet, measures=())).q
        clips.append(q)
    middle = pin.interpolate(human.model, clips[3], clips[4], 0.5)
    finger = human.placement(middle, "right_index_tip")
    away = 5e-3  # m: of the ball's middle from the fingertip, until the finger is 0.2 mm inside between two frames
    while True:
        scene = with_ball(human, finger.translation + away * finger.rotation[:, 0])
        if scene.contacts(middle, 0.0).distance.min(initial=0.0) > -3e-4:
            break
        away += 1e-4
    clip = wb.Clip(human, np.array(clips), dt=1 / 15)
    assert not wb.check(clip, scene).free
    found = wb.avoid(clip, scene)
    assert found.report.solved
    assert np.abs(found.clip.q - clip.q).max() < 5e-3  # a ball of a centimetre is passed by two millimetres
