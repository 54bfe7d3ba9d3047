"""Predictions of single frames: what room is asked of whom."""

from __future__ import annotations

import numpy as np

import wholebody as wb

ROOM = 0.01  # m


def test_a_hand_that_may_turn_keeps_its_room() -> None:
    """A palm is held at its place, in each frame, and a ball is at the tip of its finger."""
    person = wb.load("human")
    scene, q = wb.Scene(person), person.posture("standing")
    tip = scene.state(q).frame(person.frame_id("right_index_tip")).translation
    scene.add(wb.Sphere(0.03), name="ball", at=tip.copy())
    clip = wb.Clip(person, np.repeat(q[None], 3, axis=0), 1 / 30)
    held = wb.Hold("right_palm", orientation=False)
    found = wb.avoid(clip, scene, method=wb.motion.Bisection(room=ROOM), constraints=[held])
    with scene.borrow() as workspace:
        near = workspace.near(found.clip.q[1], 2.0 * ROOM)
        owners = [{workspace.owners[a], workspace.owners[b]} for a, b in near.pair]
    gaps = [gap for gap, pair in zip(near.distance, owners, strict=True) if pair == {"right_hand", "ball"}]
    assert found.report.solved
    assert min(gaps, default=ROOM) >= ROOM - 1e-4
