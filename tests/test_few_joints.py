"""Figures of one degree of freedom and of none: Pinocchio gives arrays of fewer dimensions for them."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from tests.needs import each
from wholebody.methods import installed_methods

LINK = """<link name="{name}"><inertial><origin xyz="{at}"/><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision></link>"""
BASE = LINK.format(name="base", at="0 0 -0.5", size="0.2 0.2 0.1")
ARM = LINK.format(name="tip", at="0.3 0 0", size="0.6 0.1 0.1")
JOINT = """<joint name="joint" type="{kind}"><parent link="base"/><child link="tip"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""
AXES = {"revolute": "0 0 1", "continuous": "0 0 1", "prismatic": "0 1 0"}
METHODS = {
    "qp": wb.methods.QP(budget=60, restarts=2),
    "qp/daqp": wb.methods.QP(solver="daqp", budget=60, restarts=2),
    "ccd": wb.methods.CCD(restarts=1),
    "newton": wb.methods.Newton(restarts=1),
    "placo": wb.methods.Placo(iterations=60),
    "dls": wb.methods.DampedLeastSquares(),
}


@pytest.fixture
def load(tmp_path: Path) -> Callable[[str], wb.Figure]:
    """Return a function: kind of the only joint, or "none" -> the figure."""

    def make(kind: str) -> wb.Figure:
        links = BASE if kind == "none" else BASE + JOINT.format(kind=kind, axis=AXES[kind]) + ARM
        path = tmp_path / f"{kind}.urdf"
        path.write_text(f'<robot name="{kind}">{links}</robot>')
        return wb.load(path)

    return make


def between_walls(figure: wb.Figure) -> wb.Scene:
    """The arm, 10 cm wide, between two walls that both touch it."""
    scene = wb.Scene(figure).add(wb.Box((0.1, 0.1, 0.3)), name="left", at=(0.4, 0.1, 0.0))
    return scene.add(wb.Box((0.1, 0.1, 0.3)), name="right", at=(0.2, -0.1, 0.0))


@pytest.mark.parametrize("kind", AXES)
@pytest.mark.parametrize("name", each(METHODS))
def test_one_joint_in_contact_at_two_places(load: Callable[[str], wb.Figure], kind: str, name: str) -> None:
    """Nothing can move: a goal for which the arm would be within a wall is out of reach, by as much as it is away."""
    scene = between_walls(load(kind))
    q = scene.figure.neutral
    assert len(scene.contacts(q, 1e-5).distance) == 2
    place = np.array((0.6, 0.05, 0.0) if kind == "prismatic" else (0.6 * np.cos(0.1), 0.6 * np.sin(0.1), 0.0))
    away = float(np.linalg.norm(place - (0.6, 0.0, 0.0)))
    problem = wb.Problem(scene, goals=[wb.Point("tip", place, offset=(0.6, 0.0, 0.0))])
    judged = wb.assess(problem, q)
    assert judged.goal_error == pytest.approx(away)
    assert judged.optimality == pytest.approx(0.0, abs=1e-9)  # the left wall pushes back as the goal pulls
    solution = METHODS[name].solve(problem)
    if name == "dls":  # which knows no contacts
        assert solution.assessment.goal_error < 1e-3
        return
    assert solution.status in ("unreachable", "stalled", "infeasible")
    assert wb.assess(problem, solution.q).goal_error == pytest.approx(away, abs=2e-3)


@pytest.mark.parametrize("kind", AXES)
def test_one_joint_follows_goals_and_is_followed(load: Callable[[str], wb.Figure], kind: str) -> None:
    figure = load(kind)
    scene = wb.Scene(figure).add(wb.Box((0.1, 0.1, 0.3)), name="left", at=(0.4, 0.6, 0.0))
    place = (0.6, 0.1, 0.0) if kind == "prismatic" else (0.6 * np.cos(0.2), 0.6 * np.sin(0.2), 0.0)
    goal = wb.Point("tip", place, offset=(0.6, 0.0, 0.0))
    problem = wb.Problem(scene, goals=[goal], constraints=[wb.tasks.StepLimit(1.0)])
    for method in (wb.methods.QP(), wb.methods.Newton()):
        tracker, q = method.tracker(problem, 0.02), problem.start
        for _ in range(30):
            q = tracker.step(q).q
        assert wb.assess(problem, q).goal_error < 1e-4
    for name in installed_methods():
        free = wb.Problem(scene, goals=[goal])
        if name == "ccd" and kind == "prismatic":
            continue
        drag = wb.tracking.Drag(free, name)
        for _ in range(20):
            frame = drag.to(place)
        assert frame.error < 2e-3, name
    assert wb.solve(wb.simplify(wb.Problem(scene, goals=[goal])).problem).solved
    assert scene.sweep(figure.neutral, q) is None
    made = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(made.contacts(q, 1.0).distance, scene.contacts(q, 1.0).distance)


TERMS = {
    "point": {"goals": [wb.Point("base", (0.1, 0.0, 0.0))]},
    "frame": {"goals": [wb.Frame("base", (0.1, 0.0, 0.0))]},
    "axis": {"goals": [wb.Axis("base", (1, 0, 0), direction=(0, 1, 0))]},
    "posture": {"goals": [wb.Posture("neutral")]},
    "hold": {"constraints": [wb.Hold("base")]},
    "plane": {"constraints": [wb.Plane("base", (0, 0, 1))]},
    "limit": {"constraints": [wb.tasks.StepLimit(1.0)]},
    "measures": {"measures": [wb.Effort(), wb.tasks.Displacement(), wb.tasks.Discomfort(), wb.tasks.PotentialEnergy()]},
}
REFUSED = {
    **dict.fromkeys(("point", "frame", "axis", "posture", "plane"), ("ccd",)),
    "measures": ("ccd", "placo"),
}


@pytest.mark.parametrize("term", TERMS)
def test_a_figure_without_joints_is_solved_judged_and_followed(load: Callable[[str], wb.Figure], term: str) -> None:
    scene = between_walls(load("none"))
    assert (scene.model.nq, scene.model.nv) == (0, 0)
    problem = wb.Problem(scene, **TERMS[term])
    reached = term not in ("point", "frame", "axis")
    assert wb.assess(problem, np.zeros(0)).met(1e-6) == reached
    for name, method in METHODS.items():
        if name == "placo" and name not in installed_methods():
            continue
        if method.name in REFUSED.get(term, ()):
            with pytest.raises(wb.InputError, match="cannot take"):
                method.solve(problem)
            continue
        solution = method.solve(problem)
        assert solution.status == ("solved" if reached else "unreachable"), method.name
        assert solution.q.shape == (0,)
    for method in (wb.methods.QP(), wb.methods.Newton()):
        assert method.tracker(problem, 0.02).step(problem.start).q.shape == (0,)
    assert wb.solve(wb.simplify(problem).problem).q.shape == (0,)


def test_a_figure_without_joints_is_drawn_and_swept(load: Callable[[str], wb.Figure], tmp_path: Path) -> None:
    scene = between_walls(load("none"))
    q = scene.figure.neutral
    assert scene.sweep(q, q) is None
    assert len(scene.contacts(q, 10.0).distance) == 0
    with wb.Viewer(scene) as viewer:
        viewer.show(q, problem=wb.Problem(scene))
        viewer.save(tmp_path / "block.html")
    assert (tmp_path / "block.html").stat().st_size > 1000


@pytest.mark.parametrize("term", [wb.CenterOfMass((0.0, 0.0, 0.0))])
def test_a_centre_of_mass_of_nothing_is_refused(load: Callable[[str], wb.Figure], term: Any) -> None:
    with pytest.raises(wb.InputError, match="nothing of none that moves has mass"):
        wb.Problem(wb.Scene(load("none")), goals=[term])
