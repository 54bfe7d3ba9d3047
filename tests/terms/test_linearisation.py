"""Everything a method is told at a posture, against finite differences of the values themselves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.reference.linearisation import ReferenceLineariser
from wholebody.figures.state import Wrench
from wholebody.tasks.base import Goal, Measure, filled
from wholebody.terms.linearisation import ConstraintValues
from wholebody.terms.plan import Terms, make_plan


class Squared(Goal):
    """A goal with a dense Jacobian: the square of one entry of the tangent place, to mix with wrenches."""

    def error(self, state):
        return np.array([state.q[10] ** 2])

    def jacobian(self, state):
        row = np.zeros((1, state.model.nv))
        row[0, 9] = 2.0 * state.q[10]
        return row


class Apart(Goal):
    """A goal with a wrench between two bodies: half the squared distance of two frames' origins."""

    def __init__(self, first, second):
        self.first, self.second, self.ids = first, second, None

    def resolve(self, scene, start):
        frames = [scene.figure.frame_id(name) for name in (self.first, self.second)]
        return filled(self, ids=frames)

    def error(self, state):
        way = state.frame(self.ids[0]).translation - state.frame(self.ids[1]).translation
        return np.array([0.5 * way @ way])

    def jacobian(self, state):
        place, other = (state.frame(frame).translation for frame in self.ids)
        joints = [int(state.model.frames[frame].parentJoint) for frame in self.ids]
        return Wrench([[*(place - other), *np.cross(place, place - other)]], *joints)


@pytest.fixture(scope="module")
def problem():
    scene = wb.Scene(wb.load("human"))
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.6, 0.0, 0.85))
    scene.add(wb.Sphere(0.2), name="ball", at=(0.1, 0.6, 1.2))
    scene.add(wb.HalfSpace(), name="floor")
    scene.attach(wb.Box((0.2, 0.1, 0.15)), to="right_hand", name="tool", at=(0.0, 0.0, -0.2))
    return wb.Problem(
        scene,
        goals=[
            wb.Point("right_index_tip", (0.5, -0.2, 1.0)),
            Squared(),
            Apart("right_index_tip", "left_palm"),
            wb.Frame("left_palm", (0.4, 0.3, 1.0, 0.0, 0.0, 0.0, 1.0)),
            wb.CenterOfMass((0.0, 0.0, 1.0)),
            wb.Relative("left_palm", "right_palm", (0.3, 0.0, 0.0)),
            wb.Posture("sitting"),
        ],
        constraints=[
            wb.Hold("left_foot"),
            wb.Balance(),
            wb.Plane("right_elbow", (0.0, 1.0, 0.2)),
            wb.Freeze("neck"),
            wb.tasks.StepLimit(2.0),
        ],
        measures=[wb.Effort(2.0), wb.tasks.Displacement(), wb.tasks.PotentialEnergy(0.01), wb.tasks.Discomfort(0.1)],
        clearance=0.004,
    )


def posture(problem, seed):
    rng = np.random.default_rng(seed)
    figure = problem.scene.figure
    q = figure.clamp(pin.integrate(figure.model, problem.start, 0.25 * rng.normal(size=figure.model.nv)))
    limits = figure.limits
    q[limits.idx_q] = np.clip(q[limits.idx_q], limits.lower + 0.02, limits.upper - 0.02)
    return q


def moved(problem, q, k, step):
    return pin.integrate(problem.scene.model, q, step * np.eye(problem.scene.model.nv)[k])


@pytest.mark.parametrize("seed", [0, 1])
def test_goals_constraints_and_measures(problem, seed):
    lineariser, q, step = problem.lineariser(problem.workspace()), posture(problem, seed), 1e-6
    at = lineariser.at(q, 0.1)
    assert at.goal_jacobian.shape == (len(at.goal_error), 55)
    assert at.value_jacobian.shape == (len(at.value), 55)
    assert (at.curvature >= 0.0).all()
    for k in range(problem.scene.model.nv):
        ahead, behind = (lineariser.at(moved(problem, q, k, side * step), 0.1) for side in (1, -1))
        slope = (ahead.goal_error - behind.goal_error) / (2 * step)
        assert at.goal_jacobian[:, k] == pytest.approx(slope, abs=2e-6)
        slope = (ahead.value - behind.value) / (2 * step)
        assert at.value_jacobian[:, k] == pytest.approx(slope, abs=2e-6)
        slope = (ahead.measure - behind.measure) / (2 * step)
        assert at.gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-5)


def test_wrenches_of_joints_that_there_are_not_and_of_other_shapes_are_refused(problem):
    tip = problem.scene.frame_id("right_index_tip")

    class Odd(Goal):
        wrench = Wrench(np.zeros((1, 6)), 1)

        def error(self, state):
            return state.frame(tip).translation[:1]

        def jacobian(self, state):
            return self.wrench

    odd = wb.Problem(problem.scene, goals=[goal := Odd()])
    lineariser = odd.lineariser(odd.workspace())
    lineariser.at(odd.start, 0.1)
    for wrong in (-1, problem.scene.model.njoints):
        goal.wrench = Wrench(np.zeros((1, 6)), wrong)
        with pytest.raises(wb.InputError, match="give indices from 0 to"):
            lineariser.at(odd.start, 0.1)
    goal.wrench = Wrench(np.zeros((1, 5)), 1)
    with pytest.raises(wb.InputError, match=r"have shape \(1, 5\)"):
        lineariser.at(odd.start, 0.1)


def test_values_of_some_constraints_are_their_own(problem):
    state = problem.workspace().state
    values = ConstraintValues(problem.constraints, state)
    for seed in range(5):
        state.update(posture(problem, seed))
        expected = [np.atleast_1d(constraint.value(state)) for constraint in problem.constraints]
        assert values.at(state) == pytest.approx(np.concatenate(expected), abs=1e-12)
    assert ConstraintValues([], state).at(state).shape == (0,)


def test_gaps_of_the_contacts(problem):
    """The first rows are the distances; pairs whose nearest places jump within the step are left out."""
    lineariser, step = problem.lineariser(problem.workspace()), 1e-5
    checked = 0
    for seed in (2, 3):
        q = posture(problem, seed)
        at = lineariser.at(q, 0.15)
        count = len(at.contacts.distance)
        assert np.array_equal(at.gap[:count], at.contacts.distance)
        assert np.array_equal(at.gap_contact[:count], np.arange(count))
        slopes = np.zeros((2, count, problem.scene.model.nv))
        for k in range(problem.scene.model.nv):
            for row, size in enumerate((step, 3 * step)):
                ends = [lineariser.at(moved(problem, q, k, side * size), 0.4).contacts for side in (1, -1)]
                tables = [dict(zip(end.number.tolist(), end.distance.tolist(), strict=True)) for end in ends]
                change = [tables[0][n] - tables[1][n] for n in at.contacts.number.tolist()]
                slopes[row, :, k] = np.array(change) / (2 * size)
        smooth = np.abs(slopes[0] - slopes[1]).max(axis=1) < 1e-3
        assert smooth.sum() > 0.5 * count
        assert at.gap_jacobian[:count][smooth] == pytest.approx(slopes[0][smooth], abs=2e-3)
        checked += smooth.sum()
    assert checked > 20


def test_pairs_are_those_near_enough_for_their_clearance(problem):
    at = problem.lineariser(problem.workspace()).at(problem.start, 0.1)
    expected = problem.scene.contacts(problem.start, 0.1 + problem.clearances.max())
    assert sorted(at.contacts.number) == sorted(expected.number)
    assert np.array_equal(at.clearance, problem.clearances[at.contacts.number][at.gap_contact])


def test_bounds_are_limits_frozen_joints_and_speed(problem):
    figure, q = problem.scene.figure, posture(problem, 4)
    lower, upper = figure.tangent_bounds(q)
    free = problem.lineariser(problem.workspace()).at(q, 0.1)
    frozen = figure.dofs(["neck"])
    others = np.setdiff1d(np.arange(6, 55), frozen)
    assert not free.lower[frozen].any()
    assert not free.upper[frozen].any()
    assert np.array_equal(free.lower[others], lower[others])
    assert np.array_equal(free.upper[others], upper[others])
    timed = problem.lineariser(problem.workspace(), 0.01).at(q, 0.1)
    share = 1.0 - np.exp(-0.01 / 0.05)  # joints brake before their limits
    assert np.allclose(timed.upper[others], np.minimum(share * upper[others], 0.02), atol=1e-15)
    assert np.allclose(timed.lower[others], np.maximum(share * lower[others], -0.02), atol=1e-15)
    assert not np.array_equal(timed.upper[others], np.minimum(upper[others], 0.02))


def test_a_problem_without_anything():
    scene = wb.Scene(wb.load("hand"))
    problem = wb.Problem(scene, measures=[])
    at = problem.lineariser(problem.workspace()).at(scene.figure.neutral, -1.0)
    assert at.goal_error.shape == at.value.shape == (0,)
    assert at.goal_jacobian.shape == at.value_jacobian.shape == (0, scene.model.nv)
    assert at.gap_jacobian.shape == (0, scene.model.nv)
    assert at.measure == 0.0


def test_what_was_told_is_not_overwritten_by_the_next_posture(problem):
    lineariser = problem.lineariser(problem.workspace())
    at = lineariser.at(problem.start, 0.1)
    copies = {name: np.array(getattr(at, name)) for name in ("q", "goal_error", "goal_jacobian", "gap", "gap_jacobian")}
    copies["distance"] = np.array(at.contacts.distance)
    lineariser.at(posture(problem, 5), 0.1)
    for name, copy in copies.items():
        assert np.array_equal(getattr(at.contacts if name == "distance" else at, name), copy)


def reference(problem, workspace, dt=None):
    return ReferenceLineariser(
        workspace, problem.scene.figure.limits,
        Terms(problem.goals, problem.constraints, problem.bounds, problem.measures), problem.clearances, dt,
    )  # fmt: skip


def assert_same(found, wanted):
    """Entry by entry; to rounding but for rotation vectors, which Pinocchio knows to 1e-8 near half a turn."""
    assert np.array_equal(found.contacts.number, wanted.contacts.number)
    assert np.array_equal(found.gap_contact, wanted.gap_contact)
    for name in ("q", "lower", "upper", "clearance"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    for name in ("goal_error", "value", "gap", "measure", "gradient", "curvature"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-10, atol=2e-8, err_msg=name)
    for name in ("goal_jacobian", "value_jacobian", "gap_jacobian"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-9, atol=2e-7, err_msg=name)


def random_term(rng, scene):
    """A goal or constraint of any class, about any frame of a person."""
    frames = ("right_index_tip", "left_palm", "head", "right_foot", "pelvis", "left_elbow")
    one, other = rng.choice(frames, 2, replace=False)
    place = tuple(rng.uniform(-1.0, 1.5, 3))
    turn = pin.Quaternion(pin.exp3(rng.choice([1e-9, 0.1, 2.0, 3.1]) * np.array(pin.SE3.Random().rotation[0]))).coeffs()
    axis = tuple(rng.normal(size=3))
    makers = (
        lambda: wb.Point(one, place, offset=tuple(rng.normal(size=3))),
        lambda: wb.Frame(one, (*place, *turn)),
        lambda: wb.Orientation(one, turn),
        lambda: wb.Axis(one, axis, direction=tuple(rng.normal(size=3))),
        lambda: wb.Axis(one, axis, toward=place),
        lambda: wb.Relative(one, other, (*place, *turn)),
        lambda: wb.Relative(one, other, place, orientation=False),
        lambda: wb.CenterOfMass(place, axes=str(rng.choice(["xy", "xyz"]))),
        lambda: wb.Posture("sitting", joints=["left_arm", "spine"]),
        lambda: wb.Posture("standing"),
        lambda: wb.Hold(one, orientation=bool(rng.integers(2))),
        lambda: wb.Hold(one, relative_to=other),
        lambda: wb.Plane(one, axis, side=str(rng.choice(["on", "above"]))),
        lambda: wb.Balance(),
        lambda: wb.tasks.ReachCones(),
    )
    return makers[int(rng.integers(len(makers)))]()


def test_the_compiled_pass_is_the_plain_one_entry_by_entry(problem):
    """Random terms at random postures: 15 problems, 3 postures each, with and without a time step."""
    rng, rows = np.random.default_rng(3), 0
    pin.seed(3)
    scene = problem.scene
    for number in range(15):
        terms = [random_term(rng, scene) for _ in range(int(rng.integers(1, 7)))]
        asked = wb.Problem(
            scene,
            goals=[term for term in terms if isinstance(term, Goal)],
            constraints=[term for term in terms if not isinstance(term, Goal)]
            + [wb.Freeze("neck"), wb.tasks.StepLimit(1.0, root_velocity=0.5)][: int(rng.integers(3))],
            measures=[
                wb.Effort(2.0),
                wb.tasks.Displacement(),
                wb.tasks.PotentialEnergy(0.01),
                wb.tasks.Discomfort(0.1),
            ][: number % 5],
            clearance=float(rng.choice([0.0, 0.01])),
        )
        dt = None if number % 2 else 0.02
        one, other = asked.workspace(), asked.workspace()
        lineariser, plain = asked.lineariser(one, dt), reference(asked, other, dt)
        for k in range(3):
            q = posture(asked, 20 * number + k)
            found = lineariser.at(q, 0.08)
            assert_same(found, plain.at(q, 0.08))
            rows += len(found.gap) + len(found.goal_error) + len(found.value)
    assert rows > 1200


def test_reach_cones_roots_and_heights_are_in_the_plan(problem):
    """No term of the package is evaluated by its own methods, and near the target of a root its series are exact."""
    goal = wb.Posture("sitting")
    asked = wb.Problem(
        problem.scene, goals=[goal], constraints=[wb.tasks.ReachCones()], measures=[wb.tasks.PotentialEnergy(0.01)]
    )
    workspace = asked.workspace()
    terms = Terms(asked.goals, asked.constraints, asked.bounds, asked.measures)
    plan = make_plan(problem.scene.figure.limits, terms, None, workspace.state)
    assert plan.others == () == plan.other_measures
    lineariser, plain = asked.lineariser(workspace), reference(asked, asked.workspace())
    rng, target = np.random.default_rng(4), problem.scene.figure.posture("sitting")
    for size in (0.0, 1e-9, 1e-5, 1.1e-4, 1e-2, 1.0, 2.5):
        way = rng.normal(size=55)
        q = pin.integrate(problem.scene.model, target, size * way / np.linalg.norm(way[3:6]))
        assert_same(lineariser.at(q, 0.0), plain.at(q, 0.0))


class Sway(Measure):
    """A measure of one's own that is the square of a sum of two angles."""

    weight = 3.0

    def value(self, state):
        return float((state.q[10] + state.q[11]) ** 2)

    def gradient(self, state):
        return 2.0 * (state.q[10] + state.q[11]) * self.row(state)

    def curvature(self, state):
        return 4.0 * self.row(state)

    def squares(self, state):
        return np.array([state.q[10] + state.q[11]]), self.row(state)[None]

    def row(self, state):
        row = np.zeros(state.model.nv)
        row[9:11] = 1.0
        return row


@pytest.mark.parametrize("measures", [[wb.tasks.Rhythm(2.0)], [wb.tasks.Rhythm(2.0), Sway()], [Sway()]])
def test_squares_are_the_second_derivative_where_they_vanish(problem, measures):
    """Where all angles are zero; beside the squares nothing is left of the curvature."""
    scene = problem.scene
    model, q = scene.model, pin.neutral(scene.model)
    asked = wb.Problem(scene, q, measures=measures)
    lineariser, step = asked.lineariser(asked.workspace()), 1e-4
    at = lineariser.at(q, 0.0)
    assert at.measure == pytest.approx(0.0, abs=1e-9)
    second = []
    for k in range(model.nv):
        ends = [lineariser.at(pin.integrate(model, q, side * step * np.eye(model.nv)[k]), 0.0) for side in (1, -1)]
        second.append((ends[0].gradient - ends[1].gradient) / (2.0 * step))
    np.testing.assert_allclose(at.squares.T @ at.squares, second, atol=2e-4 * np.abs(second).max())
    least = sum(term.weight for term in measures) * 1e-6
    np.testing.assert_allclose(at.curvature - at.squared, 0.0, atol=1.01 * least)


class OwnEffort(wb.tasks.RotationEffort):
    """The same measure as a class that the compiled pass does not know."""


class OwnHang(wb.tasks.Hang):
    """The same of arms that hang."""


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("kinds", [(wb.tasks.RotationEffort, OwnEffort), (wb.tasks.Hang, OwnHang)])
def test_ball_joints_and_arms_are_compiled_as_their_classes_say(problem, kinds, seed):
    scene, q = problem.scene, posture(problem, seed)
    made = [wb.Problem(scene, measures=[kind(weight=2.0), wb.tasks.Rhythm()]) for kind in kinds]
    known, own = (each.lineariser(each.workspace()).at(q, 0.0) for each in made)
    assert known.measure == pytest.approx(own.measure)
    np.testing.assert_allclose(known.gradient, own.gradient, atol=1e-9)
    np.testing.assert_allclose(known.curvature, own.curvature, rtol=1e-9)
    # The class has rows for all joints; compiled, the root and joints that count one by one stay on the diagonal.
    whole = [at.squares.T @ at.squares + np.diag(at.curvature - at.squared) for at in (known, own)]
    np.testing.assert_allclose(whole[0][6:, 6:], whole[1][6:, 6:], atol=1e-5)


def test_goals_that_move_keep_the_plan_and_other_goals_renew_it(problem):
    """Targets alone are written anew; another class, frame or number of goals is another plan."""
    q = posture(problem, 5)
    asked = wb.Problem(problem.scene, goals=[wb.Point("left_palm", (0.4, 0.2, 1.0)), Squared()])
    lineariser = asked.lineariser(asked.workspace())
    lineariser.at(q, 0.05)
    for goals in (
        [wb.Point("left_palm", (0.5, 0.2, 1.1)), Squared()],
        [wb.Point("right_palm", (0.5, 0.2, 1.1)), Squared()],
        [Squared(), wb.Point("right_palm", (0.5, 0.2, 1.1))],
        [wb.Frame("right_palm", (0.5, 0.2, 1.1))],
        [wb.CenterOfMass((0.1, 0.2, 0.9)), wb.Posture("sitting", joints=["left_arm"])],
    ):
        asked.retarget(goals)
        lineariser.take(asked.goals, asked.clearances)
        assert_same(lineariser.at(q, 0.05), reference(asked, asked.workspace()).at(q, 0.05))


def test_joints_that_follow_others_and_round_joints(tmp_path):
    """Mimic joints, continuous joints and a floating base of a robot: the compiled pass is the plain one."""
    robot = tmp_path / "robot.urdf"
    links = "".join(
        f'<link name="l{k}"><inertial><mass value="{k + 1}"/><origin xyz="0.1 0 0.2"/><inertia ixx="1" iyy="1" izz="1" '
        'ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><sphere radius="0.05"/></geometry></collision></link>'
        for k in range(5)
    )
    kinds = ("continuous", "revolute", "revolute", "prismatic")
    joints = "".join(
        f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0 0.1 0.3"/>'
        f'<axis xyz="{k % 2} 1 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/>'
        + ('<mimic joint="j1" multiplier="0.5" offset="0.1"/>' if k == 2 else "")
        + "</joint>"
        for k, kind in enumerate(kinds)
    )
    robot.write_text(f'<robot name="r">{links}{joints}</robot>')
    for root in ("fixed", "free"):
        figure = wb.load(robot, root=root)
        scene = wb.Scene(figure)
        scene.add(wb.Sphere(0.1), name="ball", at=(0.1, 0.3, 0.9))
        wanted = pin.integrate(figure.model, figure.neutral, 0.8 * np.ones(figure.model.nv))
        asked = wb.Problem(
            scene,
            goals=[wb.Frame("l4", (0.1, 0.2, 0.8)), wb.CenterOfMass((0.1, 0.0, 0.4)), wb.Posture(wanted)]
            + [Apart("l4", "l2")],
            measures=[wb.Effort(), wb.tasks.Displacement(), wb.tasks.Discomfort(), wb.tasks.PotentialEnergy(0.3)],
        )
        lineariser, plain = asked.lineariser(asked.workspace()), reference(asked, asked.workspace())
        rng = np.random.default_rng(1)
        for _ in range(50):
            q = figure.clamp(pin.integrate(figure.model, figure.neutral, rng.normal(size=figure.model.nv)))
            assert_same(lineariser.at(q, 0.5), plain.at(q, 0.5))


def test_a_relaxed_lineariser_leaves_the_one_it_was_made_of_as_it_was(problem) -> None:
    """Where speeds are bounded, pairs that cannot come near in a step are left out by clearances of its own."""
    lineariser = problem.lineariser(problem.workspace(), 0.02)
    before = lineariser.at(problem.start, 0.3).contacts.number
    assert len(lineariser.relaxed(0.1).at(problem.start, 0.3).contacts.number) < len(before)
    np.testing.assert_array_equal(lineariser.at(problem.start, 0.3).contacts.number, before)


def test_clearances_that_change_where_they_are_count_from_the_next_take(problem) -> None:
    lineariser, clearances = problem.lineariser(problem.workspace(), 0.02), problem.clearances.copy()
    before = lineariser.at(problem.start, 0.3).contacts.number
    lineariser.take(lineariser.goals, clearances)
    clearances += 0.05
    lineariser.take(lineariser.goals, clearances)
    assert len(lineariser.at(problem.start, 0.3).contacts.number) > len(before)


@pytest.mark.parametrize("more", [{}, {"offset": (0.0, 0.0, 0.1)}])
def test_goals_that_move_are_written_where_nobody_else_reads(problem, more):
    """A relaxed lineariser, and the problem's own plan, keep the goals that they were made with."""
    scene, places = problem.scene, ((0.4, -0.2, 1.0), (0.5, 0.1, 0.8))
    asked = ([wb.Frame("left_palm", at), wb.Point("right_palm", at, **more)] for at in places)
    first, second = (wb.Problem(scene, goals=goals) for goals in asked)
    moved = np.concatenate([np.subtract(*places), np.zeros(3), np.subtract(*places)])
    q = first.start
    lineariser = first.lineariser(first.workspace())
    relaxed, kept = lineariser.relaxed(0.01), lineariser.at(q, 0.0).goal_error
    lineariser.take(second.goals, first.clearances)
    assert np.allclose(lineariser.at(q, 0.0).goal_error, kept + moved)
    assert np.array_equal(relaxed.at(q, 0.0).goal_error, kept)
    assert np.array_equal(first.lineariser(first.workspace()).at(q, 0.0).goal_error, kept)


def test_terms_that_few_problems_have_are_told_and_need_their_loops_alone() -> None:
    figure = wb.load("human")
    point = wb.Point("right_palm", (0.4, -0.3, 1.2))
    gaze = wb.Axis("head", axis=(1.0, 0.0, 0.0), direction=(1.0, 0.0, 0.0))
    for goals, seldom in (([point], False), ([point, gaze], True)):
        problem = wb.Problem(wb.Scene(figure), goals=goals)
        with problem.borrow() as workspace:
            assert problem.lineariser(workspace).plan.seldom is seldom


def test_a_first_solve_of_a_person_needs_no_loops_of_seldom_terms_and_of_plans(root: Path) -> None:
    code = """
import sys
import wholebody as wb
problem = wb.Problem(wb.Scene(wb.load("human")), goals=[wb.Point("right_palm", (0.4, -0.3, 1.2))])
assert wb.solve(problem).solved
print([name for name in sys.modules if name.endswith(("terms.seldom_kernel", "continuous.kept_apart"))])
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]"]
