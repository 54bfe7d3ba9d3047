"""Whole problems by Newton's method: against the qp method, and against what must hold."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.answers import honest
from wholebody.methods.newton import multistart
from wholebody.methods.newton.batches import Unit
from wholebody.methods.newton.feasibility import FeasibilityResult, satisfy
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.inequalities import SquaredSlacks
from wholebody.methods.newton.settings import STARTS
from wholebody.methods.newton.system import System
from wholebody.methods.newton.terms import FigureSystem
from wholebody.tasks.base import Bound


@pytest.fixture(scope="module")
def avatar() -> wb.Figure:
    """Return a person with fewer joints, for what does not depend on them."""
    return wb.load("avatar")


def _standing(scene: wb.Scene, *goals: Any, **more: Any) -> wb.Problem:
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(scene, "standing", goals=goals, constraints=holds, **more)


def _honest(problem: wb.Problem, solution: wb.Solution, tolerance: float = 1e-5) -> None:
    judged = honest(problem, solution, tolerance)
    assert judged.met(1.1 * tolerance + 2e-6) == (solution.status == "solved")


@pytest.mark.parametrize("name", ["human", "avatar", "hand"])
def test_postures_go_in_and_out(name: str) -> None:
    figure = wb.load(name)
    bodies, rng = FigureBodies(figure), np.random.default_rng(0)
    for _ in range(5):
        lower, upper = figure.tangent_bounds(figure.neutral)
        move = rng.uniform(np.maximum(lower, -1.0), np.minimum(upper, 1.0))
        q = figure.clamp(pin.integrate(figure.model, figure.neutral, move))
        again = bodies.posture(bodies.variables(q))
        assert pin.difference(figure.model, q, again) == pytest.approx(np.zeros(figure.model.nv), abs=1e-9)


def test_every_joint_of_the_human_holds_at_any_posture(human: wb.Figure) -> None:
    bodies = FigureBodies(human)
    batches = [Unit(bodies.names), *bodies.equations.batches()]
    system = System(batches, bodies.weight)
    for name in human.postures:
        assert np.abs(system.residual(bodies.variables(human.posture(name)))).max() < 1e-12


def test_it_finds_what_the_qp_method_finds(human: wb.Figure) -> None:
    problem = _standing(wb.Scene(human), wb.Point("right_index_tip", (0.3, -0.3, 1.9)))
    ours, theirs = wb.methods.Newton().solve(problem), wb.methods.QP().solve(problem)
    _honest(problem, ours)
    assert ours.status == theirs.status == "solved"
    # two methods that share no code end at the same effort, which is the global one or the same local one
    assert ours.assessment.measure == pytest.approx(theirs.assessment.measure, rel=1e-3)


def test_things_in_the_way_are_not_entered(avatar: wb.Figure, least_distance: Callable[..., float]) -> None:
    scene = wb.Scene(avatar).add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.75, 0, 0.72))
    problem = _standing(scene, wb.Point("right_index_tip", (0.5, 0.2, 0.8)), clearance=0.005)
    solution = wb.methods.Newton(restarts=0).solve(problem)
    assert solution.solved
    _honest(problem, solution)
    assert least_distance(scene, solution.q) >= problem.clearances.min() - 1e-5


def test_two_hands_on_one_box_close_a_loop(human: wb.Figure) -> None:
    scene = wb.Scene(human)
    q = human.posture("arms_forward")
    problem = wb.Problem(
        scene,
        q,
        goals=[wb.Point("left_palm", scene.state(q).frame(human.frame_id("left_palm")).translation + (0, 0, 0.1))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Hold("right_palm", relative_to="left_palm")],
        measures=[wb.Effort()],
    )
    ours, theirs = wb.methods.Newton(tolerance=1e-8).solve(problem), wb.methods.QP(tolerance=1e-8).solve(problem)
    assert ours.status == theirs.status == "solved"
    assert ours.assessment.constraint_violation < 1e-6
    assert ours.assessment.measure == pytest.approx(theirs.assessment.measure, rel=1e-8)
    assert np.abs(pin.difference(human.model, ours.q, theirs.q)).max() < 1e-5


def test_a_goal_out_of_reach_is_approached_and_said_to_be(avatar: wb.Figure) -> None:
    problem = _standing(wb.Scene(avatar), wb.Point("right_index_tip", (3.0, 0.0, 1.0)))
    solution = wb.methods.Newton(restarts=0, iterations=40).solve(problem)
    assert solution.status in ("unreachable", "stalled")
    assert solution.assessment.holds(1.2e-5)
    reached = wb.methods.QP(restarts=0).solve(problem).assessment.goal_error
    assert solution.assessment.goal_error < reached + 0.1


def test_few_other_starts_are_tried_for_a_goal_farther_than_all_links(planar_arm) -> None:
    problem = wb.Problem(wb.Scene(planar_arm((0.4, 0.3))), goals=[wb.Point("tip", (3.0, 0.1, 0.0))])
    solution = wb.methods.Newton().solve(problem)
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(np.hypot(3.0, 0.1) - 0.7, abs=1e-4)
    assert "another start" not in solution.message
    assert solution.iterations <= wb.methods.Newton(restarts=0).solve(problem).iterations + 2 * STARTS.trial


def test_a_thing_in_the_way_of_a_goal_out_of_reach_is_gone_round_by_other_starts(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3))).add(wb.Box((0.1, 0.1, 0.1)), name="post", at=(0.25, 0.3, 0.0))
    goals = [wb.Point("tip", (3.0, 0.1, 0.0))]
    alone = wb.methods.Newton(restarts=0).solve(wb.Problem(scene, (2.0, 0.0), goals=goals))
    solution = wb.methods.Newton().solve(wb.Problem(scene, (2.0, 0.0), goals=goals))
    assert alone.assessment.goal_error > np.hypot(3.0, 0.1) - 0.6
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(np.hypot(3.0, 0.1) - 0.7, abs=1e-4)


def test_steps_that_end_far_from_a_minimum_do_not_call_a_goal_unreachable(planar_arm, monkeypatch) -> None:
    """So they ended with joints that follow others: within 26 mm of a goal of a Panda's, optimality 1e-2."""

    def ended(*given: Any, iterations: int, **more: Any) -> FeasibilityResult:
        return satisfy(*given, iterations=min(iterations, 1), **more)._replace(stationary=True)

    monkeypatch.setattr(multistart, "satisfy", ended)
    problem = wb.Problem(wb.Scene(planar_arm((0.4, 0.3))), (0.5, 0.5), goals=[wb.Point("tip", (-0.3, -0.4, 0.0))])
    solution = wb.methods.Newton(restarts=0).solve(problem)
    assert solution.assessment.optimality > 1e-2
    assert solution.status == "stalled"


def test_frozen_joints_stay(human: wb.Figure) -> None:
    problem = wb.Problem(
        wb.Scene(human),
        "standing",
        goals=[wb.Point("right_index_tip", (0.4, -0.3, 1.1))],
        constraints=[wb.Freeze("root", "left_leg", "right_leg")],
    )
    solution = wb.methods.Newton().solve(problem)
    assert solution.solved
    still = human.dofs(["root", "left_leg", "right_leg"])
    assert np.abs(pin.difference(human.model, problem.start, solution.q)[still]).max() < 1e-5


class _Leash(Bound):
    """A bound of somebody's own."""

    def bounds(self, state: Any, dt: float | None) -> tuple[np.ndarray, np.ndarray]:
        return np.full(state.model.nv, -1.0), np.full(state.model.nv, 1.0)


def test_what_it_has_no_equations_for_is_refused_by_name(human: wb.Figure) -> None:
    bounded = wb.Problem(wb.Scene(human), "standing", constraints=[_Leash()])
    with pytest.raises(wb.InputError, match=r"bounds\[0\], _Leash"):
        wb.methods.Newton().solve(bounded)
    assert "_Leash" in str(wb.methods.Newton().accepts(bounded))
    with pytest.raises(wb.InputError, match="tolerance"):
        wb.methods.Newton(tolerance=0.0)
    with pytest.raises(wb.InputError, match="restarts"):
        wb.methods.Newton(restarts=-1)
    with pytest.raises(wb.UnknownNameError):
        wb.methods.Newton(algebra="cholesky")


def test_a_measure_of_the_roots_place_is_minimised(human: wb.Figure) -> None:
    """The pelvis may sink or rise, and no effort counts it: moved by a tenth of a radian, none of its joints gains."""
    goal, height = wb.Point("right_palm", (0.3, -0.3, 1.0)), wb.tasks.PotentialEnergy()
    problem = _standing(wb.Scene(human), goal, measures=[height])
    method = wb.methods.Newton()
    assert method.leaves_out(problem) == ()
    found = method.solve(problem)
    assert found.status == "solved"
    plain = method.solve(_standing(wb.Scene(human), goal))
    assert found.assessment.measure < 0.9 * wb.assess(problem, plain.q).measure


def test_nothing_is_jumped_over(avatar: wb.Figure, least_distance: Callable[..., float]) -> None:
    # a plate a millimetre thick between the hand and its goal; steps of the hand are up to eight centimetres
    scene = wb.Scene(avatar).add(wb.Box((0.001, 0.6, 0.6)), name="plate", at=(0.4, -0.25, 1.1))
    problem = _standing(scene, wb.Point("right_index_tip", (0.5, -0.25, 1.1)))
    active_system = FigureSystem(problem, problem.workspace(), "auto")
    visited = [problem.start]
    arrive = active_system.arrive

    def watched(x: Any) -> bool:
        changed = arrive(x)
        visited.append(active_system.q.copy())
        return changed

    active_system.arrive = watched  # type: ignore[method-assign]
    satisfy(active_system, active_system.variables(problem.start), tolerance=1e-5, iterations=60)
    assert len(visited) > 10
    for before, after in itertools.pairwise(visited):
        way = [least_distance(scene, pin.interpolate(avatar.model, before, after, t)) for t in np.linspace(0, 1, 9)]
        assert min(way) > -2e-3


def test_constraints_that_cannot_all_hold_end_near_all_of_them_and_in_nothing(avatar: wb.Figure) -> None:
    problem = _standing(wb.Scene(avatar).add(wb.HalfSpace(), name="floor"))
    impossible = wb.Problem(
        problem.scene,
        "standing",
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Hold("head", at=(0.0, 0.0, 2.5))],
    )
    solution = wb.methods.Newton(restarts=0, iterations=12).solve(impossible)
    assert solution.status in ("infeasible", "stalled")
    assert "Hold" in solution.message
    assert solution.assessment.penetration < 1e-4
    assert solution.assessment.constraint_violation < 0.7  # the head stands at 1.7 m


def test_speeds_hold_in_every_frame(avatar: wb.Figure) -> None:
    limit = wb.tasks.StepLimit(1.0, root_velocity=0.5, root_turn=0.5)
    goal = wb.Point("right_index_tip", (0.4, -0.2, 1.2))
    problem = wb.Problem(
        wb.Scene(avatar), "standing", goals=[goal], constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), limit]
    )
    q, dt = problem.start, 0.05
    tracker = wb.methods.Newton().tracker(problem, dt)
    lower, upper = problem.bounds[0].bounds(problem.scene.state(q), dt)
    for _ in range(40):
        after = tracker.step(q).q
        way = pin.difference(avatar.model, q, after)
        assert (way >= lower - 1e-9).all()
        assert (way <= upper + 1e-9).all()
        q = after
    assert wb.assess(problem, q).goal_error < 2e-4


def test_a_barrier_goes_where_slacks_go() -> None:
    problem = _standing(wb.Scene(wb.load("avatar")), wb.Point("right_index_tip", (0.6, -0.2, 0.3)))
    slack, barrier = (wb.methods.Newton(inequalities=kind).solve(problem) for kind in ("slack", "barrier"))
    for solution in (slack, barrier):
        _honest(problem, solution)
        assert solution.solved
    assert slack.assessment.measure == pytest.approx(barrier.assessment.measure, rel=1e-4)


def test_the_effort_of_the_root_is_minimised_too(human: wb.Figure) -> None:
    problem = _standing(
        wb.Scene(human),
        wb.Point("right_index_tip", (0.3, -0.4, 1.5)),
        measures=[wb.Effort()],
        range_of_motion=False,
        balance=False,
    )
    assert (human.effort_weights[:6] > 0.0).all()
    found = {method: wb.solve(problem, method=method).assessment for method in ("qp", "newton")}
    assert found["newton"].goal_error < 1e-5
    assert found["newton"].measure == pytest.approx(found["qp"].measure, rel=1e-4)


def test_a_touch_reaches_the_least_measure_in_few_iterations() -> None:
    """The surface and the holds curve, so that plain steps come nearer by little each."""
    scene = wb.Scene(wb.load("human", sex="male", stature=1.75)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Sphere(0.2), name="ball", at=(0.1, -0.9, 1.3))
    feet = [wb.Hold("left_sole"), wb.Hold("right_sole")]
    problem = wb.Problem(scene, goals=[wb.Touch("right_hand", "ball")], constraints=feet, measures=[wb.Effort()])
    solution = wb.solve(problem, method=wb.methods.Newton(time_limit=math.inf))
    assert solution.status == "solved"
    assert solution.iterations < 62  # 74 unaccelerated
    assert solution.assessment.measure < 1.0001 * wb.solve(problem).assessment.measure


def test_joints_that_move_together_take_few_iterations() -> None:
    """With the diagonal that bounds the second derivative of `Rhythm`, in place of its squares, 162 and 16."""
    scene = wb.Scene(wb.load("human"))
    start = scene.figure.posture("arms_forward")
    palm = scene.state(start).frame(scene.frame_id("left_palm")).translation
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, start, goals=[wb.Point("left_palm", palm + (0.0, 0.0, 0.1))], constraints=holds)
    assert any(isinstance(measure, wb.tasks.Rhythm) for measure in problem.measures)
    found = [
        wb.solve(problem, method=method) for method in (wb.methods.Newton(tolerance=1e-8), wb.methods.QP(restarts=0))
    ]
    assert [solution.status for solution in found] == ["solved", "solved"]
    assert found[0].iterations < 60
    assert found[1].iterations <= 10
    assert found[0].assessment.measure == pytest.approx(found[1].assessment.measure, rel=1e-5)


def test_inequalities_that_all_pull_are_released_together() -> None:
    """Of six that are active, each released one by one costs a linear system."""
    state = SquaredSlacks(np.zeros(6))
    released = np.array((1.0, -1.0, -2.0, 1.0, -0.5, -0.1))
    assert state.correct(np.zeros(6), released) == (1.0, True)
    np.testing.assert_array_equal(state.slack == 0.0, released > 0.0)
    assert state.correct(np.zeros(6), -np.abs(released)) == (1.0, True)  # from now on one at a time
    assert (state.slack == 0.0).sum() == 1
    state.begin(np.zeros(6))
    assert (state.slack == 0.0).all()
