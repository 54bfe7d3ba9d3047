"""Trackers whose problem is changed between steps, and compiled loops that are given the wrong sizes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.arrays import with_values
from wholebody.methods.qp import tracking
from wholebody.methods.qp.active_set import solve_from, violated_set
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.methods.qp.step_program import StepProgram
from wholebody.tasks.base import Goal

SLOW = wb.tasks.StepLimit(0.2, root_velocity=0.1, root_turn=0.1)  # steps so short that none is cut
FEET = (wb.Hold("left_foot"), wb.Hold("right_foot"), SLOW)


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")


def fresh(problem: wb.Problem, q: np.ndarray) -> np.ndarray:
    """What a tracker does that never knew other goals."""
    step = wb.methods.QP().tracker(problem, 0.02).step(q)
    assert step.share == 1.0
    return step.displacement


CHANGES = {
    "rows": ([wb.CenterOfMass((0.05, 0.0, 1.0), axes="xy")], [wb.CenterOfMass((0.05, 0.0, 1.0), axes="xyz")]),
    "joints": ([wb.Posture("arms_forward", joints=["neck"])], [wb.Posture("arms_forward")]),
    "fewer rows": ([wb.Posture("arms_forward")], [wb.Posture("arms_forward", joints=["neck"])]),
    "weight": ([wb.Point("head", (0.1, 0, 1.5))], [wb.Point("head", (0.1, 0, 1.5), weight=100.0)]),
    "order": (
        [wb.Point("head", (0.1, 0.0, 1.5)), wb.CenterOfMass((0.05, 0.0, 1.0), axes="xy")],
        [wb.CenterOfMass((0.05, 0.0, 1.0), axes="xy"), wb.Point("head", (0.1, 0.0, 1.5))],
    ),
}  # fmt: skip


def test_a_later_posture_is_checked_as_the_first(scene: wb.Scene) -> None:
    tracker = wb.methods.QP().tracker(wb.Problem(scene), 0.02)
    q = tracker.step(scene.figure.neutral).q
    assert np.isfinite(tracker.step(q.tolist()).q).all()
    for bad in (np.full_like(q, np.nan), q[:5], "x", q.astype(complex)):
        with pytest.raises(wb.InputError, match="posture"):
            tracker.step(bad)


@pytest.mark.parametrize("change", CHANGES)
def test_other_goals_are_followed_as_by_a_new_tracker(scene: wb.Scene, change: str) -> None:
    """Without this the weights of the old goals stayed: a held foot moved by centimetres, or the step broke off."""
    first, second = CHANGES[change]
    problem = wb.Problem(scene, goals=first, constraints=FEET)
    tracker, q = wb.methods.QP().tracker(problem, 0.02), problem.start
    for goals in (first, second, first, second):
        problem.retarget(goals)
        step = tracker.step(q)
        assert step.displacement == pytest.approx(fresh(problem, q), abs=1e-6)
    assert len(problem.stated) == 2
    for foot in problem.stated:
        assert np.abs(foot.value(scene.state(step.q))).max() < 1e-3


def test_other_terms_are_followed_as_by_a_new_tracker(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.3, -0.3, 1.0))], constraints=FEET)
    other = wb.Problem(scene, goals=problem.goals, constraints=[FEET[0], SLOW], measures=[wb.tasks.Displacement()])
    tracker, q = wb.methods.QP().tracker(problem, 0.02), problem.start
    tracker.step(q)
    problem.constraints, problem.measures = other.constraints, other.measures
    assert tracker.step(q).displacement == pytest.approx(fresh(problem, q), abs=1e-7)
    problem.clearances += 0.02
    assert tracker.step(q).displacement == pytest.approx(fresh(problem, q), abs=1e-7)
    problem.clearances[:] = 0.05  # its entries alone
    assert tracker.step(q).displacement == pytest.approx(fresh(problem, q), abs=1e-7)
    problem.clearances = problem.clearances[:-1]
    with pytest.raises(wb.InputError, match="one for each of the"):
        tracker.step(q)


def test_holds_that_moved_are_followed_as_by_a_new_tracker_and_nothing_is_set_up_anew(
    scene: wb.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    goals = [wb.Point("right_index_tip", (0.3, -0.3, 1.0))]
    problem, made = wb.Problem(scene, goals=goals, constraints=FEET), list[object]()
    tracker, q, first = wb.methods.QP().tracker(problem, 0.02), problem.start, problem.constraints
    at = np.array(scene.state(q).frame(scene.figure.frame_id("left_foot")).translation)
    turned = scene.state(q).frame(scene.figure.frame_id("left_foot")).rotation
    monkeypatch.setattr(tracking, "StepProgram", lambda *given: made.append(given) or StepProgram(*given))
    for number, left in enumerate((0.0, 0.001, 0.002, 0.002, 0.0), 1):
        moved = wb.Hold("left_foot", pin.SE3(turned, at + [0.0, left, 0.0])).resolve(scene, problem.start)
        problem.constraints = (moved, *first[1:])
        step = tracker.step(q)
        assert step.displacement == pytest.approx(fresh(problem, q), abs=1e-6)
        assert len(made) == number  # of the new trackers
        q = step.q
        assert np.abs(moved.value(scene.state(q))).max() < 1e-4
    problem.constraints = (*first, wb.Hold("left_palm", orientation=False).resolve(scene, q))
    assert tracker.step(q).displacement == pytest.approx(fresh(problem, q), abs=1e-6)
    assert len(made) == number + 2


class _Growing(Goal):
    """A user's goal that has more rows at some postures."""

    def __init__(self) -> None:
        self.rows = 1

    def error(self, state):
        return np.zeros(self.rows)

    def jacobian(self, state):
        return np.eye(state.model.nv)[: self.rows]


def test_a_goal_that_changes_its_rows_is_refused(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, goals=[_Growing()])
    tracker = wb.methods.QP().tracker(problem, 0.02)
    tracker.step(problem.start)
    problem.goals[0].rows = 3
    with pytest.raises(wb.InputError, match="one number of rows at all postures"):
        tracker.step(problem.start)


class _Uneven(_Growing):
    def jacobian(self, state):
        return np.eye(state.model.nv)[:1]


def test_a_goal_with_other_numbers_of_values_and_rows_is_refused(scene: wb.Scene) -> None:
    problem = wb.Problem(scene, goals=[_Uneven()])
    problem.goals[0].rows = 2
    with pytest.raises(wb.InputError, match=r"goals\[0\] \(_Uneven\): it has 2 values and a jacobian of 1 rows"):
        wb.methods.QP().tracker(problem, 0.02).step(problem.start)


def program() -> QuadraticProgram:
    rng = np.random.default_rng(0)
    return QuadraticProgram(
        diagonal=np.ones(4), linear=np.ones(4), rows=rng.normal(size=(3, 4)), target=np.ones(3), weight=np.ones(3),
        elastic=rng.normal(size=(5, 4)), least=np.zeros(5), elastic_weight=np.ones(5), lower=-np.ones(4),
        upper=np.ones(4),
    )  # fmt: skip


@pytest.mark.parametrize("field", ["rows", "elastic_weight"])
def test_compiled_loops_are_not_given_sizes_that_do_not_fit(field: str) -> None:
    whole = program()
    assert solve_from(whole, violated_set(whole), 50) is not None
    broken = with_values(whole, **{field: getattr(whole, field)[:-1]})
    with pytest.raises(ValueError, match="other sizes"):
        solve_from(broken, violated_set(whole), 50)


@pytest.mark.parametrize("jump", [(0.1, 0.0, -0.16), (0.0, 0.0, 0.2), (0.1, 0.1, 0.1)])
def test_a_hold_comes_back_in_the_step_after_a_jump(jump: tuple[float, float, float]) -> None:
    """A long step turns far and misses what is held. The next is short and turns little: it asks for what is missed."""
    hand = wb.load("hand", side="left")
    place, there = "left_middle_proximal", wb.Hold("left_little_distal")
    at = wb.Scene(hand).state(hand.posture("relaxed")).frame(hand.frame_id(place)).translation
    problem = wb.Problem(wb.Scene(hand), "relaxed", goals=[wb.Point(place, at)], constraints=[there])
    tracker, q, missed = wb.methods.QP().tracker(problem, 1.0), problem.start, [0.0]
    held = there.resolve(problem.scene, problem.start)
    for target in (at, at + jump, None):
        if target is None:
            target = problem.scene.state(q).frame(hand.frame_id(place)).translation
        problem.retarget([wb.Point(place, target)])
        q = tracker.step(q).q
        missed.append(float(np.abs(held.value(problem.scene.state(q))).max()))
    assert missed[-2] > 1e-3
    assert missed[-1] < 0.3 * missed[-2]


SLIDER = """<robot name="slider">
  <link name="rail"/>
  <link name="ball"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="ball"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.mark.parametrize("method", [wb.methods.QP(), wb.methods.QP(solver="osqp")])
def test_a_joint_does_not_brake_where_it_has_to_leave_something(method: wb.methods.QP, tmp_path: Path) -> None:
    """Five millimetres before its limit, and four inside of a wall behind it: one step leads out."""
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER)
    scene = wb.Scene(wb.load(path)).add(wb.Box((1.0, 1.0, 1.0)), name="wall", at=(0.449, 0.0, 0.0))
    start, limit = np.array([0.995]), wb.tasks.StepLimit(1.0)
    assert scene.contacts(start, 0.1).distance == pytest.approx(-0.004, abs=1e-6)
    step = method.tracker(wb.Problem(scene, start, constraints=[limit]), 0.01).step(start)
    assert step.q == pytest.approx(0.999, abs=1e-6)
    alone = wb.Problem(wb.Scene(wb.load(path)), start, goals=[wb.Point("ball", (2.0, 0.0, 0.0))], constraints=[limit])
    assert method.tracker(alone, 0.01).step(start).q == pytest.approx(1.0 - 0.005 * np.exp(-0.2), abs=1e-6)


def test_a_frame_that_is_asked_for_exactly_is_held_exactly(two_arms: wb.Figure) -> None:
    """One hand held, the other on a curve; the judgement shares nothing with the tracker."""
    start = np.array([0.1, 0.3, 0.4, 0.8, -0.2, 0.5, 0.8])
    scene = wb.Scene(two_arms)
    centre = np.array(scene.state(start).frame(two_arms.frame_id("right")).translation)
    worst = {}
    for tolerance in (None, 1e-8):
        problem = wb.Problem(scene, start, constraints=[wb.Hold("left", orientation=False)])
        tracker, q, missed = wb.methods.QP().tracker(problem, 1 / 60), start, []
        for angle in np.linspace(0.0, 2.0, 60):
            goal = centre + 0.05 * np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0])
            problem.retarget([wb.Point("right", goal)])
            q = tracker.frame(q, tolerance).q
            judged = wb.assess(problem, q)
            missed.append((judged.goal_error, judged.constraint_violation))
        worst[tolerance] = np.max(missed, axis=0)
    assert (worst[1e-8] < 2e-8).all()
    assert (worst[None] < 1e-4).all()
    assert worst[None][1] > 1e-8, "as a drag needs it, holds are not looked at again"
