"""Feasibility first: what a descent with small pulls does not reach from the same start."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.suite.stability.catalogue import cases


def test_a_goal_beyond_a_limit_is_reached_from_the_other_side(honest):
    problem = cases(["long-way-round"])[0].question().problem
    solution = honest(problem, wb.methods.QP(budget=0, restarts=0).solve(problem))
    assert solution.status == "solved"
    assert solution.q[0] < 0.0 < problem.start[0]


def test_a_frozen_joint_is_not_turned_on(honest):
    whole = cases(["long-way-round"])[0].question().problem
    problem = wb.Problem(
        whole.scene, whole.start, goals=whole.goals, constraints=[wb.Freeze(whole.scene.figure.joints[0])]
    )
    solution = honest(problem, wb.methods.QP(budget=0, restarts=0).solve(problem))
    assert solution.status == "unreachable"
    assert solution.q[0] == problem.start[0]


@pytest.mark.parametrize(("measures", "number"), [(True, 74)])
def test_arms_cross_from_one_start(honest, number, measures):
    """Two of places alone, and one with directions, for which places come first."""
    problem = SETS["self_contact"].make(number, 0).problem
    assert honest(problem, wb.methods.QP(budget=0, restarts=0, measures=measures).solve(problem)).status == "solved"


def test_what_fits_is_kept_where_measures_lead_away(honest):
    problem = SETS["self_contact"].make(45, 0).problem
    assert honest(problem, wb.methods.QP(budget=0, restarts=0).solve(problem)).status == "solved"


def test_two_hands_come_to_the_face_from_one_start(honest, human):
    """Only hands held upright side by side fit there; hands that cross rest against each other 0.5 to 25 mm short."""
    from tests.audits.human_postures import face

    problem = face(human)
    assert honest(problem, wb.methods.QP(restarts=0).solve(problem)).status == "solved"
    palms = [human.placement(problem.start, f"{side}_palm").translation for side in ("left", "right")]
    assert np.linalg.norm(palms[0] - palms[1]) > 0.3  # they come from the sides


def test_whole_steps_stay_in_their_box(planar_arm):
    from wholebody.methods.control import Control
    from wholebody.methods.qp.feasibility import Feasibility
    from wholebody.methods.qp.iterates import Run
    from wholebody.methods.qp.settings import FEASIBILITY
    from wholebody.methods.qp.solvers.registry import make_solver
    from wholebody.methods.qp.subproblem import Subproblem

    problem = wb.Problem(
        wb.Scene(planar_arm((0.5, 0.4))), start=np.array([0.1, 0.4]), goals=[wb.Point("tip", (-0.5, 0.3, 0.0))]
    )
    workspace = problem.workspace()
    parts = Subproblem(problem, workspace.state), problem.lineariser(workspace), make_solver("active_set")
    run = Run(*parts, [], Control(np.inf))
    local = Feasibility(run, 1e-6, 100, figure=problem.scene.figure).run(problem.start)
    assert local.violation.worst <= 1e-6
    assert max(entry.step for entry in run.trace) <= FEASIBILITY.step + 1e-12
