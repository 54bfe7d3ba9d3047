"""The judge of the runs against facts that are known without it."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.bench.measure.track import SETTING, Track, judge


def test_standing_still_is_judged_as_standing_still(short_free: Track) -> None:
    scene = short_free.scene
    tip = scene.state(short_free.start).frame(scene.frame_id(short_free.tip)).translation
    verdict = judge(short_free, np.tile(short_free.start, (8, 1)))
    assert (verdict.foot_drift, verdict.foot_turn, verdict.fastest_joint, verdict.fastest_root) == (0, 0, 0, 0)
    assert verdict.limit_violation == verdict.acceleration == 0.0
    assert verdict.least_distance.min() > 0.012
    assert verdict.error[-1] == pytest.approx(np.linalg.norm(short_free.targets[-1] - tip))


def test_what_is_wrong_is_seen(short_free: Track) -> None:
    """The root sinks by 5 cm at the third step; a joint goes 0.1 rad beyond its limit at the fifth."""
    figure = short_free.scene.figure
    postures = np.tile(short_free.start, (8, 1))
    postures[2:, 2] -= 0.05
    elbow = figure.model.joints[figure.joint_id("left_elbow_flexion")].idx_q
    postures[4, elbow] = figure.model.upperPositionLimit[elbow] + 0.1
    verdict = judge(short_free, postures)
    assert verdict.foot_drift == pytest.approx(0.05)
    assert verdict.limit_violation == pytest.approx(0.1)
    assert verdict.fastest_root == pytest.approx(0.05 / SETTING.dt / 1.0)
    postures[3, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        judge(short_free, postures)
