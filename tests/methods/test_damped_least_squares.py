"""Damped least squares against an arm that trigonometry solves, and what it says where it must not claim success."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wholebody as wb
from tests.answers import honest
from wholebody.base.errors import InputError, TermError
from wholebody.methods.damped_least_squares import DampedLeastSquares


@pytest.fixture(scope="module")
def arm(planar_arm: Callable[..., wb.Figure]) -> wb.Figure:
    return planar_arm((0.4, 0.3))


def judged(problem: wb.Problem, solution: wb.Solution) -> wb.Assessment:
    return honest(problem, solution, kept=("solved",))


@given(st.floats(0.11, 0.69), st.floats(-np.pi, np.pi), st.sampled_from((-1.0, 1.0)))
def test_two_links_bend_as_the_law_of_cosines_says(
    planar_arm: Callable[..., wb.Figure], distance: float, bearing: float, side: float
) -> None:
    arm = planar_arm((0.4, 0.3), limit=4.0)
    target = (distance * np.cos(bearing), distance * np.sin(bearing), 0.0)
    start = np.array([bearing - 0.3 * side, side])
    problem = wb.Problem(wb.Scene(arm), np.clip(start, -4.0, 4.0), goals=[wb.Point("tip", target)])
    solution = DampedLeastSquares(tolerance=1e-8).solve(problem)
    assert solution.solved, solution.message
    inner = np.pi - np.arccos((0.4**2 + 0.3**2 - distance**2) / (2 * 0.4 * 0.3))
    assert np.cos(solution.q[1]) == pytest.approx(np.cos(inner), abs=1e-5)


def test_out_of_reach_the_arm_points_at_the_goal_and_rests(arm: wb.Figure) -> None:
    problem = wb.Problem(wb.Scene(arm), np.array([0.2, 0.9]), goals=[wb.Point("tip", (0.0, 1.7, 0.0))])
    solution = DampedLeastSquares().solve(problem)
    assert solution.status == "unreachable", solution.message
    assert judged(problem, solution).goal_error == pytest.approx(1.0, abs=1e-6)
    assert solution.q == pytest.approx([np.pi / 2, 0.0], abs=1e-3)


def test_limits_stop_a_joint_and_the_others_go_on(planar_arm: Callable[..., wb.Figure]) -> None:
    arm = planar_arm((0.4, 0.3, 0.2), limit=0.5)
    reached = np.array([0.5, 0.5, 0.3])
    tip = wb.Scene(arm).state(reached).frame(arm.frame_id("tip")).translation
    problem = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", np.array(tip))])
    solution = wb.solve(problem, "dls")
    assert solution.solved
    assert solution.iterations <= 12, "a joint at its limit holds the others up"
    judged(problem, solution)


def test_a_singular_start_on_the_goals_line_does_not_move_and_does_not_claim_success(arm: wb.Figure) -> None:
    problem = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", (0.5, 0.0, 0.0))])
    solution = DampedLeastSquares().solve(problem)
    assert solution.status == "unreachable"
    assert solution.q == pytest.approx(np.zeros(2), abs=1e-9)


def test_it_does_not_see_a_ball_and_says_so(planar_arm: Callable[..., wb.Figure]) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3))).add(wb.Sphere(0.05), name="ball", at=(0.0, 0.5, 0.0))
    problem = wb.Problem(scene, np.array([0.3, 0.6]), goals=[wb.Point("tip", (0.0, 0.5, 0.0))])
    solution = DampedLeastSquares().solve(problem)
    assert judged(problem, solution).goal_error < 1e-5
    assert solution.assessment.penetration > 0.04
    assert solution.status == "infeasible"
    assert "leaves out contacts" in solution.message
    scene.move("ball", at=(-0.2, 0.4, 0.0))  # beside the goal, which another posture reaches
    beside = wb.Problem(scene, np.array([2.0, 0.3]), goals=[wb.Point("tip", (-0.35, 0.55, 0.0))])
    with pytest.warns(UserWarning, match="'dls' leaves out contacts, which the assessment alone judges"):
        message = wb.solve(beside, "dls").message
    assert message.startswith("this method leaves out contacts: the clearance of a pair is missed"), message


def test_feet_stay_where_a_goal_out_of_reach_pulls(human: wb.Figure) -> None:
    problem = wb.Problem(
        wb.Scene(human),
        goals=[wb.Point("right_index_tip", (2.5, 0.0, 1.5))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
        range_of_motion=False,  # inequalities, which this method does not take
        balance=False,
    )
    solution = DampedLeastSquares().solve(problem)
    judgement = judged(problem, solution)
    assert judgement.constraint_violation < 1e-5
    assert judgement.goal_error < wb.assess(problem, problem.start).goal_error - 0.3
    assert not solution.solved


def test_every_goal_and_frozen_joints(human: wb.Figure) -> None:
    scene = wb.Scene(human)
    witness = human.with_joints(human.neutral, {"right_elbow_flexion": 1.2, "right_shoulder_flexion": 0.4})
    state = scene.state(witness)
    palm = pin.SE3(state.frame(human.frame_id("right_palm")))
    gaze = state.frame(human.frame_id("head")).rotation[:, 0].copy()
    problem = wb.Problem(
        scene,
        goals=[
            wb.Frame("right_palm", palm),
            wb.Axis("head", (1.0, 0.0, 0.0), direction=gaze),
            wb.CenterOfMass(state.center_of_mass(), axes="xy"),
            wb.Posture(witness, joints=["left_arm"]),
        ],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Freeze("neck")],
    )
    solution = DampedLeastSquares().solve(problem)
    judgement = judged(problem, solution)
    assert judgement.met(2e-5), solution.message
    assert judgement.constraint_violation < 2e-5
    frozen = human.dofs(["neck"])
    assert np.array_equal(pin.difference(human.model, problem.start, solution.q)[frozen], np.zeros(len(frozen)))


@pytest.mark.parametrize(
    "term",
    [wb.Balance(), wb.Plane("right_hand", (0, 0, 1), side="above"), wb.tasks.ReachCones()],
    ids=lambda term: type(term).__name__,
)
def test_inequalities_are_refused_by_name(human: wb.Figure, term: wb.Constraint) -> None:
    problem = wb.Problem(wb.Scene(human), goals=[wb.Point("head", (0, 0, 1.5))], constraints=[term])
    with pytest.raises(InputError, match=type(term).__name__):
        DampedLeastSquares().solve(problem)


class _Fickle(wb.Goal):
    """Another number of rows from the second time on that it is asked."""

    def __init__(self) -> None:
        self.asked = 0

    def resolve(self, scene: Any, start: Any) -> _Fickle:
        return self

    def error(self, state: Any) -> Any:
        self.asked += 1
        return np.full(3 if self.asked < 9 else 4, 0.1)

    def jacobian(self, state: Any) -> Any:
        return np.full((3 if self.asked < 9 else 4, state.model.nv), 0.01)


@pytest.mark.parametrize("before", range(9))
def test_a_goal_that_changes_its_rows_is_refused_or_followed(arm: wb.Figure, before: int) -> None:
    goal = _Fickle()
    goal.asked = before
    solution = None
    with suppress(TermError):
        solution = DampedLeastSquares().solve(wb.Problem(wb.Scene(arm), goals=[goal]))
    assert solution is None or (np.isfinite(solution.q).all() and not solution.solved)  # it is always 0.1 off
