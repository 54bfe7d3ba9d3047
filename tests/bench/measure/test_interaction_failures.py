"""The page on the worst frames names the frames that are the worst, and shows the one in which something is missed."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.measure.interaction import WorstFrames, failures, summary, worst_frames
from wholebody.tracking import Recording, judge


def run(seconds: float) -> WorstFrames:
    """A hand that is shown 5 mm deep in frame 6, takes `seconds` for frame 3 and lags in frame 9."""
    hand = wb.load("hand")
    scene = wb.Scene(hand).add(wb.Box((2.0, 2.0, 0.3)), name="table", at=(0.0, 0.0, -0.15))
    q = np.tile(hand.posture("relaxed"), (12, 1))
    q[:, 2] += 0.1
    shown = q.copy()
    shown[6, 2] = hand.posture("relaxed")[2] - 0.005 * (seconds > 0.1)
    shown[9] = hand.with_joints(shown[9], {"right_index_pip_flexion": 1.5})
    times, none = np.full(12, 1e-3), np.zeros(12, dtype=np.intp)
    times[3] = seconds
    recording = Recording(shown, q, 1 / 60, "ccd", times, times, times, times, none, none, none, ("",) * 12)
    judged = judge(scene, recording)
    return worst_frames(summary("hand_on_table", recording, judged), recording, judged)


def test_the_worst_frames_are_found() -> None:
    worst = run(0.5)
    assert (worst.deepest, worst.slowest, worst.farthest) == (6, 3, 9)
    assert worst.sudden in (8, 9, 10, 11)
    assert worst.milliseconds == pytest.approx(500.0)
    assert worst.picture == 6  # something passes on the way to it
    text = failures([worst], [(worst, "assets/frame.png")])
    assert "| hand on table | ccd | 5.0000 (6) | 500.0 (3) |" in text
    assert "](assets/frame.png)" in text
    assert "Hand on table with ccd, frame 6: mean " in text


def test_without_a_miss_there_is_no_picture() -> None:
    worst = run(1e-3)
    assert worst.picture == -1
    assert "so there is no picture" in failures([worst], [])
