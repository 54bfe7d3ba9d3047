"""Axis, orientation and centre of mass among the constraints: they hold in every answer, step and plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

UPRIGHT = wb.Axis("right_palm", (0, 1, 0), direction=(0, 0, 1))


def tilt(person: wb.Figure, q: np.ndarray) -> float:
    return float(np.arccos(np.clip(person.placement(q, "right_palm").rotation[2, 1], -1.0, 1.0)))


def turned(person: wb.Figure, q: np.ndarray) -> float:
    return float(np.linalg.norm(pin.log3(person.placement(q, "right_palm").rotation)))


def beside(person: wb.Figure, q: np.ndarray) -> float:
    center = pin.centerOfMass(person.model, person.model.createData(), q)
    return float(np.hypot(center[0] - 0.05, center[1]))


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")


@pytest.mark.parametrize(
    ("kept", "missed"),
    [
        (UPRIGHT, tilt),
        (wb.Orientation("right_palm", np.eye(3)), turned),
        (wb.CenterOfMass((0.05, 0.0, 0.0), axes="xy"), beside),
    ],
    ids=["axis", "orientation", "center_of_mass"],
)
def test_a_goal_out_of_reach_does_not_move_what_is_kept(
    scene: wb.Scene, kept: wb.Constraint, missed: Callable[[wb.Figure, np.ndarray], float]
) -> None:
    far = [wb.Point("right_palm", (2.5, -0.2, 1.2))]
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    solution = wb.solve(wb.Problem(scene, goals=far, constraints=[*feet, kept], balance=False))
    assert solution.status in ("unreachable", "stalled")  # by "newton" the orientation ends 6 mm nearer
    assert missed(scene.figure, solution.q) < 1e-5
    gives_way = wb.solve(
        wb.Problem(scene, goals=[*far, kept], constraints=feet, balance=False)
    )  # a goal shares the miss
    assert missed(scene.figure, gives_way.q) > 1e-3


def test_steps_and_plans_keep_an_axis(root: Path) -> None:
    arm = wb.load(str(root / "tests/data/arm/arm.urdf"))
    scene = wb.Scene(arm)
    frame = arm.frames[-1]
    rng = np.random.default_rng(2)
    start = arm.clamp(pin.integrate(arm.model, arm.neutral, rng.uniform(-1.0, 1.0, arm.model.nv)))
    level = wb.Axis(frame, (0, 0, 1), direction=arm.placement(start, frame).rotation[:, 2])

    def off(q: np.ndarray) -> float:
        return float(
            np.arccos(np.clip(arm.placement(q, frame).rotation[:, 2] @ np.asarray(level.direction), -1.0, 1.0))
        )

    there = arm.placement(start, frame).translation + (0.03, 0.03, -0.03)
    problem = wb.Problem(scene, start, goals=[wb.Point(frame, there)], constraints=[level])
    end = wb.solve(problem)
    assert end.solved
    assert off(end.q) < 1e-5
    q, tracker = start, wb.methods.QP().tracker(problem, 0.02)
    for _ in range(60):
        q = tracker.step(q).q
        assert off(q) < 5e-3
    assert wb.assess(problem, q).goal_error < 0.5 * wb.assess(problem, start).goal_error
    plan = wb.plan(scene, start, end.q, constraints=[level])
    assert plan.solved
    assert max(map(off, plan.clip.q)) < 1e-4


def test_a_file_states_them_without_a_weight(tmp_path: Path) -> None:
    path = tmp_path / "task.toml"
    text = '[figure]\nname = "human"\n[[constraint]]\ntype = "axis"\nframe = "right_palm"\naxis = [0, 1, 0]\n'
    path.write_text(f"{text}direction = [0, 0, 1]\n")
    assert [type(one) for one in wb.read_task(path).problem.constraints if isinstance(one, wb.Axis)] == [wb.Axis]
    path.write_text(f"{text}direction = [0, 0, 1]\nweight = 2.0\n")
    with pytest.raises(wb.UnknownNameError, match="weight"):
        wb.read_task(path)
