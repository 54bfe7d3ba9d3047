"""Steps of the programs that fit a posture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.motion.held_points import HeldPoint
from wholebody.motion.posture_fit import Fitter, Goals, Layout

WRIST = """<robot name="wrist"><link name="base"/><link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_a_short_lever_does_not_turn_past_a_place_that_it_cannot_reach(tmp_path: Path) -> None:
    """3 cm from its joint a point is to be 33 cm away in a direction 0.1 rad beside: without pieces it is `bare`."""
    (path := tmp_path / "wrist.urdf").write_text(WRIST)
    figure = wb.load(path)
    point = HeldPoint("left_wrist", "", 1, np.array([0.03, 0.0, 0.0]), thing=True)
    layout = Layout([], [], np.zeros((0, 0)), np.zeros(0), np.zeros(0), [point])
    nothing, weights = np.zeros((0, 3)), np.full((1, 3), 200.0)
    away = 0.33 * np.array([[np.cos(0.1), np.sin(0.1), 0.0]])
    goals = Goals(nothing, np.zeros((0, 3, 3)), away, weights, figure.neutral, np.zeros(1))
    q = figure.neutral
    with wb.Scene(figure).borrow() as workspace:
        fitter = Fitter(figure, layout, workspace)
        for _ in range(20):
            following = fitter.step(q, goals, among=False)
            assert q[0] <= following[0] <= 0.1 + 1e-6  # the place nearest to it, by the arc
            q = following
    assert q[0] > 0.05
