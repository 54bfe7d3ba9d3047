"""Postures that are judged together, beside the same ones judged one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.assessment.posture import Numbers, judged_postures

AWAY = pin.SE3(pin.exp3(np.array([0.4, -1.1, 0.7])), np.array([0.3, 0.2, 0.6]))
GOALS: dict[str, list[wb.Goal]] = {
    "point": [wb.Point("tool", AWAY.translation, offset=(0.1, -0.2, 0.05))],
    "frame": [wb.Frame("tool", AWAY)],
    "orientation": [wb.Orientation("tool", AWAY.rotation)],
    "relative": [wb.Relative("tool", "link2", AWAY)],
    "two": [wb.Orientation("link2", AWAY.rotation), wb.Point("tool", AWAY.translation)],
}


LINK = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.12"/><geometry><box size="0.1 0.1 0.24"/></geometry></collision></link>"""
JOINT = """<joint name="to_{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/><origin xyz="0 0 0.25"/>
<axis xyz="{axis}"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""


@pytest.fixture(params=["revolute", "continuous"], ids=["limited mast", "mast that turns on"])
def arm(request: pytest.FixtureRequest, tmp_path: Path) -> wb.Figure:
    """Four joints; with a continuous one a posture has more numbers than degrees of freedom."""
    links, parent = [LINK.format(name="base")], "base"
    for name, axis in (("mast", "0 0 1"), ("link1", "0 1 0"), ("link2", "1 0 0"), ("tool", "0 1 0")):
        kind = request.param if name == "mast" else "revolute"
        links += [LINK.format(name=name), JOINT.format(name=name, kind=kind, parent=parent, axis=axis)]
        parent = name
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{"".join(links)}</robot>')
    return wb.load(tmp_path / "arm.urdf")


@pytest.mark.parametrize("goals", GOALS.values(), ids=GOALS)
@pytest.mark.parametrize("things", [3, 60])
def test_postures_judged_at_once_are_judged_as_one_by_one(arm: wb.Figure, goals: list[wb.Goal], things: int) -> None:
    """Far from goals, beyond limits, inside things and nearer to them than the clearance."""
    rng = np.random.default_rng(0)
    scene = wb.Scene(arm)
    for k in range(things):
        scene.add(wb.Box((0.1, 0.15, 0.2)), name=f"thing{k}", at=rng.uniform(-1.0, 1.0, 3) + (0.0, 0.0, 1.0))
    problem = wb.Problem(scene, goals=goals, measures=[wb.Effort()], clearance=0.02)
    moves = rng.uniform(-2.5, 2.5, (12, arm.model.nv))
    postures = np.array([pin.integrate(arm.model, problem.start, move) for move in moves])
    judged = judged_postures(problem, Numbers.of([problem] * len(postures)), postures)
    assert (judged.penetration > 0.0).any()
    for k, q in enumerate(postures):
        alone = wb.assess(problem, q)
        for name, values in judged._asdict().items():
            assert values[k] == pytest.approx(getattr(alone, name), abs=1e-9), name
