"""Steps of the programs that fit a posture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.motion import posture_fit
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


def test_a_step_keeps_to_its_bounds_where_the_solver_keeps_to_them_to_rounding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A solver may be 1e-6 beyond bounds: a joint of 1 rad/s was 1e-4 of its limit too fast at 120 frames a second."""
    (path := tmp_path / "wrist.urdf").write_text(WRIST)
    figure, solve = wb.load(path), posture_fit.daqp.solve
    monkeypatch.setattr(posture_fit.daqp, "solve", lambda *a, **k: (solve(*a, **k)[0] + 1e-6, 0.0, 1, {}))
    layout = Layout([], [], np.zeros((0, 0)), np.zeros(0), np.zeros(0), [])
    none = np.zeros((0, 3))
    goals = Goals(none, np.zeros((0, 3, 3)), none, none, figure.neutral + 1.0, np.ones(1))
    with wb.Scene(figure).borrow() as workspace:
        q = Fitter(figure, layout, workspace).step(figure.neutral, goals, most=np.array([[-1 / 120], [1 / 120]]))
    assert q[0] - figure.neutral[0] <= (1.0 + 1e-9) / 120


TIP = np.array([0.5, 0.0, 0.0])
ARM = """<robot name="arm"><link name="base"/><link name="tip">
<collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.02 0.02"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_a_step_does_not_end_inside_what_was_far_away_when_it_began(tmp_path: Path) -> None:
    """The end of an arm of 0.5 m is drawn 0.12 m aside, into a block that is 4 cm from it."""
    (path := tmp_path / "arm.urdf").write_text(ARM)
    figure = wb.load(path)
    scene = wb.Scene(figure).add(wb.Box((0.1, 0.1, 0.1)), name="block", at=(0.45, 0.1, 0.0))
    layout = Layout([], [], np.zeros((0, 0)), np.zeros(0), np.zeros(0), [HeldPoint("left_wrist", "", 1, TIP)])
    goals = Goals(
        np.zeros((0, 3)), np.zeros((0, 3, 3)), np.array([[0.485, 0.12, 0.0]]), np.full((1, 3), 0.3),
        figure.neutral, np.zeros(1),
    )  # fmt: skip
    with scene.borrow() as workspace:
        fitter = Fitter(figure, layout, workspace)
        assert fitter.depth(fitter.step(figure.neutral, goals)) > 0.02
        q = fitter.careful_step(figure.neutral, goals, None)
        assert fitter.depth(q) < 0.01
        q = fitter.careful_step(q, goals, None)
        assert fitter.depth(q) < 5e-4
    assert q[0] == pytest.approx(0.04 / 0.5, abs=0.01)  # it stops before the block, and is not pushed through


def test_a_step_of_a_wrong_linearisation_is_made_shorter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that miss a block let two steps of 0.24 rad end 4 cm inside it: legs that fold did, and stayed there."""
    (path := tmp_path / "arm.urdf").write_text(ARM)
    figure = wb.load(path)
    scene = wb.Scene(figure).add(wb.Box((0.1, 0.1, 0.1)), name="block", at=(0.45, 0.1, 0.0))
    layout = Layout([], [], np.zeros((0, 0)), np.zeros(0), np.zeros(0), [HeldPoint("left_wrist", "", 1, TIP)])
    none, aim = np.zeros((0, 3)), np.array([[0.485, 0.12, 0.0]])
    goals = Goals(none, np.zeros((0, 3, 3)), aim, np.full((1, 3), 30.0), figure.neutral, np.zeros(1))

    def step(self: Fitter, q: np.ndarray, goals: Goals, most: np.ndarray | None = None, **_: object) -> np.ndarray:
        return np.asarray(np.clip(q + 0.24, *((-3.0, 3.0) if most is None else q + most)))

    monkeypatch.setattr(Fitter, "step", step)
    with scene.borrow() as workspace:
        fitter = Fitter(figure, layout, workspace)
        assert fitter.depth(figure.neutral + 0.24) > 0.03
        q = fitter.careful_step(figure.neutral, goals, None)
        assert fitter.depth(q) < 0.01
    assert q[0] > 0.0


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_plate_is_kept_above_tiles_however_many_are_as_near(tmp_path: Path, count: int) -> None:
    """Of more pairs than freedoms none was kept where all are as near as the nearest."""
    (path := tmp_path / "plate.urdf").write_text(
        """<robot name="plate"><link name="base"/><link name="tip">
        <collision><geometry><box size="1 0.2 0.02"/></geometry></collision></link>
        <joint name="slide" type="prismatic"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    )
    figure = wb.load(path)
    scene = wb.Scene(figure)
    for k in range(count):
        scene.add(wb.Box((0.1, 0.1, 0.1)), name=f"tile {k}", at=(0.15 * k - 0.3, 0.0, -0.062))  # 2 mm below it
    layout = Layout([], [], np.zeros((0, 0)), np.zeros(0), np.zeros(0), [HeldPoint("left_wrist", "", 1, np.zeros(3))])
    below = np.array([[0.0, 0.0, -0.04]])
    goals = Goals(
        np.zeros((0, 3)), np.zeros((0, 3, 3)), below, np.full((1, 3), 1.0), figure.neutral, np.zeros(1),
    )  # fmt: skip
    with scene.borrow() as workspace:
        fitter = Fitter(figure, layout, workspace)
        assert fitter.depth(fitter.step(figure.neutral, goals)) < 1e-3
