"""Drags along a path, judged by what one knows of the motion beforehand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.tracking import Dragged, drag_along, judge_drag, spread
from wholebody.tracking.dragging import present_position, target_position

TOP = 0.74  # m: of the table


@pytest.fixture(scope="module")
def problem() -> wb.Problem:
    scene = wb.Scene(wb.load("avatar"))
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.75, 0.0, TOP - 0.02))
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", (0.4, -0.25, 0.9))], constraints=holds)


def test_a_hand_that_is_dragged_into_a_table_stays_on_it_and_comes_back(problem: wb.Problem) -> None:
    corners = [present_position(problem), (0.3, -0.25, 0.95), (0.4, -0.25, 0.80), (0.4, -0.25, 0.68), (0.4, -0.25, 0.9)]
    places = spread(corners, 28)
    dragged = drag_along(problem, places, "qp")
    judged = judge_drag(problem, dragged)
    assert 28 <= len(dragged) < 33
    assert dragged.q.shape == (len(dragged) + 2, problem.scene.model.nq)
    assert dragged.end.solved
    assert dragged.end.assessment.goal_error < 1.1e-5
    assert judged.depth.max() < 2e-4
    assert judged.between.max() <= 1e-3
    assert judged.limit_violation <= 0.0
    assert judged.constraint_violation.max() < 1e-3
    places = dragged.targets
    inside = (places[:, 2] < TOP - 0.02) & (places[:, 0] > 0.3)
    assert inside.any()
    assert judged.error[inside].min() > 0.01  # the table stops the finger
    tip = problem.scene.frame_id("right_index_tip")
    frame = problem.scene.model.frames[tip]
    for place, q, error in zip(places, dragged.q[1:-1], judged.error, strict=True):
        data = problem.scene.state(q).data
        reached = data.oMi[frame.parentJoint].act(frame.placement.translation)
        assert reached[2] > TOP - 1e-3 or place[0] < 0.3
        assert np.linalg.norm(reached - place) == pytest.approx(error, abs=1e-9)
    np.testing.assert_allclose(target_position(problem), (0.4, -0.25, 0.9))  # the caller's goal stays


def test_a_drag_that_ends_inside_of_a_thing_ends_on_it(problem: wb.Problem) -> None:
    corners = [present_position(problem), (0.3, -0.25, 0.95), (0.5, -0.1, 0.80), (0.5, -0.1, 0.66)]
    dragged = drag_along(problem, spread(corners, 40), "qp")
    judged = judge_drag(problem, dragged)
    assert dragged.end.status == "unreachable"
    assert 0.05 < dragged.end.assessment.goal_error < 0.12
    assert judged.depth.max() < 2e-4
    assert judged.between.max() <= 1e-3


def test_what_passes_through_a_thing_is_seen(problem: wb.Problem) -> None:
    """A drag that is not one: the hand is above the table, then under it, with nothing between."""
    above = drag_along(problem, [(0.4, -0.25, 0.9)] * 12, "qp")
    below = drag_along(problem, [(0.4, -0.25, 0.6)], "qp")
    q = np.array([above.end.q, above.end.q, _lowered(problem, above.end.q, 0.25)])
    faked = Dragged(
        q=q,
        targets=np.array([(0.4, -0.25, 0.9)]),
        dt=above.dt,
        method="none",
        seconds=np.zeros(1),
        cpu_seconds=np.zeros(1),
        iterations=np.zeros(1, dtype=np.intp),
        end=below.end,
    )
    judged = judge_drag(problem, faked)
    assert judged.between[0] == 1e-5
    assert judged.between[1] == np.inf
    assert judged.error[0] < 1e-4


def _lowered(problem: wb.Problem, q: np.ndarray, way: float) -> np.ndarray:  # type: ignore[type-arg]
    velocity = np.zeros(problem.scene.model.nv)
    velocity[2] = -way
    return np.asarray(pin.integrate(problem.scene.model, q, velocity))


def test_a_frame_keeps_its_orientation() -> None:
    scene = wb.Scene(wb.load("avatar"))
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 0.3))
    bent = {"hip_flexion": 0.2, "knee_flexion": 0.4, "ankle_dorsiflexion": 0.2}
    angles = {f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in bent.items()}
    own = wb.Problem(
        scene,
        scene.figure.with_joints(scene.figure.posture("standing"), angles),
        goals=[wb.Point("left_index_tip", (0.2, 0.4, 1.1)), wb.Frame("pelvis", (0.0, 0.0, 0.85, *turn.coeffs()))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
    )
    np.testing.assert_allclose(present_position(own, 1), own.start[:3])
    dragged = drag_along(own, spread([own.start[:3], (0.02, 0.03, 0.86)], 30), "newton", goal=1)
    assert dragged.end.solved
    root = pin.XYZQUATToSE3(dragged.q[-1][:7])
    np.testing.assert_allclose(root.translation, (0.02, 0.03, 0.86), atol=1.1e-5)
    np.testing.assert_allclose(root.rotation, turn.toRotationMatrix(), atol=1e-5)
