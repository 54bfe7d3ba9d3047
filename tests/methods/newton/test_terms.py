"""Terms as equations of bodies: what they say at random postures, and what solves with them find."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.measures import FigureObjective
from wholebody.methods.newton.terms import constraint_equations, goal_equations


def _postures(figure: wb.Figure, count: int = 5) -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    lower, upper = figure.tangent_bounds(figure.neutral)
    moves = (rng.uniform(np.maximum(lower, -0.8), np.minimum(upper, 0.8)) for _ in range(count))
    return [figure.clamp(pin.integrate(figure.model, figure.neutral, move)) for move in moves]


def _residual(problem: wb.Problem, q: np.ndarray) -> np.ndarray:
    """Of the goals and constraints alone."""
    bodies = FigureBodies(problem.scene.figure)
    everything = np.concatenate([bodies.variables(q), (0, 0, 0, 0, 0, 0, 1.0)]).reshape(-1, 7)
    sets = goal_equations(problem, bodies, problem.goals), constraint_equations(problem, bodies)
    batches = [batch for one in sets for batch in one.batches()]
    return np.concatenate([batch.residual(everything).ravel() for batch in batches])


def test_the_centre_of_mass_is_pinocchios(human: wb.Figure) -> None:
    target = np.array((0.1, -0.2, 0.9))
    problem = wb.Problem(wb.Scene(human), "standing", goals=[wb.CenterOfMass(target)], range_of_motion=False)
    for q in _postures(human):
        center = pin.centerOfMass(human.model, human.model.createData(), q)
        assert _residual(problem, q) == pytest.approx(center - target, abs=1e-9)


def test_an_axis_towards_a_place_says_its_angle(human: wb.Figure) -> None:
    place = np.array((1.0, 0.5, 0.3))
    problem = wb.Problem(
        wb.Scene(human), "standing", goals=[wb.Axis("head", (1, 0, 0), toward=place)], range_of_motion=False
    )
    for q in _postures(human):
        head = problem.scene.state(q).frame(human.frame_id("head"))
        way = place - head.translation
        angle = np.arccos(head.rotation[:, 0] @ way / np.linalg.norm(way))
        assert np.linalg.norm(_residual(problem, q)) == pytest.approx(angle, abs=1e-9)


def test_a_posture_goal_is_each_joints_distance(human: wb.Figure) -> None:
    goal = wb.Posture("arms_forward", joints=["upper_body"])
    problem = wb.Problem(wb.Scene(human), "standing", goals=[goal], range_of_motion=False)
    for q in _postures(human):
        wanted = problem.goals[0].error(problem.scene.state(q))
        assert np.sort(_residual(problem, q)) == pytest.approx(np.sort(wanted), abs=1e-9)
    whole = wb.Problem(wb.Scene(human), "standing", goals=[wb.Posture("arms_forward")], range_of_motion=False)
    assert np.abs(_residual(whole, human.posture("arms_forward"))).max() < 1e-9


def test_the_objective_has_the_measures_gradient(human: wb.Figure) -> None:
    measures = [wb.Effort(0.5), wb.tasks.Displacement(), wb.tasks.Discomfort(2.0)]
    problem = wb.Problem(wb.Scene(human), "standing", measures=measures)
    bodies = FigureBodies(human)
    objective = FigureObjective(problem, bodies, problem.workspace().state)
    for q in _postures(human):
        x = bodies.variables(q)
        assert objective.value(q) == pytest.approx(wb.assess(problem, q).measure)
        objective.renew(q)
        everything = np.concatenate([x, (0, 0, 0, 0, 0, 0, 1.0)]).reshape(-1, 7)
        force = objective.stiffness * np.concatenate(
            [rows.residual(everything).ravel() for rows in objective.batches()]
        )
        gradient = sum(term.weight * term.gradient(problem.scene.state(q)) for term in problem.measures)
        assert force == pytest.approx(5.0 * gradient, rel=1e-6, abs=1e-9)


CASES: dict[str, tuple[list[Any], list[Any], list[Any] | None]] = {
    "balance": ([wb.Point("right_index_tip", (0.75, -0.2, 0.7))], [wb.Balance(margin=0.02)], None),
    "cones": ([wb.Point("right_index_tip", (-0.2, -0.4, 1.2))], [wb.tasks.ReachCones()], None),
    "discomfort": ([wb.Point("right_index_tip", (0.4, -0.3, 1.2))], [], [wb.Effort(), wb.tasks.Discomfort(0.5)]),
}


@pytest.mark.parametrize("name", CASES)
def test_it_finds_no_worse_than_the_qp_method(human: wb.Figure, name: str) -> None:
    goals, constraints, measures = CASES[name]
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(
        wb.Scene(human), "standing", goals=goals, constraints=[*holds, *constraints], measures=measures
    )
    ours, theirs = wb.methods.Newton().solve(problem), wb.methods.QP().solve(problem)
    assert ours.status == theirs.status == "solved"
    judged = wb.assess(problem, ours.q)
    assert judged.holds(1.2e-5)
    assert judged.met(1.2e-5)
    assert judged.measure <= (1.0 + 1e-3) * theirs.assessment.measure  # the same least, or a lower one
