"""What sinks by hundredths of a millimetre between frames costs no deviation."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure


def with_ball(human: Figure, at: Array) -> wb.Scene:
    """A person on a floor, and a ball of a centimetre."""
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    return scene.add(wb.Sphere(0.01), name="ball", at=at)


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
