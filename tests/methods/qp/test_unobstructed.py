"""The compiled descent of plain chains against Pinocchio and the textbook method, and when its end is taken."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.stability.bodies import spatial_arm
from wholebody.figures.description import Limits
from wholebody.figures.state import State
from wholebody.methods.control import Control
from wholebody.methods.damped_least_squares import DampedLeastSquares
from wholebody.methods.qp.rows import Goals
from wholebody.methods.qp.unobstructed import compiled_kernel, plain_chain, reach, takes, unobstructed
from wholebody.tasks.base import Goal

START = np.array([-0.4, 0.5, 0.9, 0.0, 0.5, 0.0])


@pytest.fixture(scope="module")
def arm() -> wb.Figure:
    return spatial_arm()


def found(problem: wb.Problem, tolerance: float = 1e-6, most: int = 60, progress=None):
    with problem.borrow() as workspace:
        return unobstructed(problem, workspace, tolerance, most, Control(progress=progress))


def place_of(figure: wb.Figure, q: np.ndarray, frame: str) -> pin.SE3:
    return pin.SE3(State(figure.model).update(q).frame(figure.frame_id(frame)))


def random_goal(figure: wb.Figure, frame: str, rng: np.random.Generator, turned: bool) -> Goal:
    q = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit)
    place = place_of(figure, q, frame)
    return wb.Frame(frame, place) if turned else wb.Point(frame, place.translation)


def test_joints_are_where_pinocchio_has_them():
    """Axes along and across the frames, slides and branches, each joint turned against the one before."""
    model, rng = pin.Model(), np.random.default_rng(3)
    oblique = np.array([1.0, 2.0, -1.0]) / 6**0.5
    kinds = [
        pin.JointModelRX(), pin.JointModelPZ(), pin.JointModelRevoluteUnaligned(oblique), pin.JointModelRY(),
        pin.JointModelPrismaticUnaligned(oblique), pin.JointModelRZ(),
    ]  # fmt: skip
    for number, (kind, parent) in enumerate(zip(kinds, (0, 1, 2, 2, 4, 5), strict=True)):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        place = pin.SE3(turn * np.sign(np.linalg.det(turn)), rng.normal(size=3))
        model.addJoint(parent, kind, place, f"joint {number}")
    chain, state = plain_chain(model, Limits(*np.zeros((2, 0), dtype=np.intp), *np.zeros((2, 0)))), State(model)
    assert chain is not None
    goals = Goals(np.zeros((0, 36)), np.zeros((0, 7), dtype=np.int64), state.support.astype(np.int8))
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, model.nq)
        compiled_kernel().reach(chain, goals, 0.0, 1.0, np.zeros((0, model.nv)), q, np.empty((1, 2)))
        state.update(q)
        np.testing.assert_allclose(chain.joints, state.joints, atol=1e-13)
        np.testing.assert_allclose(chain.columns, state.columns, atol=1e-13)


def test_rows_of_goals_are_derivatives_of_their_errors(two_arms):
    """By central differences of the errors that the goals themselves compute, one goal relative to the other arm."""
    rng = np.random.default_rng(5)
    start = rng.uniform(-1.0, 1.0, 7)
    goals = [random_goal(two_arms, "left", rng, True), wb.Relative("right", "left", (0.1, 0.2, 0.3))]
    problem = wb.Problem(wb.Scene(two_arms), start, goals=goals)
    with problem.borrow() as workspace:
        plan, state = problem.lineariser(workspace).plan, State(two_arms.model)
        chain = plain_chain(two_arms.model, two_arms.limits)
        assert chain is not None
        _, _, rows = reach(chain, plan, start, 0.0, 1)

    def errors(q):
        state.update(q)
        return np.concatenate([goal.error(state) for goal in problem.goals])

    step = 1e-6
    for joint, row in enumerate(np.eye(7) * step):
        slope = (errors(start + row) - errors(start - row)) / (2.0 * step)
        np.testing.assert_allclose(rows[:, joint], slope, atol=1e-6)


@pytest.mark.parametrize("turned", [False, True])
def test_steps_are_those_of_the_textbook_method(arm, two_arms, turned):
    """`DampedLeastSquares` is an array version of the same steps, with kinematics and rows by Pinocchio."""
    rng, stopped = np.random.default_rng(7), 0
    for number in range(20):
        figure, frame = (arm, "tip") if number % 2 else (two_arms, "left")
        start = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit)
        problem = wb.Problem(wb.Scene(figure), start, goals=[random_goal(figure, frame, rng, turned)])
        with problem.borrow() as workspace:
            plan = problem.lineariser(workspace).plan
        chain = plain_chain(figure.model, figure.limits)
        assert chain is not None
        for most in (1, 2, 3):
            q, seen, _ = reach(chain, plan, start, 1e-12, most)
            textbook = DampedLeastSquares(iterations=most, tolerance=1e-9).solve(problem)
            if seen[-1, 0] == seen[:, 0].min():
                stopped += bool(np.isin(q, (*figure.limits.lower, *figure.limits.upper)).any())
                np.testing.assert_allclose(q, textbook.q, atol=1e-9)
    assert stopped > 0, "some steps end at limits"


def test_what_is_found_is_at_the_goal_to_rounding(arm):
    rng, count = np.random.default_rng(11), 0
    for _ in range(40):
        goal = random_goal(arm, "tip", rng, True)
        met = found(wb.Problem(wb.Scene(arm), START, goals=[goal]))
        if met is not None:
            count += 1
            off = pin.log6(place_of(arm, met.q, "tip").actInv(pin.SE3(goal.target))).vector
            assert np.abs(off).max() < 1e-9
            assert (arm.limits.lower <= met.q).all()
            assert (met.q <= arm.limits.upper).all()
            assert met.trace[-1].goal_error < 1e-9
    assert count > 20


def test_an_end_inside_of_something_is_forgotten(arm):
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    free = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", goal)])
    met = found(free)
    assert met is not None
    middle = np.array(State(arm.model).update(met.q).data.oMi[4].translation)
    scene = wb.Scene(arm).add(wb.Sphere(0.03), name="ball", at=middle)
    blocked = wb.Problem(scene, START, goals=[wb.Point("tip", goal)])
    assert found(blocked) is None
    for measures in (True, False):
        solution = wb.QP(measures=measures).solve(blocked)
        assert solution.solved, solution.message
        assert solution.assessment.penetration < 1e-5
        assert "unobstructed" not in [entry.note for entry in solution.trace]


def test_a_clearance_that_is_missed_counts_as_something_in_the_way(arm):
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    met = found(wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", goal)]))
    assert met is not None
    scene = wb.Scene(arm).add(wb.Sphere(0.02), name="ball", at=tuple(goal + (0.0, 0.0, 0.15)))
    room = wb.assess(wb.Problem(scene, START, goals=[wb.Point("tip", goal)]), met.q).least_distance
    for clearance, free in ((0.9 * room, True), (1.1 * room, False)):
        problem = wb.Problem(scene, START, goals=[wb.Point("tip", goal)], clearance=clearance)
        assert (found(problem) is not None) == free


def test_goals_out_of_reach_are_left_to_the_search(arm):
    problem = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", (3.0, 0.0, 0.5))])
    assert found(problem) is None
    assert wb.QP().solve(problem).status == "unreachable"


def test_what_it_does_not_know_it_does_not_take(arm):
    class Own(wb.Point):
        """A goal of one's own."""

    point, scene = wb.Point("tip", (0.4, 0.2, 0.6)), wb.Scene(arm)
    stated = {
        "a point": (True, wb.Problem(scene, START, goals=[point])),
        "two goals": (True, wb.Problem(scene, START, goals=[point, wb.Orientation("tip", np.eye(3))])),
        "no goals": (False, wb.Problem(scene, START)),
        "an axis": (False, wb.Problem(scene, START, goals=[point, wb.Axis("tip", (0, 0, 1), toward=(1.0, 0.0, 0.0))])),
        "a frozen joint": (False, wb.Problem(scene, START, goals=[point], constraints=[wb.Freeze("base")])),
        "a plane": (False, wb.Problem(scene, START, goals=[point], constraints=[wb.Plane("tip", normal=(0, 0, 1))])),
        "a goal of one's own": (False, wb.Problem(scene, START, goals=[Own("tip", (0.4, 0.2, 0.6))])),
    }
    for what, (known, problem) in stated.items():
        with problem.borrow() as workspace:
            assert takes(problem.lineariser(workspace).plan) == known, what
    avatar = wb.load("avatar")
    free_root = wb.Problem(wb.Scene(avatar), goals=[wb.Point("right_palm", (0.4, -0.2, 1.0))], range_of_motion=False)
    assert found(free_root) is None


def test_every_step_is_told_and_counted(arm):
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    problem, told = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", goal)]), []
    solution = wb.QP(measures=False).solve(problem, told.append)
    assert solution.solved
    assert solution.programs == {}
    assert solution.iterations == len(solution.trace) == len(told) > 0
    with_measures = wb.QP().solve(problem)
    assert with_measures.assessment.measure <= solution.assessment.measure + 1e-9
    assert found(problem, most=2) is None, "no more steps than the method's iterations"


def test_a_solve_that_ends_early_answers_with_what_was_met(arm):
    """The descent for the measures leaves the goals by the square of its steps; what it began with is met already."""
    rng, early = np.random.default_rng(17), 0
    for _ in range(6):
        problem = wb.Problem(wb.Scene(arm), START, goals=[random_goal(arm, "tip", rng, False)])
        whole = wb.solve(problem)
        first = sum(entry.note == "unobstructed" for entry in whole.trace)
        for most in range(first + 1, len(whole.trace) + 1) if first else ():
            told = iter(range(1, 1000))
            ended = wb.solve(problem, progress=lambda entry, told=told, most=most: next(told) >= most)
            assert ended.solved, ended.message
            early += 1
    assert early > 10


def test_progress_that_ends_is_not_called_again(arm):
    problem = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", place_of(arm, START + 0.1, "tip").translation)])
    told = []
    solution = wb.solve(problem, wb.QP(measures=False), progress=lambda entry: told.append(entry) or True)
    assert len(told) == 1
    assert solution.solved


@pytest.mark.parametrize("measures", [False, True])
def test_an_end_that_the_assessment_refuses_is_searched_again(arm, monkeypatch, measures):
    """As if a distance had been missed: the descent answers with a posture that is inside of a ball."""
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    met = found(wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", goal)]))
    middle = np.array(State(arm.model).update(met.q).data.oMi[4].translation)
    scene = wb.Scene(arm).add(wb.Sphere(0.03), name="ball", at=middle)
    problem = wb.Problem(scene, START, goals=[wb.Point("tip", goal)])
    assert wb.assess(problem, met.q).penetration > 0.01
    monkeypatch.setattr("wholebody.methods.qp.method.unobstructed", lambda *_: met)
    solution = wb.QP(measures=measures).solve(problem)
    assert solution.solved, solution.message
    assert wb.assess(problem, solution.q).penetration < 1e-5
    assert solution.iterations > len(met.trace)
