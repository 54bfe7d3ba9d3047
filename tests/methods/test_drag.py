"""Dragging and pulling with every method."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def _problem(scene: wb.Scene) -> wb.Problem:
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", _circle(0.0))], constraints=holds)


def _circle(angle: float) -> tuple[float, float, float]:
    return 0.45, -0.25 + 0.1 * np.sin(angle), 1.05 - 0.1 * np.cos(angle)


@pytest.mark.parametrize("method", ["newton", "qp"])
def test_a_drag_follows_and_ends_exactly(scene: wb.Scene, method: str) -> None:
    problem = _problem(scene)
    drag = wb.Drag(problem, method)
    for _ in range(40):
        drag.to(_circle(0.0))
    frames = [drag.to(_circle(0.05 * k)) for k in range(100)]
    assert max(frame.error for frame in frames) < 0.01
    last = drag.finish()
    assert last.solved
    assert last.assessment.goal_error < 1.1e-5
    assert last.assessment.constraint_violation < 1.1e-5
    assert wb.assess(problem, last.q).goal_error > 0.05  # the caller's own goal has not moved


def test_newton_needs_few_iterations_a_frame_and_does_not_drift(scene: wb.Scene) -> None:
    problem = _problem(scene)
    drag = wb.Drag(problem, "newton")
    drag.to(_circle(0.0))
    frames = [drag.to(_circle(0.05 * k)) for k in range(126)]
    assert np.mean([frame.iterations for frame in frames]) < 3.0
    for frame in frames[::25]:
        judged = wb.assess(problem, frame.q)
        assert judged.constraint_violation < 2e-4  # what a frame is solved to, not more from frame to frame
        assert scene.figure.within_limits(frame.q)
        assert judged.penetration < 1e-4


@pytest.mark.parametrize("method", ["newton", "qp"])
def test_a_pull_stops_where_the_arm_ends(scene: wb.Scene, method: str) -> None:
    problem = wb.Problem(
        scene,
        "standing",
        goals=[wb.Point("right_index_tip", (0.4, -0.3, 1.1))],
        constraints=[wb.Freeze("root", "left_leg", "right_leg")],
    )
    solutions = wb.pull(problem, [(0.4, -0.3, 1.1), (2.4, -0.3, 1.1)], method, spacing=0.1)
    assert [solution.solved for solution in solutions[:-1]] == [True] * (len(solutions) - 1)
    assert not solutions[-1].solved
    assert 2 <= len(solutions) < 15


def test_ccd_can_be_pulled_too(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", (0.4, -0.3, 1.1))], measures=[])
    solutions = wb.pull(problem, [(0.4, -0.3, 1.1), (0.4, -0.2, 1.1)], "ccd", spacing=0.05)
    assert len(solutions) == 3


def test_what_cannot_be_moved_is_named(scene: wb.Scene) -> None:
    problem = _problem(scene)
    with pytest.raises(wb.InputError, match="none has the number 3"):
        wb.Drag(problem, goal=3)
    with pytest.raises(wb.UnknownNameError, match="method"):
        wb.Drag(problem, "jacobi")
    with pytest.raises(wb.InputError, match="shape"):
        wb.pull(problem, [1.0, 2.0, 3.0])
    with pytest.raises(wb.InputError, match="spacing"):
        wb.pull(problem, [(0, 0, 0), (1, 0, 0)], spacing=0.0)
    with pytest.raises(wb.InputError, match="finite"):
        wb.Drag(problem, "newton").to((np.nan, 0, 0))
    other = wb.Problem(scene, "standing", goals=[wb.CenterOfMass((0, 0, 1))])
    with pytest.raises(wb.InputError, match="CenterOfMass"):
        wb.Drag(other)
