"""Where normals cancel: the posture that parts the two is the least translation, known by construction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.stability.catalogue import cases
from wholebody.methods.qp.start_postures import posture_apart

JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="0 0 1"/>'
    '<limit lower="-2" upper="2" effort="1" velocity="9"/></joint>'
)
PRONG = '<collision><origin xyz="0.2 {0} 0"/><geometry><box size="0.2 0.06 0.4"/></geometry></collision>'


def test_a_fork_is_pulled_off_a_plate_the_short_way() -> None:
    """Its prongs reach 12 cm over the plate, and overlap it by 1.5 cm each from both sides."""
    problem = cases(["cancelling-normals"])[0].question().problem
    with problem.borrow() as workspace:
        q = posture_apart(problem, workspace, problem.start)
    assert q is not None
    assert q == pytest.approx([-0.12, 0.0, 0.5], abs=2e-3)


def test_no_place_of_the_fork_is_nearer_to_its_goal() -> None:
    """All boxes stand along the axes: intervals tell, on a grid of 4 mm, where the fork is off the plate."""
    solution = wb.solve(cases(["cancelling-normals"])[0].question().problem)
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(0.12, abs=1e-4)
    middles = np.array([(-0.15, 0.0, 0.06), (-0.15, 0.0, -0.06), (-0.33, 0.0, 0.0)])  # two prongs and the handle
    halves = np.array([(0.15, 0.06, 0.03), (0.15, 0.06, 0.03), (0.03, 0.06, 0.09)])
    ways = np.stack(np.meshgrid(*3 * [np.arange(-0.16, 0.161, 0.004)], indexing="ij"), axis=-1).reshape(-1, 3)
    apart = np.abs(ways[:, None] + middles - (0.38, 0.0, 0.0)) - halves - (0.5, 0.5, 0.045)
    free = (apart.max(axis=2) > -1e-9).all(axis=1)
    assert np.linalg.norm(ways[free], axis=1).min() == pytest.approx(0.12, abs=1e-9)


def test_one_prong_alone_does_not_cancel() -> None:
    problem = cases(["cancelling-normals"])[0].question().problem
    with problem.borrow() as workspace:
        assert posture_apart(problem, workspace, problem.start + [0.0, 0.0, 0.06]) is None


def test_the_last_link_of_an_arm_is_pulled_off(tmp_path: Path) -> None:
    """Three joints in a plane give the fork any small translation without turning it."""
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    joints = JOINT.format("i", "a", "b", "0 0 0") + JOINT.format("j", "b", "c", "0.5 0 0")
    fork = f'<link name="d">{PRONG.format(0.06)}{PRONG.format(-0.06)}</link>' + JOINT.format("k", "c", "d", "0.5 0 0")
    (tmp_path / "arm.urdf").write_text(f'<robot name="r">{links}{joints}{fork}</robot>')
    scene = wb.Scene(wb.load(tmp_path / "arm.urdf"))
    start = np.array([0.6, -1.2, 0.6])  # the fork points along x, its wrist 0.825 m along x
    wrist = 2 * 0.5 * np.cos(0.6)
    scene.add(wb.Box((1.0, 0.09, 0.4)), name="plate", at=(wrist + 0.2 + 0.5, 0.0, 0.0))
    problem = wb.Problem(scene, start, goals=[wb.Point("d", (wrist, 0.0, 0.0))])
    assert wb.assess(problem, start).penetration == pytest.approx(0.015, abs=1e-5)
    with problem.borrow() as workspace:
        q = posture_apart(problem, workspace, start)
        assert q is not None
        place = workspace.state.update(q).frame(scene.figure.frame_id("d"))
        assert place.translation == pytest.approx([wrist - 0.1, 0.0, 0.0], abs=1e-3)
        assert np.arctan2(place.rotation[1, 0], place.rotation[0, 0]) == pytest.approx(0.0, abs=5e-3)
    solution = wb.solve(problem)
    assert solution.assessment.penetration < 1e-5
    assert solution.assessment.goal_error < 0.101
