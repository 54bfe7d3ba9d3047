"""Levels of the ground and feet that stand on them: made-up recordings whose heights are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import wholebody as wb
from tests.motion.test_ground import DT, flat, walker


def test_feet_stand_on_every_level_wherever_most_time_is_spent() -> None:
    """A foot on a box for most of the time: the height of toes below ankles is that of one foot, not of two levels."""
    motion, _ = walker(flat, 4.0)
    at = np.repeat(motion.positions[:1], len(motion), axis=0)
    count, names = len(motion), motion.names
    for side, first in (("left", 0.75), ("right", 0.65)):  # seconds at which each foot goes up
        for joint, late in (("ankle", 0.0), ("foot", 0.15)):
            times = np.clip((np.arange(count) * DT - first - late) / 0.3, 0.0, 1.0)
            at[:, names.index(f"{side}_{joint}"), 2] += 0.4 * times + 0.25 * np.sin(np.pi * times)
        at[:, names.index(f"{side}_knee"), 2] += 0.4
    found = wb.motion.ground(dataclasses.replace(motion, positions=at))
    assert found.levels == pytest.approx((0.0, 0.4), abs=5e-3)
    for each in found.footholds:
        assert each.height == pytest.approx(0.4 if each.first * DT > 0.6 else 0.0, abs=5e-3)


def test_a_foot_that_trembles_rests_and_one_that_hangs_does_not() -> None:
    motion, stands = walker(flat, 2.0)
    at = np.array(motion.positions)
    wave = 0.007 * np.sin(2.0 * np.pi * 7.0 * DT * np.arange(len(at)))  # of 7 Hz and up to 0.3 m/s
    at[:, :, 1] += wave[:, None]
    found = wb.motion.ground(dataclasses.replace(motion, positions=at))
    assert min((found.rests[f"{side}_toe"] == mask).mean() for side, mask in stands.items()) > 0.85
    held = np.array(walker(flat, 2.0, raised=0.25)[0].positions)
    toes = motion.names.index("right_foot")
    held[20:, toes, 2] -= 0.1  # toes hang
    held[20:30, 5:9, 2] += np.linspace(0.02, 0.0, 10)[:, None]  # and it came down a little
    hangs = wb.motion.ground(dataclasses.replace(motion, positions=held))
    assert not hangs.rests["right_ankle"][20:].any()
    assert not hangs.rests["right_toe"][20:].any()
