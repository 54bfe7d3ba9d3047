"""A problem whose contacts are at the place of a posture: that posture meets it, and what else was asked stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.methods.qp.start_postures import at_its_place

BOX = (0.35, -0.25, 1.0)
ASKED: dict[str, dict[str, list[Any]]] = {
    "point": {"goals": [wb.Touch("right_index_tip", "box")]},
    "segment, beside another goal": {"goals": [wb.Touch("right_hand", "box"), wb.Point("left_palm", (0.3, 0.3, 1.2))]},
    "a constraint": {"constraints": [wb.Touch("right_hand", "box")]},
    "palm": {"goals": [wb.Grasp("right", "box")]},
    "feet with balance": {"constraints": [wb.Stand("floor")]},
}


@pytest.mark.filterwarnings("ignore:nothing holds the figure")
@pytest.mark.parametrize("name", ASKED)
def test_the_posture_meets_it_and_another_place_does_not(name: str) -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.2, 0.2, 0.2)), name="box", at=BOX)
    scene.add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, **ASKED[name])
    q = wb.solve(problem).q
    there = at_its_place(problem, scene.state(q))
    assert there is not None
    judged = wb.assess(there, q)
    assert judged.goal_error < 1e-5
    assert judged.holds
    assert len(there.constraints) == len(problem.constraints) - (name == "a constraint")
    moved = pin.integrate(scene.model, q, 0.01 * np.eye(scene.model.nv)[0])
    assert wb.assess(there, moved).goal_error > 5e-3


def test_closed_fingers_have_no_place() -> None:
    scene = wb.Scene(wb.load("human", hands="fingers")).add(wb.Capsule(0.02, 0.3), name="bar", at=BOX)
    problem = wb.Problem(scene, goals=[wb.Grasp("right", "bar", "power")])
    assert at_its_place(problem, scene.state(problem.start)) is None


def test_a_body_may_have_the_name_of_its_joint(tmp_path: Path) -> None:
    hinge = '<joint name="{0}" type="hinge" axis="0 1 0" pos="0.05 0 0.1"/><geom type="sphere" size="0.05"/>'
    upper = f'<body name="b" pos="0 0 0.4">{hinge.format("b")}</body>'
    file = tmp_path / "two.xml"
    file.write_text(f'<mujoco><worldbody><body name="a">{hinge.format("a")}{upper}</body></worldbody></mujoco>')
    scene = wb.Scene(wb.load(file)).add(wb.Sphere(0.1), name="ball", at=(0.3, 0.0, 0.4))
    problem = wb.Problem(scene, goals=[wb.Touch("b", "ball")])
    q = wb.solve(problem).q
    there = at_its_place(problem, scene.state(q))
    assert there is not None
    assert wb.assess(there, q).goal_error < 1e-5
    assert wb.assess(there, q + 0.1).goal_error > 5e-3
