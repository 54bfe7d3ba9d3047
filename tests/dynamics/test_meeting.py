"""Steps that lead pieces into each other where no contact point foresaw it: boxes that tumble onto each other."""

from __future__ import annotations

import coal
import numpy as np

import wholebody as wb
from wholebody.dynamics.rigid_bodies import RigidBodies

SIZE = (0.4, 0.15, 0.1)


def tumbling(count: int) -> wb.Scene:
    """Boxes above a block on a floor, each of which turns fast and falls."""
    rng = np.random.default_rng(3)
    scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.3, 0.3, 0.3)), name="block", at=(5.0, 0.0, 0.15))
    for k in range(count):
        body = wb.Body(density=700.0, velocity=(0.0, 0.0, -1.5), angular_velocity=tuple(8.0 * rng.normal(size=3)))
        scene.add(
            wb.Box(SIZE), name=f"box {k}", at=(5.0 + 0.1 * rng.normal(), 0.1 * rng.normal(), 0.6 + 0.45 * k), body=body
        )
    return scene


def test_a_frame_of_tumbling_boxes_takes_few_steps() -> None:
    engine, steps = RigidBodies(tumbling(8)), 0
    for _ in range(40):
        frame = engine.advance(1 / 60)
        steps += frame.steps
        assert frame.deepest <= 1e-4
        for k in range(8):
            place = engine.placement(f"box {k}")
            box = coal.Transform3s(place.rotation, place.translation)
            ground = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
            result = coal.DistanceResult()
            depth = -coal.distance(coal.Box(*SIZE), box, ground, coal.Transform3s(), coal.DistanceRequest(), result)
            assert depth <= 1e-4
    assert steps < 450  # 160 and the stops at impacts; 574 where each overlap halved the step
