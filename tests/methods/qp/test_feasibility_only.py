"""Feasibility only: sooner than the best posture, by damped steps that ask for the whole way."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.methods.qp.quadratic_program import StepSize
from wholebody.methods.qp.subproblem import Subproblem


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_the_first_posture_that_fits_meets_the_goals_sooner_and_costs_more(honest, tolerance):
    human = wb.load("human")
    scene = wb.Scene(human).add(wb.Box((0.6, 1.2, 0.03)), name="table", at=(0.75, 0.0, 0.75))
    goals = [wb.Point("right_index_tip", (0.55, 0.1, 0.85)), wb.Point("left_index_tip", (0.5, 0.3, 1.1))]
    problem = wb.Problem(scene, "standing", goals=goals, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])
    best = honest(problem, wb.methods.QP(tolerance=tolerance).solve(problem), tolerance)
    first = honest(problem, wb.methods.QP(tolerance=tolerance, measures=False).solve(problem), tolerance)
    assert best.status == first.status == "solved"
    assert first.iterations < best.iterations
    assert first.assessment.measure > best.assessment.measure


def test_feasibility_only_asks_for_full_steps_and_damps_it_as_the_page_says():
    human = wb.load("human")
    goals = [wb.Point("right_index_tip", (0.5, -0.3, 1.3)), wb.Point("left_index_tip", (0.4, 0.4, 1.1))]
    problem = wb.Problem(wb.Scene(human), "standing", goals=goals)
    workspace = problem.workspace()
    subproblem = Subproblem(problem, workspace.state)
    at = problem.lineariser(workspace).at(problem.start, 0.1)
    rows = subproblem.rows(at)
    piece = subproblem.program(at, rows, StepSize(0.3, 0.1, 0.0, False))
    whole = subproblem.program(at, rows, StepSize(0.3, 0.0, 0.5, False))
    assert np.abs(piece.target).max() == pytest.approx(0.1)
    assert whole.target == pytest.approx(-at.goal_error)
    assert np.ptp(piece.diagonal) > 0.0
    metric = np.sqrt(piece.diagonal / np.sort(piece.diagonal)[len(piece.diagonal) // 2])
    damping = 0.5 * at.goal_error @ at.goal_error * rows.soft_weight.max() * metric
    assert whole.diagonal == pytest.approx(piece.diagonal + damping)


def test_feasibility_only_damps_more_after_two_steps_that_are_rejected():
    """The way up through a board is blocked; the next step is damped more, the third asks for a piece of the way."""
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.5, 1.0, 0.04)), name="table", at=(0.6, 0.0, 0.8))
    goals = [wb.Point("right_hand", (0.5, -0.2, 0.95), offset=(0.0, 0.0, -0.05))]
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, goals=goals, constraints=feet, clearance=0.003)
    solution = wb.methods.QP(tolerance=1e-4, measures=False).solve(problem)
    first, second, third = solution.trace[:3]
    assert [first.note, second.note] == ["blocked", "blocked"]
    assert second.step < first.step
    assert third.note == "goal"
    assert solution.status == "solved"


def test_feasibility_only_far_away_does_not_crawl():
    problem = wb.Problem(wb.Scene(wb.load("human")), goals=[wb.Point("right_hand", (40.0, 0.0, 1.0))])
    solution = wb.methods.QP(measures=False).solve(problem)
    assert solution.status == "solved"
    assert solution.message == "solved directly"


def test_feasibility_only_of_a_goal_out_of_reach_comes_as_near_as_goes(planar_arm):
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    problem = wb.Problem(scene, start=np.array([0.1, 0.4, 0.3]), goals=[wb.Point("tip", (1.2, 0.9, 0.0))])
    solution = wb.methods.QP(measures=False).solve(problem)
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(0.5, abs=1e-5)


def test_a_start_that_fits_is_the_first_that_does(planar_arm):
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    start = np.array([0.1, 0.4, 0.3])
    tip = scene.state(start).frame(scene.frame_id("tip")).translation
    problem = wb.Problem(scene, start=start, goals=[wb.Point("tip", tip)], measures=[wb.tasks.Discomfort()])
    solution = wb.methods.QP(measures=False).solve(problem)
    assert solution.iterations == 0
    assert solution.q == pytest.approx(start, abs=1e-12)


def behind_a_panel(measures=None, at=(0.6, -0.1, 1.25)) -> wb.Problem:
    """Somebody who stands in front of a table and an upright panel, and reaches behind the panel."""
    scene = wb.Scene(wb.load("human", stature=1.75)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.5, 1.2, 0.04)), name="table", at=(0.55, 0.0, 0.78))
    scene.add(wb.Box((0.04, 0.5, 0.5)), name="panel", at=(0.45, -0.1, 1.25))
    feet, goals = [wb.Hold("left_foot"), wb.Hold("right_foot")], [wb.Point("right_index_tip", at)]
    return wb.Problem(scene, goals=goals, constraints=feet, measures=measures, clearance=0.002)


def test_what_is_reached_without_measures_does_not_depend_on_them():
    """Not a posture of the search: measures neither shape its steps nor decide between its ends."""
    method = wb.methods.QP(measures=False, restarts=4)
    for at in ((0.6, -0.1, 1.25), (0.9, -0.1, 1.25)):  # behind the panel, and out of reach
        usual = method.solve(behind_a_panel(at=at))
        other = method.solve(behind_a_panel([wb.tasks.Hang(weight=40.0), wb.tasks.Discomfort()], at))
        assert other.status == usual.status
        assert np.array_equal(other.q, usual.q)


def test_a_preference_does_not_make_a_goal_unreachable():
    """The left arm that is to hang by far more than anything else counts does not keep the right one from its goal."""
    for weight in (0.1, 1e4):
        measures = [wb.Effort(), wb.tasks.Rhythm(), wb.tasks.Hang(["left_upper_arm"], weight=weight)]
        assert wb.solve(behind_a_panel(measures)).status == "solved"


@pytest.mark.parametrize(("posture", "offset"), [("standing", (0.0, 0.1, 0.0)), ("arms_forward", (0.0, 0.1, 0.1))])
def test_a_finger_beside_the_head_is_reached(human: Figure, posture: str, offset: tuple[float, ...]) -> None:
    beside = pin.SE3(np.eye(3), np.array(offset))
    goal = wb.Relative("left_index_tip", "head_top", beside)
    found = wb.solve(wb.Problem(wb.Scene(human), human.posture(posture), goals=[goal]))
    assert found.solved
    tip, head = (human.placement(found.q, name) for name in ("left_index_tip", "head_top"))
    assert np.abs((beside.inverse() * head.inverse() * tip).homogeneous - np.eye(4)).max() < 1e-4
