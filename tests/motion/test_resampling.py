"""Clips at another rate on a spline: known motions, their ends, limits and contacts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

DT = 1 / 30


def test_a_spline_meets_the_frames_and_follows_known_motions(human: wb.Figure) -> None:
    """The root goes round while it turns, an elbow swings; at 50 Hz from 30."""
    elbow = human.model.joints[human.joint_id("left_elbow_flexion")].idx_q

    def at(t: float) -> np.ndarray:
        q = np.array(human.neutral)
        q[:3] = np.sin(2.0 * t), np.cos(2.0 * t), 1.0 + 0.1 * np.sin(5.0 * t)
        q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.1 * np.sin(3.0 * t), 2.0 * t)).coeffs()
        q[elbow] = 0.7 + 0.4 * np.sin(6.0 * t)
        return q

    clip = wb.Clip(human, np.array([at(k * DT) for k in range(46)]), DT)
    assert clip.resampled(DT, smooth=True).q == pytest.approx(clip.q, abs=1e-9)
    fine = clip.resampled(0.02, smooth=True)
    truth = np.array([at(0.02 * k) for k in range(len(fine))])
    inner = slice(8, -8)  # nothing says how the motion goes on beyond its ends
    assert np.abs(fine.q[inner] - truth[inner]).max() < 2e-4
    jerks = [np.abs(np.diff(q[inner, :3], 3, axis=0)).max() for q in (truth, fine.q, clip.resampled(0.02).q)]
    assert jerks[1] < 1.5 * jerks[0]
    assert jerks[2] > 5.0 * jerks[0]  # what goes straight from frame to frame turns at each


def test_a_spline_keeps_limits_and_what_stands(human: wb.Figure) -> None:
    elbow = human.model.joints[human.joint_id("left_elbow_flexion")].idx_q
    high = human.model.upperPositionLimit[elbow]
    q = np.tile(human.neutral, (30, 1))
    q[:, elbow] = np.minimum(high, np.linspace(high - 1.5, high + 1.5, 30))  # to its limit, where it stays
    clip = wb.Clip(human, q, DT).resampled(0.02, smooth=True)
    assert all(human.within_limits(posture) for posture in clip.q)
    assert np.abs(clip.q[clip.times > 25 * DT, elbow] - high).max() < 1e-3
    still = np.delete(np.arange(human.model.nq), elbow)
    assert np.abs(clip.q[:, still] - human.neutral[still]).max() < 1e-12
    assert wb.Clip(human, q[:1], DT).resampled(0.02, smooth=True).q == pytest.approx(q[:1])
