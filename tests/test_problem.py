"""Stating a problem: what is refused, and which distance is asked of which pair."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.robots import known_arm


@pytest.fixture
def scene():
    return wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")


GOAL = wb.Point("right_index_tip", (0.5, -0.2, 1.0))


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"start": np.zeros(55)}, wb.InputError, r"start has shape \(55,\); give \(56,\)"),
        ({"start": np.full(56, np.nan)}, wb.InputError, "start entry 0 is not finite"),
        ({"start": np.ones(56)}, wb.InputError, "quaternion is not of unit length"),
        ({"start": "stading"}, wb.UnknownNameError, "did you mean standing"),
        ({"goals": [GOAL, wb.Hold("left_foot")]}, wb.InputError, r"goals\[1\] is a Hold, not a Goal"),
        (
            {"goals": [wb.Point("rigth_index_tip", (0, 0, 0))]},
            wb.UnknownNameError,
            "did you mean right_index_tip",
        ),
        ({"constraints": [GOAL]}, wb.InputError, r"constraints\[0\] is a Point, not a Constraint or Bound"),
        ({"clearance": -0.001}, wb.InputError, "clearance is -0.001; give a number between 0 and 0.5 m"),
        ({"clearance": np.nan}, wb.InputError, "clearance is nan;"),
        ({"touching": [("right_hand",)]}, wb.InputError, "touching takes a list of pairs of names"),
        ({"touching": [("right_hand", "flor")]}, wb.UnknownNameError, "did you mean floor"),
    ],
)
def test_mistakes_are_answered_with_a_sentence(scene, given, error, sentence):
    with pytest.raises(error, match=sentence):
        wb.Problem(scene, **given)


def test_start_is_the_first_posture_a_name_or_a_copy(scene):
    figure = scene.figure
    assert np.array_equal(wb.Problem(scene).start, figure.posture("standing"))
    assert np.array_equal(wb.Problem(scene, "sitting").start, figure.posture("sitting"))
    q = figure.posture("t_pose")
    problem = wb.Problem(scene, q)
    q[:] = np.nan
    assert np.isfinite(problem.start).all()


def test_nearly_unit_quaternions_are_made_unit(scene):
    q = scene.figure.posture("standing")
    q[3:7] *= 1.0 + 5e-4
    assert np.linalg.norm(wb.Problem(scene, q).start[3:7]) == pytest.approx(1.0, abs=1e-12)


def test_effort_is_minimised_unless_something_else_is_said(scene):
    assert [type(term) for term in wb.Problem(scene).measures] == [wb.Effort, wb.tasks.Rhythm]
    assert wb.Problem(scene, measures=[]).measures == ()


def test_bounds_and_constraints_are_told_apart(scene):
    problem = wb.Problem(scene, constraints=[wb.Freeze("neck"), wb.Hold("left_foot"), wb.tasks.StepLimit(1.0)])
    assert [type(term) for term in problem.bounds] == [wb.Freeze, wb.tasks.StepLimit]
    assert [type(term) for term in problem.constraints] == [wb.Hold, wb.tasks.RangeOfMotion, wb.tasks.ReachCones]
    assert [type(term) for term in problem.stated] == [wb.Hold]


def test_pairs_keep_what_they_begin_with_and_leave_what_they_are_in(free_bodies):
    """A ball 3 mm over the floor, one on it, one in it, one far away; 5 mm are asked."""
    scene = wb.Scene(free_bodies(*[wb.Sphere(0.1)] * 4)).add(wb.HalfSpace(), name="floor")
    q = scene.figure.neutral
    for k, height in enumerate((0.103, 0.1, 0.09, 0.5)):
        q[7 * k : 7 * k + 3] = k, 0.0, height
    problem = wb.Problem(scene, q, clearance=0.005)
    asked = {}
    for (a, b), clearance in zip(scene.pair_table.pairs, problem.clearances, strict=True):
        asked[scene.piece_owner[a], scene.piece_owner[b]] = clearance
    on_floor = [asked[f"body{k}", "floor"] for k in range(4)]
    assert on_floor == pytest.approx([0.003, 0.0, 0.005, 0.005], abs=2e-6)
    assert {value for pair, value in asked.items() if "floor" not in pair} == {0.005}


def test_named_pairs_may_touch_in_either_order(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Sphere(0.1)))
    scene.add(wb.Box((1.0, 1.0, 0.1)), name="table", at=(0.0, 0.0, -0.5))
    q = scene.figure.neutral
    q[7] = 1.0
    for pair in (("body0", "table"), ("table", "body0")):
        problem = wb.Problem(scene, q, clearance=0.005, touching=[pair])
        owners = [{scene.piece_owner[i] for i in pair} for pair in scene.pair_table.pairs]
        expected = [0.0 if names == {"body0", "table"} else 0.005 for names in owners]
        assert problem.clearances.tolist() == expected


def test_goals_are_replaced_and_the_rest_stays(scene):
    problem = wb.Problem(scene, goals=[GOAL], constraints=[wb.Hold("left_foot")], clearance=0.003)
    constraints, clearances = problem.constraints, problem.clearances
    problem.retarget([wb.Point("left_index_tip", (0.5, 0.2, 1.0)), GOAL])
    assert len(problem.goals) == 2
    assert problem.constraints is constraints
    assert problem.clearances is clearances
    with pytest.raises(wb.UnknownNameError):
        problem.retarget([wb.Point("left_index", (0.5, 0.2, 1.0))])
    assert len(problem.goals) == 2
    with pytest.raises(wb.InputError):
        problem.retarget(GOAL)


def _told(problem):
    return repr(problem), [tuple(one.arms) for one in problem.measures if isinstance(one, wb.tasks.Hang)]


@pytest.mark.parametrize(
    "goals",
    [
        [wb.Point("left_index_tip", (0.5, 0.2, 1.0))],
        [GOAL, wb.Frame("left_palm", (0.4, 0.2, 1.0))],
        [],
        [wb.Touch("left_index_tip", "table")],
        [wb.Sit("stool")],
    ],
)
def test_defaults_follow_the_goals(scene, goals):
    """A problem that takes other goals has what one has that is stated with them: arms that hang, balance, contacts."""
    scene.add(wb.Box((0.5, 1.0, 0.04)), name="table", at=(0.6, 0.0, 0.8))
    scene.add(wb.Box((0.4, 0.4, 0.42)), name="stool", at=(-0.3, 0.0, 0.21))
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    moved, anew = (wb.Problem(scene, goals=one, constraints=feet, clearance=0.004) for one in ([GOAL], goals))
    changed = 7
    moved.clearances[changed] = 0.011
    before = _told(moved), moved.clearances.copy()
    moved.retarget(goals)
    assert _told(moved) == _told(anew)
    assert np.array_equal(np.delete(moved.clearances, changed), np.delete(anew.clearances, changed))
    moved.retarget([GOAL])
    assert (_told(moved), moved.clearances.tolist()) == (before[0], before[1].tolist())


def test_other_goals_leave_what_was_stated_or_set(scene):
    goals = [wb.Point("left_index_tip", (0.5, 0.2, 1.0))]
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    stated = wb.Problem(scene, goals=[GOAL], constraints=feet, measures=[wb.Effort()])
    usual = wb.Problem(scene, goals=[GOAL], constraints=feet)
    usual.measures, usual.constraints = usual.measures[:1], usual.constraints[:1]
    for problem in (stated, usual):
        measures, constraints = problem.measures, problem.constraints
        problem.retarget(goals)
        assert problem.measures is measures
        assert problem.constraints is constraints
    usual.constraints = again = wb.Problem(scene, goals=[GOAL], constraints=feet).defaults
    usual.retarget([GOAL, *goals])
    assert usual.constraints == again


def test_clearances_follow_goals_that_were_set(scene):
    """Defaults are of the goals that the problem was stated or retargeted with, whatever was set between."""
    scene.add(wb.Box((0.5, 1.0, 0.04)), name="table", at=(0.6, 0.0, 0.8))
    touch = [wb.Touch("right_palm", "table")]
    problem, stated = (wb.Problem(scene, goals=one, clearance=0.004) for one in ([GOAL], touch))
    problem.goals = stated.goals
    problem.retarget(touch)
    assert problem.clearances.tolist() == stated.clearances.tolist()


@pytest.mark.parametrize("clearance", [0.0, 0.002, 0.01])
def test_what_is_nearer_at_the_start_keeps_its_distance(clearance):
    figure, start = known_arm("ur5")
    beside = figure.placement(start, "tool").act(np.array([0.0, 0.055, 0.0]))  # 5 mm beyond the end of the last link
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=beside)
    contacts = scene.contacts(start, within=10.0)
    asked = wb.Problem(scene, start, clearance=clearance).clearances[contacts.number]
    assert asked[0] == pytest.approx(min(clearance, 0.005), abs=1e-6)
    assert (asked[1:] == clearance).all()


def test_a_problem_is_tied_to_the_things_it_was_stated_with(scene):
    problem = wb.Problem(scene, goals=[GOAL])
    scene.add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 1.0))
    moved = partial(problem.retarget, [wb.Touch("right_palm", "floor")])
    for ask in (
        problem.check_fresh,
        problem.check_scene,
        problem.workspace,
        lambda: wb.assess(problem, problem.start),
        moved,
    ):
        with pytest.raises(wb.InputError, match="state the problem anew"):
            ask()
    again = wb.Problem(scene, goals=[GOAL])
    scene.move("ball", at=(1.0, 1.0, 1.0))
    again.check_fresh()


def test_terms_are_not_changed_by_being_used(scene):
    hold = wb.Hold("left_foot")
    one, two = wb.Problem(scene, constraints=[hold]), wb.Problem(scene, "sitting", constraints=[hold])
    assert one.constraints[0] is not hold
    assert wb.assess(one, one.start).constraint_violation == 0.0
    assert wb.assess(two, two.start).constraint_violation < 1e-12
    assert wb.assess(one, two.start).constraint_violation > 0.01


class _Broken(wb.Goal):
    """A user's goal whose Jacobian has another shape, or whose error is not a number."""

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def error(self, state):
        return np.full(2, np.nan if self.kind == "nan" else 1.0)

    def jacobian(self, state):
        return np.zeros((3 if self.kind == "shape" else 2, state.model.nv))


@pytest.mark.parametrize(("kind", "said"), [("nan", "not finite"), ("shape", "give shape")])
def test_new_goals_are_checked_as_the_first_ones_and_refused_whole(scene, kind, said):
    with pytest.raises(wb.InputError, match=rf"goals\[1\] \(_Broken\): .*{said}"):
        wb.Problem(scene, goals=[GOAL, _Broken(kind)])
    problem = wb.Problem(scene, goals=[GOAL])
    before = problem.goals
    with pytest.raises(wb.InputError, match=rf"goals\[1\] \(_Broken\): .*{said}"):
        problem.retarget([wb.Posture("standing"), _Broken(kind)])
    assert problem.goals is before


def test_built_in_goals_refuse_by_themselves_what_evaluation_would_find(scene):
    for make in (
        lambda: wb.Point("head", (np.nan, 0.0, 0.0)), lambda: wb.Frame("head", (0, 0, np.inf)),
        lambda: wb.CenterOfMass((0, np.nan, 0)), lambda: wb.Axis("head", (1, 0, 0), direction=(np.nan, 0, 0)),
        lambda: wb.Orientation("head", (0, 0, np.nan, 1)), lambda: wb.Relative("head", "pelvis", (0, np.nan, 0)),
        lambda: wb.Posture(np.full(scene.model.nq, np.nan)),
    ):  # fmt: skip
        problem = wb.Problem(scene, goals=[GOAL])
        with pytest.raises(wb.InputError):
            problem.retarget([make()])


@pytest.mark.parametrize("value", [np.nan, -0.01, np.inf, 600.0])
def test_clearances_that_none_can_keep_are_refused_by_every_run(value: float) -> None:
    """They may be changed between runs; a value that is no number would be kept by no pair, silently."""
    scene = wb.Scene(wb.load("hand"))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.0, 0.0, 0.1))])
    problem.clearances[3] = value
    for run in (
        wb.solve,
        lambda asked: wb.assess(asked, asked.start),
        lambda asked: wb.methods.QP().tracker(asked, 0.01),
    ):
        with pytest.raises(wb.InputError, match=r"clearances\[3\] is"):
            run(problem)


@pytest.mark.parametrize(
    "method",
    [wb.methods.QP(), wb.methods.Newton(), wb.methods.CCD(), wb.methods.DampedLeastSquares()],
    ids=lambda one: one.name,
)
@pytest.mark.parametrize("shape", [(3,), (1,), (0, 1)], ids=str)
def test_clearances_of_another_shape_are_refused_by_every_method(method, shape):
    scene = wb.Scene(wb.load("hand"))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.0, 0.0, 0.1))])
    problem.clearances = np.zeros(shape)
    with pytest.raises(wb.InputError, match=r"clearances have shape .*; give one for each of the \d+ pairs"):
        method.solve(problem)
    with pytest.raises(wb.InputError, match="clearances have shape"):
        wb.assess(problem, problem.start)


@pytest.mark.parametrize("stated", [(), (wb.Balance(),)], ids=["default", "stated"])
def test_balance_follows_what_the_feet_carry(stated):
    """Shoes that are moved between two problems move the support polygon, as in a scene that never saw them before."""
    soles = [wb.Hold(f"{side}_sole") for side in ("left", "right")]

    def polygon(scene):
        constraints = wb.Problem(scene, constraints=[*soles, *stated]).constraints
        return next(term for term in constraints if isinstance(term, wb.Balance))

    def shod(at):
        scene = wb.Scene(wb.load("human"))
        scene.attach(wb.Box((0.5, 0.1, 0.02)), to="left_foot", name="ski", at=at)
        return scene

    here, there = (0.0, 0.0, -0.08), (0.2, 0.0, -0.08)
    scene, fresh = shod(here), polygon(shod(there))
    first = polygon(scene)
    scene.move("ski", at=there)
    again = polygon(scene)
    assert np.abs(first.offsets.sum() - again.offsets.sum()) > 1e-3 or first.normals.shape != again.normals.shape
    np.testing.assert_array_equal(again.normals, fresh.normals)
    np.testing.assert_array_equal(again.offsets, fresh.offsets)


def test_a_start_that_was_stated_before_sees_where_things_are_now() -> None:
    """What follows from a start is kept; a thing that was moved in between counts where it stands."""
    figure, start = known_arm("ur5")
    tool = figure.placement(start, "tool").translation
    scene = wb.Scene(figure).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=(2.0, 0.0, 0.0))
    away = wb.Problem(scene, start, clearance=0.02)
    for height in np.arange(0.3, 0.0, -0.002):  # from below until it is nearer than the clearance
        scene.move("box", at=tool - (0.0, 0.0, height))
        if scene.contacts(start, 0.5).distance.min() < 0.015:
            break
    assert 0.0 < scene.contacts(start, 0.5).distance.min() < 0.015
    assert (wb.Problem(scene, start, clearance=0.02).clearances < away.clearances).any()


def test_constraints_that_were_stated_before_at_this_start_are_those_of_their_own_words() -> None:
    """What follows from a start is kept for the same constraints alone: not for other words, nor for another start."""
    scene = wb.Scene(wb.load("hand"))
    starts = [scene.figure.neutral, pin.integrate(scene.model, scene.figure.neutral, np.full(scene.model.nv, 0.1))]
    for q in (starts[0], starts[1], starts[0]):
        for frame, turned in (("right_index_tip", True), ("right_thumb_tip", True), ("right_index_tip", False)):
            for _ in range(2):
                (held,) = wb.Problem(scene, q, constraints=[wb.Hold(frame, orientation=turned)]).stated
                assert np.abs(held.value(scene.state(q))).max() < 1e-12
                assert len(held.value(scene.state(q))) == 3 + 3 * turned
                assert held.frame == frame


def test_defaults_do_not_depend_on_what_was_stated_before(scene):
    """Problems that differ in one thing alone, one after the other in one scene, and each in a scene of its own."""
    feet, reach = [wb.Hold("left_foot"), wb.Hold("right_foot")], [GOAL]
    lifted = scene.figure.posture("standing")
    lifted[2] += 0.3
    asked = [
        {"goals": reach, "constraints": feet},
        {"goals": [], "constraints": feet},
        {"goals": [*reach, wb.Point("left_index_tip", (0.5, 0.2, 1.0))], "constraints": feet},
        {"goals": [wb.Relative("left_palm", "right_palm")], "constraints": feet},
        {"goals": reach, "constraints": feet[:1]},
        {"goals": reach, "constraints": [feet[0], wb.Hold("right_foot", at=(0.3, -0.1, 0.08))]},
        {"goals": reach, "constraints": [*feet, wb.Freeze("root")]},
        {"goals": reach, "constraints": [wb.Stand("floor")]},
        {"goals": reach, "constraints": [wb.Stand("floor"), wb.tasks.RangeOfMotion()]},
        {"goals": reach, "constraints": feet, "start": lifted},
        {"goals": reach, "constraints": feet, "start": "sitting"},
        {"goals": reach, "constraints": feet, "balance": False},
        {"goals": reach, "constraints": feet[:1], "balance": True},
        {"goals": reach, "constraints": feet, "range_of_motion": False},
        {"goals": reach, "constraints": feet, "measures": []},
        {"goals": reach},
        {"goals": reach, "start": "sitting"},
    ]
    other = scene.state(scene.figure.posture("t_pose"))

    def told(scene, given):
        problem = wb.Problem(scene, **given)
        rows = [np.atleast_1d(one.value(other)).tolist() for one in (*problem.defaults, *problem.measures)]
        return *_told(problem), problem.left_out, rows

    alone = [told(wb.Scene(scene.figure).add(wb.HalfSpace(), name="floor"), given) for given in asked]
    assert [told(scene, given) for given in asked + asked[::-1]] == alone + alone[::-1]
    assert len({repr(one) for one in alone}) > 8
