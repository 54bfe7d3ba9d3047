"""The posture in which a robot begins is free of contact with itself, by coal on every pair."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.self_pairs import UNPARTED


def least_distance(figure: wb.Figure, q: np.ndarray) -> float:
    data, results = figure.model.createData(), pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, results, q)
    pin.computeDistances(figure.geometry, results)
    return min(result.min_distance for result in results.distanceResults)


def arms(limit: float, apart: float = 0.1) -> str:
    """Two arms that hang side by side on a bar, with balls that are wider than the bar."""
    links, joints = ['<link name="bar"/>'], []
    for name, x in (("left", -apart / 2), ("right", apart / 2)):
        links.append(f'<link name="{name}"/>')
        links.append(
            f'<link name="{name}_ball"><collision><origin xyz="0 0 -0.5"/><geometry><sphere radius="0.08"/></geometry>'
            "</collision></link>"
        )
        joints.append(
            f'<joint name="{name}_mount" type="fixed"><parent link="bar"/><child link="{name}"/><origin xyz="{x} 0 0"/>'
            f'</joint><joint name="{name}_swing" type="revolute"><parent link="{name}"/><child link="{name}_ball"/>'
            f'<axis xyz="1 0 0"/><limit lower="-{limit}" upper="{limit}" effort="1" velocity="1"/></joint>'
        )
    return f'<robot name="r">{"".join(links + joints)}</robot>'


def test_a_pair_that_can_be_parted_is_parted_by_moving_little(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(arms(1.5))
    figure = wb.load(path)
    assert figure.postures == ("neutral", "zero")
    assert least_distance(figure, figure.posture("zero")) == pytest.approx(0.1 - 0.16)
    assert 0.0 < least_distance(figure, figure.neutral) < 0.02
    assert figure.within_limits(figure.neutral)
    # the balls part where they swing by a sum of asin(sqrt(0.16^2 - 0.1^2) / 0.5) at least
    assert np.abs(figure.neutral).sum() == pytest.approx(2 * np.arcsin(np.sqrt(0.16**2 - 0.1**2) / 2 / 0.5), abs=0.05)
    assert any("left_ball:0 and right_ball:0 overlap" in note for note in figure.notes)
    assert wb.load(path).neutral == pytest.approx(figure.neutral, abs=0.0)


def test_a_pair_that_nothing_parts_is_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(arms(0.05))
    figure = wb.load(path)
    assert not len(figure.geometry.collisionPairs)
    (pair,) = [pair for pair in figure.excluded_pairs if pair.reason != "neighbours"]
    assert {pair.a, pair.b} == {"left_ball:0", "right_ball:0"}
    assert pair.reason == "touch or overlap in every sampled posture"
    unsampled = wb.load(path, samples=0)
    assert [entry.reason for entry in unsampled.excluded_pairs if entry.reason != "neighbours"] == [UNPARTED]
    assert any("not tested" in note for note in unsampled.notes)


def test_a_robot_that_is_free_at_zero_begins_there(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(arms(1.5, apart=0.3))
    figure = wb.load(path)
    assert figure.postures == ("neutral",)
    assert not figure.neutral.any()
    assert not figure.notes
