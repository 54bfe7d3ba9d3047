"""What stands in the way, on postures where it is known by construction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

import wholebody as wb
from wholebody.assessment.first_order import nonnegative_least_squares
from wholebody.view.composition import Composition

LENGTHS = (0.5, 0.4)


class Ceiling(wb.Constraint):
    """The first body stays below a height."""

    lower, upper = np.array([-np.inf]), np.array([0.3])

    def value(self, state):
        return state.q[2:3]

    def jacobian(self, state):
        return np.eye(1, state.model.nv, 2)


def named(problem, q):
    return {str(blocker): blocker for blocker in wb.assess(problem, q).blockers}


def test_nothing_is_in_the_way_of_what_fits(planar_arm):
    problem = wb.Problem(wb.Scene(planar_arm(LENGTHS)), goals=[wb.Point("tip", (0.9, 0.0, 0.0))])
    assert wb.assess(problem, np.zeros(2)).blockers == ()
    assert wb.assess(problem, np.zeros(2)).in_the_way == ""


def test_a_joint_at_its_limit_is_named_and_one_away_from_it_is_not(planar_arm):
    scene = wb.Scene(planar_arm(LENGTHS, limit=1.0))
    problem = wb.Problem(scene, goals=[wb.Point("tip", (0.5 * np.cos(1.4), 0.9 * np.sin(1.4), 0.0))])
    found = named(problem, np.array([1.0, 0.2]))
    assert set(found) == {"the limit of turn0"}
    assert found["the limit of turn0"].share == 1.0
    assert not found["the limit of turn0"].violated


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["upper", "lower"])
def test_a_limit_is_named_where_a_joint_is_exactly_at_it_or_nearly(planar_arm, sign):
    scene = wb.Scene(planar_arm(LENGTHS, limit=1.0))
    goal = wb.Point("tip", (0.5 * np.cos(1.4), sign * 0.9 * np.sin(1.4), 0.0))
    problem = wb.Problem(scene, goals=[goal])
    for off in (0.0, 5e-5):  # nearer than what counts as active
        assert set(named(problem, sign * np.array([1.0 - off, 0.2]))) == {"the limit of turn0"}
    assert named(problem, sign * np.array([0.9, 0.2])) == {}


def test_a_constraint_with_an_upper_bound_alone_pushes_down(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1)))
    q = scene.figure.neutral
    q[2] = 0.3
    for height, balanced in ((1.0, True), (-1.0, False)):
        problem = wb.Problem(scene, goals=[wb.Point("body0", (0.0, 0.0, height))], constraints=[Ceiling()])
        assert set(named(problem, q)) == ({"constraints[0], Ceiling"} if balanced else set())
        assert (wb.assess(problem, q).optimality < 1e-9) == balanced


def test_a_frozen_joint_is_told_from_one_at_its_limit(planar_arm):
    scene = wb.Scene(planar_arm(LENGTHS))
    problem = wb.Problem(scene, goals=[wb.Point("tip", (0.0, 0.9, 0.0))], constraints=[wb.Freeze("turn0")])
    assert set(named(problem, problem.start)) >= {"the bound on turn0"}


def test_a_wall_between_a_ball_and_its_goal(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Box((0.1, 2.0, 2.0)), name="wall", at=(0.5, 0.0, 0.0))
    scene.add(wb.Sphere(0.2), name="bystander", at=(0.0, 2.0, 0.0))
    problem = wb.Problem(scene, goals=[wb.Point("body0", (1.0, 0.0, 0.0))])
    q = scene.figure.neutral
    q[0] = 0.35
    assert set(named(problem, q)) == {"body0 against wall"}
    q[0] = 0.38  # 3 cm inside: now it is violated
    found = named(problem, q)
    assert next(iter(found)) == "body0 against wall"
    assert found["body0 against wall"].violated


def test_two_walls_share_by_how_hard_they_push(free_bodies):
    """A ball in a corner, pulled three times as far along x as along y: the forces are as three to one."""
    scene = wb.Scene(free_bodies(wb.Sphere(0.1)))
    scene.add(wb.Box((0.1, 4.0, 4.0)), name="in x", at=(0.15, 0.0, 0.0))
    scene.add(wb.Box((4.0, 0.1, 4.0)), name="in y", at=(0.0, 0.15, 0.0))
    problem = wb.Problem(scene, goals=[wb.Point("body0", (3.0, 1.0, 0.0))])
    found = named(problem, scene.figure.neutral)
    assert list(found) == ["body0 against in x", "body0 against in y"]  # the strongest first
    assert found["body0 against in y"].share == pytest.approx(1.0 / 3.0, rel=1e-3)


def test_a_hold_that_the_goal_pulls_against_is_named_with_its_frame(planar_arm):
    scene = wb.Scene(planar_arm(LENGTHS))
    hold = wb.Hold("tip", at=(0.9, 0.0, 0.0), orientation=False)
    problem = wb.Problem(scene, goals=[wb.Point("link1", (0.3, 0.3, 0.0))], constraints=[hold])
    assert "constraints[0], Hold('tip')" in named(problem, np.zeros(2))


@pytest.mark.parametrize("kind", ["any", "in few dimensions", "repeated and opposite", "along axes"])
def test_nonnegative_least_squares_are_those_of_scipy(kind):
    rng = np.random.default_rng(0)
    for _ in range(40):
        m, n = rng.integers(1, 40, size=2)
        rows, right = rng.normal(size=(m, n)), rng.normal(size=n)
        if kind == "in few dimensions":
            rows = rng.normal(size=(m, 3)) @ rng.normal(size=(3, n))
        elif kind == "repeated and opposite":
            rows = np.vstack([rows, rows, -3.0 * rows[m // 2 :], np.zeros((2, n))])
        elif kind == "along axes":
            rows = np.eye(n)[rng.integers(0, n, size=m)] * rng.choice([-1.0, 1.0], size=(m, 1))
        share, left = nonnegative_least_squares(rows, right, np.linalg.norm(rows, axis=1))
        reference, _ = nnls(rows.T, right)
        assert (share >= 0.0).all()
        np.testing.assert_allclose(left, right - share @ rows, atol=1e-11)
        np.testing.assert_allclose(left, right - reference @ rows, atol=1e-8)  # what is left is unique, shares are not


@pytest.mark.parametrize(
    ("rows", "right"),
    [
        ([(1, 0, 1), (2, -2, 2), (2, -2, -2), (2, 2, -1), (-2, -2, -1)], (60, -20, 20)),
        ([(1, 2, -2), (1, -1, -2), (0, -2, 1), (-2, -2, -1), (1, 0, -1)], (18, -18, -12)),
        ([(-1, -1, 1), (0, -2, 2), (2, -1, 0), (-2, 1, -1), (0, 0, -1)], (0, -60, 40)),
    ],
)
def test_a_share_that_is_nothing_and_stays_nothing_leaves(rows, right):
    rows = np.array(rows, dtype=float)
    smallest = np.nextafter(0.0, 1.0)  # of such numbers shares are rounded to 0 while their rows still push
    share, left = nonnegative_least_squares(rows, smallest * np.array(right), np.linalg.norm(rows, axis=1))
    assert np.isfinite(share).all()
    assert (share >= 0.0).all()
    assert np.isfinite(left).all()


def test_an_answer_says_it_in_words_and_in_the_picture(planar_arm):
    scene = wb.Scene(planar_arm(LENGTHS)).add(wb.Box((0.2, 0.2, 0.2)), name="block", at=(0.5, 0.5, 0.0))
    problem = wb.Problem(scene, goals=[wb.Point("tip", (0.5, 0.5, 0.0))])
    solution = wb.solve(problem)
    assert solution.status == "unreachable"
    assert "in the way: " in solution.message
    with wb.Viewer(scene) as viewer:
        viewer.show(solution.q, problem=problem)
        composition: Composition = viewer._composition
        moment = composition.keyframe(solution.q, problem, wb.assess(problem, solution.q).blockers)
    labels = [marker.text for marker, _ in moment.markers.values() if marker.text]
    assert any(text.startswith("in the way: link1 against block") for text in labels)


def test_stretched_limbs_are_said_to_be_too_short(planar_arm):
    problem = wb.Problem(wb.Scene(planar_arm(LENGTHS)), goals=[wb.Point("tip", (1.5, 0.0, 0.0))])
    assert wb.assess(problem, np.zeros(2)).in_the_way.endswith("the limbs do not reach")


def test_constraints_are_called_as_they_were_given():
    scene = wb.Scene(wb.load("human", detail="capsules"))
    figure = scene.figure
    bent = figure.with_joints(figure.neutral, {name: 1.0 for name in figure.joints if name.startswith("neck")})
    frozen = wb.Freeze(*(name for name in figure.joints if name.startswith("neck")))
    problem = wb.Problem(scene, figure.clamp(bent), constraints=[frozen, wb.Hold("left_foot")])
    assert problem.constraint_names == (
        "constraints[1], Hold('left_foot')", "RangeOfMotion (by default)", "ReachCones (by default)",
    )  # fmt: skip
    solution = wb.solve(problem)
    assert solution.status == "infeasible"
    assert "RangeOfMotion (by default), 'neck' is violated by" in solution.message
    assert "constraints[0]" not in solution.message
    problem.constraints = problem.constraints[:1]
    assert problem.constraint_names == ("constraints[1], Hold('left_foot')",)


def test_how_much_nearer_goals_may_come_is_known_of_a_rod(planar_arm):
    """The end of a rod of 1 m along x moves along y: of an error (1, -1) it leaves one part."""
    problem = wb.Problem(wb.Scene(planar_arm((1.0,))), goals=[wb.Point("tip", (0.0, 1.0, 0.0))])
    assert wb.assess(problem, np.zeros(1)).first_order.nearer == pytest.approx(np.sqrt(0.5))
    beyond = wb.Problem(problem.scene, goals=[wb.Point("tip", (3.0, 0.0, 0.0))])
    assert wb.assess(beyond, np.zeros(1)).first_order.nearer == 1.0
    stopped = wb.Scene(planar_arm((1.0,), limit=0.5))
    ahead = wb.Problem(stopped, goals=[wb.Point("tip", (0.0, 1.0, 0.0))])
    assert wb.assess(ahead, np.array([0.5])).first_order.nearer == 1.0
    assert wb.assess(ahead, np.array([0.4995])).nearest  # 0.5 mm before the limit, where 1021 mm are left
    assert not wb.assess(ahead, np.array([0.45])).nearest  # the limit is 4.5 % nearer
    assert wb.assess(wb.Problem(stopped), np.zeros(1)).nearest
