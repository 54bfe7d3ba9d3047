"""The step of a figure that nothing touches: its energy where axes of a joint nearly align."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.dynamics.free_motion import Springs, aligning, free_motion


def test_a_step_at_axes_that_nearly_align_makes_no_energy() -> None:
    figure, rng = wb.load("human"), np.random.default_rng(2)
    model = pin.Model(figure.model)
    model.gravity.linear = np.zeros(3)  # so that kinetic energy is conserved
    data, none, most, aligned = model.createData(), np.zeros(model.nv), 0.0, 0
    springs = Springs(none, none, none, none, none + 0.5)

    def inertia(q: np.ndarray) -> np.ndarray:
        return np.array(pin.crba(model, data, q))

    for _ in range(100):
        q = figure.posture("standing").copy()
        q[7:] = rng.uniform(model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
        masses = inertia(q)
        values, vectors = np.linalg.eigh(masses)
        velocity = vectors[:, :20] @ rng.normal(size=20)  # fast turns of little inertia
        velocity *= np.sqrt(20.0 / (velocity @ masses @ velocity))
        motion = free_motion(model, data, inertia, q, velocity, 1.0 / 120.0, springs)
        most = max(most, float(0.5 * motion.velocity @ motion.inertia @ motion.velocity))
        aligned += int(values[0] < 1e-4)
    assert aligned > 10
    assert most < 30.0  # J, of 10; 42 kJ with the forces of motion


def test_axes_that_can_align_are_those_of_three_hinges_in_a_point() -> None:
    figure = wb.load("avatar")
    found = aligning(figure.model)
    names = {name for name in figure.joints if found[figure.model.joints[figure.joint_id(name)].idx_v]}
    for joint in ("left_shoulder", "right_hip"):
        assert {f"{joint}_flexion", f"{joint}_rotation"} < names
    assert not any("elbow" in name or "abduction" in name for name in names)
    assert not aligning(wb.load("hand").model).any()
