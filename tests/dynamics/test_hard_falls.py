"""Hard falls of figures that yield: joints keep to their limits, no energy is gained, and a frame's work is bounded."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb


def falling(name: str, seed: int, boxes: bool, stiffness: float = 0.0) -> wb.World:
    """A figure in the air, turned at random, above a floor and loose boxes; its root is free."""
    figure, rng = wb.load(name), np.random.default_rng(seed)
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    for k, (x, y) in enumerate(((-0.3, 0.0), (0.35, 0.05), (0.0, 0.4), (0.0, -0.4)) if boxes else ()):
        scene.add(wb.Box((0.25, 0.3, 0.15)), name=f"box {k}", at=(x, y, 0.0751), body=wb.Body(mass=5.0))
    start, turn = figure.posture("standing").copy(), rng.normal(size=4)
    start[:2], start[2], start[3:7] = 0.0, rng.uniform(1.0, 1.5), turn / np.linalg.norm(turn)
    springs = (dict.fromkeys(figure.joints, stiffness), dict.fromkeys(figure.joints, 0.05 * stiffness))
    return wb.World(scene, start, spring=wb.Actuated(figure, *springs))


@pytest.mark.parametrize(("seed", "boxes"), [(1, False), (9, False), (2, True)])
def test_joints_that_contacts_turn_fast_stop_at_their_limits(seed: int, boxes: bool) -> None:
    """They were at 13, 0.9 and 0.05 rad beyond: limits that a step's own impulses reached were not in its program."""
    world = falling("human", seed, boxes)
    model, energies, most = world.scene.model, [world.energy], 0.0
    single = [joint.idx_q for joint in model.joints[1:] if joint.nq == joint.nv == 1]
    low, high = model.lowerPositionLimit[single], model.upperPositionLimit[single]
    for _ in range(60):
        q = world.step().q[single]
        most = max(most, (low - q).max(), (q - high).max())
        energies.append(world.energy)
    assert most < 0.011  # rad; 0.2 where a program that is not solved may leave more
    assert np.diff(energies).max() < 1e-6
    assert energies[0] - energies[-1] > 200.0  # it has landed


def test_a_box_that_limbs_squeeze_does_not_make_a_frame_endless() -> None:
    """A forearm and the trunk hold a box: a frame took 35 steps, most of 28 steps of the engine."""
    world, steps = falling("avatar", 3, True, stiffness=60.0), 0
    for _ in range(75):
        frame = world.step()
        assert frame.engine is not None
        steps = max(steps, frame.engine.steps)
    assert steps < 200  # 644
