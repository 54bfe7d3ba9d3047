"""Reaches of small robots: what other postures of the same robot reach is never called out of reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="{4}"/>'
    '<limit lower="{5}" upper="{6}" effort="1" velocity="9"/></joint>'
)
LEG = (
    JOINT.format("hip", "trunk", "side", "0 0 0", "1 0 0", -0.8, 0.8)
    + JOINT.format("thigh", "side", "upper", "0 0.08 0", "0 1 0", -1.05, 4.19)
    + JOINT.format("calf", "upper", "lower", "0 0 -0.2", "0 1 0", -2.7, -0.92)
    + '<joint name="tip" type="fixed"><parent link="lower"/><child link="foot"/><origin xyz="0 0 -0.2"/></joint>'
)
"""The leg of a robot dog: a foot behind the hip is reached with the thigh far round."""

ELBOW = JOINT.format("one", "trunk", "upper", "0 0 0", "0 0 1", -3.14, 3.14) + JOINT.format(
    "two", "upper", "foot", "0.11 0 0", "0 0 1", -3.14, 3.14
)
"""An arm whose last joint does not move its tip."""


def load(folder: Path, links: str, joints: str) -> wb.Figure:
    text = "".join(f'<link name="{name}"/>' for name in links.split())
    (folder / "robot.urdf").write_text(f'<robot name="r">{text}{joints}</robot>')
    return wb.load(folder / "robot.urdf")


@pytest.mark.parametrize(("links", "joints"), [("trunk side upper lower foot", LEG), ("trunk upper foot", ELBOW)])
def test_where_random_postures_have_the_tip_is_reached(tmp_path: Path, links: str, joints: str) -> None:
    figure = load(tmp_path, links, joints)
    scene, data, rng = wb.Scene(figure), figure.model.createData(), np.random.default_rng(3)
    missed = []
    for number in range(40):
        q = rng.uniform(figure.limits.lower, figure.limits.upper)
        pin.framesForwardKinematics(figure.model, data, q)
        target = np.array(data.oMf[figure.frame_id("foot")].translation)
        solution = wb.solve(wb.Problem(scene, goals=[wb.Point("foot", target)]))
        if not solution.solved:
            missed.append((number, solution.status, solution.assessment.goal_error))
    assert not missed
