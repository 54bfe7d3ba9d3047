"""Answers of a smaller problem are answers of the whole one, and what it says it left out is what is missing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.methods.simplification.active_joints import active_joints
from wholebody.methods.simplification.embedding import EmbeddedConstraint, EmbeddedGoal
from wholebody.methods.simplification.simplify import Simplified
from wholebody.tasks.base import Bound, Constraint, Goal, Measure

FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]
TARGET = (0.45, -0.25, 1.1)


def standing(human: Figure, **more: object) -> wb.Problem:
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    plain = {"range_of_motion": False, "balance": False}  # what is left out shows in lists of all constraints
    settings = {"goals": [wb.Point("right_index_tip", TARGET)], "constraints": FEET} | plain | more
    return wb.Problem(scene, "standing", **settings)  # type: ignore[arg-type]


def groups(human: Figure, *names: str) -> set[str]:
    return {joint for name in names for joint in human.groups[name]}


def test_what_moves_no_goal_and_no_held_foot_is_locked(human: Figure) -> None:
    problem = standing(human)
    left_out = wb.simplify(problem).left_out
    toes = {name for name in human.joints if "toe" in name}
    assert set(left_out.locked) == groups(human, "left_arm", "neck") | toes
    assert left_out.helpers == ()
    assert left_out.frozen == ()
    assert left_out.counts["degrees of freedom"] == (55, 55 - len(left_out.locked))


def test_a_held_foot_brings_its_leg_only_where_something_moves_the_root(human: Figure) -> None:
    problem = standing(human, constraints=[*FEET, wb.Freeze("root", "legs")])
    part = wb.simplify(problem)
    assert set(part.left_out.frozen) == {"root_joint"} | groups(human, "legs")
    assert part.problem.constraints == ()  # nothing moves the feet any more
    assert part.problem.scene.figure.root == "fixed"


def test_a_closed_loop_brings_the_other_arm(human: Figure) -> None:
    loop = wb.Hold("left_palm", relative_to="right_palm")
    problem = standing(human, constraints=[*FEET, loop])
    assert not groups(human, "left_arm") & set(wb.simplify(problem).left_out.locked)


def test_joints_may_be_kept(human: Figure) -> None:
    problem = standing(human, constraints=[*FEET, wb.Balance(), wb.Freeze("left_arm")])
    left_out = wb.simplify(problem, lock=False).left_out
    assert left_out.locked == ()
    assert set(left_out.frozen) == groups(human, "left_arm")
    assert left_out.helpers == ()
    assert left_out.excess == 0.0
    assert left_out.exact


def test_an_inequality_brings_no_joint_and_is_named(human: Figure) -> None:
    problem = standing(human, constraints=[*FEET, wb.Balance()])
    left_out = wb.simplify(problem).left_out
    assert groups(human, "left_arm") <= set(left_out.locked)
    assert left_out.helpers == ("Balance",)
    assert not left_out.exact
    assert "Balance" in str(left_out)


def test_what_has_to_be_mended_takes_part(human: Figure) -> None:
    start = human.with_joints(human.posture("standing"), {"left_wrist_flexion": 3.0})
    scene = wb.Scene(human)
    state = State(human.model).update(human.posture("standing"))
    scene.add(wb.Sphere(0.05), name="ball", at=state.frame(human.frame_id("left_palm")).translation)
    goals = [wb.Point("right_index_tip", TARGET)]
    out = wb.Problem(wb.Scene(human), start, goals=goals, constraints=FEET)
    inside = wb.Problem(scene, "standing", goals=goals, constraints=FEET)
    assert "left_wrist_flexion" not in wb.simplify(out).left_out.locked
    assert not groups(human, "left_arm") & set(wb.simplify(inside).left_out.locked)


def test_a_measure_that_is_no_sum_over_joints_keeps_its_joints(human: Figure) -> None:
    problem = standing(human, measures=[wb.PotentialEnergy(0.01)])
    locked = set(wb.simplify(problem).left_out.locked)
    assert not {name for name in locked if "shoulder" in name or "elbow_flexion" in name}


@pytest.mark.parametrize("stated", [wb.Displacement(3.0), wb.Discomfort()])
def test_the_excess_is_what_the_locked_joints_could_save(human: Figure, stated: Measure) -> None:
    start = human.with_joints(human.posture("standing"), {"left_elbow_flexion": 0.01, "neck1_flexion": 0.2})
    scene = wb.Scene(human)
    problem = wb.Problem(scene, start, goals=[wb.Point("right_index_tip", TARGET)], constraints=FEET, measures=[stated])
    left_out = wb.simplify(problem).left_out
    state, saved = State(human.model), 0.0
    measure = problem.measures[0]
    for name in left_out.locked:
        joint = human.model.joints[human.joint_id(name)]
        low, high = human.model.lowerPositionLimit[joint.idx_q], human.model.upperPositionLimit[joint.idx_q]
        values = []
        for angle in np.linspace(low, high, 801):
            q = start.copy()
            q[joint.idx_q] = angle
            values.append(measure.weight * measure.value(state.update(q)))
        saved += measure.weight * measure.value(state.update(start)) - min(values)
    assert saved > 0.3
    np.testing.assert_allclose(left_out.excess, saved, rtol=3e-3)


def test_the_smaller_figure_stands_where_the_whole_one_does(human: Figure) -> None:
    problem = standing(human, constraints=[*FEET, wb.Balance(), wb.ReachCones()])
    part = wb.simplify(problem)
    small = part.problem.scene.model
    state, whole = State(small), State(human.model)
    for q in random_postures(small, 5, 0):
        state.update(q)
        whole.update(part.posture(q))
        for frame in ("right_index_tip", "left_foot", "left_palm", "head_top"):
            here = state.frame(part.problem.scene.frame_id(frame))
            assert here.isApprox(whole.frame(human.frame_id(frame)), 1e-9)
        names = part.problem.scene.piece_names
        there = dict(zip(problem.scene.piece_names, _piece_places(problem.scene, part.posture(q)), strict=True))
        for name, place in zip(names, _piece_places(part.problem.scene, q), strict=True):
            assert np.abs(place - there[name]).max() < 1e-9


def _piece_places(scene: wb.Scene, q: np.ndarray) -> np.ndarray:
    with scene.borrow() as workspace:
        return workspace.near(q, 0.0).placements


class Lean(Constraint):
    """A term of a user's own that asks the whole posture by index."""

    def value(self, state: State) -> np.ndarray:
        return np.array([state.q[52] - state.q[49] ** 2])

    def jacobian(self, state: State) -> np.ndarray:
        row = np.zeros((1, state.model.nv))
        row[0, 51], row[0, 48] = 1.0, -2.0 * state.q[49]
        return row


@pytest.mark.parametrize(
    "terms",
    [
        {"goals": [wb.Point("right_index_tip", TARGET), wb.Posture("standing", joints=["right_arm"])]},
        {"goals": [wb.Frame("right_palm", TARGET)], "measures": [wb.Discomfort(), wb.Effort(), wb.Displacement()]},
        {"goals": [wb.Axis("right_palm", (1, 0, 0), toward=TARGET)], "constraints": [*FEET, wb.Balance(margin=0.01)]},
        {"constraints": [wb.Freeze("root", "legs", "spine"), wb.Balance(), wb.ReachCones(), Lean()]},
        {"constraints": [wb.Freeze("spine"), *FEET, wb.ReachCones(["right_shoulder"])], "measures": [wb.Discomfort()]},
        {"constraints": [wb.Freeze("spine"), *FEET], "measures": [wb.PotentialEnergy(0.01)]},
    ],
)
def test_every_term_is_the_same_function_of_the_joints_that_are_left(human: Figure, terms: dict[str, list]) -> None:
    """Against the whole problem's terms at lifted postures, derivatives by finite differences of those."""
    problem = standing(human, **terms)
    part = wb.simplify(problem)
    small = part.problem.scene.model
    state, whole = State(small), State(human.model)
    rng = np.random.default_rng(0)
    for q in random_postures(small, 2, 4):
        if small.nq != small.nv:
            q[:7] = problem.start[:7]

        def before(kind: str, at: np.ndarray) -> np.ndarray:
            whole.update(part.posture(at))
            if kind == "goals":
                return np.concatenate([goal.error(whole) for goal in problem.goals])
            if kind == "measures":
                return np.array([sum(term.weight * term.value(whole) for term in problem.measures)])
            values = np.concatenate([[0.0], *(np.atleast_1d(term.value(whole)) for term in problem.constraints)])
            return values

        step = rng.normal(size=small.nv) * 1e-6
        moved = pin.integrate(small, q, step)
        state.update(q)
        errors = np.concatenate([goal.error(state) for goal in part.problem.goals])
        np.testing.assert_allclose(errors, before("goals", q), atol=1e-9)
        slope = sum(term.weight * term.gradient(state) @ step for term in part.problem.measures)
        back = pin.integrate(small, q, -step)
        rise = 0.5 * (before("measures", moved) - before("measures", back))[0]
        assert abs(slope - rise) < 1e-4 * (abs(slope) + 1e-6)
        places = part._embedding.idx_v
        bend = sum(term.weight * term.curvature(state) for term in part.problem.measures)
        whole.update(part.posture(q))
        wanted = sum(term.weight * term.curvature(whole)[places] for term in problem.measures)
        np.testing.assert_allclose(bend, wanted, rtol=1e-6)
        change = np.concatenate([_rows(goal, state) @ step for goal in part.problem.goals])
        np.testing.assert_allclose(change, before("goals", moved) - before("goals", q), atol=1e-9)
        kept = [np.atleast_1d(term.value(state)) for term in part.problem.constraints]
        values, later = before("constraints", q), before("constraints", moved)
        for value in np.concatenate([np.zeros(1), *kept]):
            assert np.abs(values - value).min() < 1e-9
        rates = np.concatenate([np.zeros(1), *(_rows(term, state) @ step for term in part.problem.constraints)])
        for rate in rates:
            assert np.abs(later - values - rate).min() < 1e-9


def _rows(term: Goal | Constraint, state: State) -> np.ndarray:
    part = term.jacobian(state)
    return state.wrench_jacobian(part) if isinstance(part, tuple) else np.atleast_2d(part)


def test_terms_that_cannot_be_stated_anew_are_asked_at_the_whole_posture(human: Figure) -> None:
    problem = standing(
        human,
        goals=[wb.Point("right_index_tip", TARGET), wb.Posture(human.posture("standing"), joints=["right_arm"])],
        constraints=[wb.Freeze("root", "legs", "spine"), Lean()],
    )
    part = wb.simplify(problem).problem
    assert [isinstance(goal, EmbeddedGoal) for goal in part.goals] == [False, True]
    assert [type(term) for term in part.constraints] == [EmbeddedConstraint]


class Slow(Bound):
    def bounds(self, state: State, dt: float | None) -> tuple[np.ndarray, np.ndarray]:
        return -np.arange(1.0, state.model.nv + 1.0), np.arange(1.0, state.model.nv + 1.0)


def test_a_bound_of_ones_own_keeps_its_joints_numbers(human: Figure) -> None:
    problem = standing(human, constraints=[*FEET, Slow()])
    part = wb.simplify(problem)
    low, high = part.problem.bounds[0].bounds(State(part.problem.scene.model), None)
    kept = [human.model.joints[human.model.getJointId(name)] for name in list(part.problem.scene.model.names)[1:]]
    places = [place for joint in kept for place in range(joint.idx_v, joint.idx_v + joint.nv)]
    np.testing.assert_array_equal(high, np.array(places) + 1.0)
    np.testing.assert_array_equal(low, -high)


def solved(problem: wb.Problem) -> tuple[Simplified, wb.Solution]:
    part = wb.simplify(problem)
    return part, part.restored(wb.solve(part.problem))


@pytest.mark.parametrize("seed", range(2))
def test_answers_of_random_problems_hold_in_the_whole_one(
    human: Figure, cluttered: Callable[..., wb.Scene], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    scene = cluttered(human, seed, 12, 1.2)
    target = (rng.uniform(0.3, 0.6), rng.uniform(-0.6, 0.2), rng.uniform(0.7, 1.5))
    goals = [wb.Point("right_index_tip", target)]
    problem = wb.Problem(scene, "standing", goals=goals, constraints=[*FEET, wb.Balance()], clearance=0.003)
    part, answer = solved(problem)
    judged = wb.assess(problem, answer.q)
    assert answer.q.shape == (human.model.nq,)
    assert judged == answer.assessment
    assert judged.penetration < 1e-6
    assert judged.holds(1e-4)
    assert answer.status == "solved"
    assert len(part.problem.scene.pair_table.pairs) < len(scene.pair_table.pairs)


@pytest.mark.parametrize("seed", range(1))
def test_an_arm_among_hundreds_of_things_keeps_what_it_reaches(
    arm: Figure, cluttered: Callable[..., wb.Scene], seed: int
) -> None:
    scene = cluttered(arm, seed, 120, 2.5)
    q = next(
        q for q in random_postures(arm.model, 400, seed) if scene.contacts(q, 0.02).distance.min(initial=1.0) > 0.0
    )
    tip = arm.segments[-1]
    at = State(arm.model).update(q).frame(arm.frame_id(tip)).translation.copy()
    problem = wb.Problem(scene, goals=[wb.Point(tip, at)], measures=[wb.Displacement()], clearance=0.001)
    part, answer = solved(problem)
    assert len(part.left_out.things) > 60
    assert set(part.problem.scene.objects) == set(scene.objects) - set(part.left_out.things)
    assert wb.assess(problem, answer.q).holds(1e-4)


def test_an_answer_that_does_not_hold_in_the_whole_problem_is_not_called_solved(human: Figure) -> None:
    problem = standing(human)
    part = wb.simplify(problem)
    answer = wb.solve(part.problem)
    assert part.restored(answer).status == "solved"
    crowded = wb.Scene(human).add(wb.Sphere(0.1), name="late", at=TARGET)
    late = wb.Problem(crowded, "standing", goals=[wb.Point("right_index_tip", TARGET)], constraints=FEET)
    stale = Simplified(part.problem, late, part.left_out, part._embedding)
    assert stale.restored(answer).status == "infeasible"


def test_a_thing_can_be_moved_in_the_smaller_scene(human: Figure) -> None:
    scene = wb.Scene(human).add(wb.Box((0.02, 0.03, 0.04)), name="box", at=(0.5, 0.4, 1.0))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", TARGET)], constraints=FEET)
    small = wb.simplify(problem).problem.scene
    small.move("box", at=(0.2, 0.1, 1.1, 0.0, 0.0, 0.6, 0.8))
    assert small.geometry.geometryObjects[-1].placement.isApprox(
        pin.XYZQUATToSE3(np.array([0.2, 0.1, 1.1, 0, 0, 0.6, 0.8]))
    )
    assert scene.geometry.geometryObjects[-1].placement.translation.tolist() == [0.5, 0.4, 1.0]


def test_the_whole_problem_is_left_as_it_was(human: Figure) -> None:
    problem = standing(human)
    before = (problem.scene.revision, problem.goals, len(problem.scene.pair_table.pairs), problem.start.tolist())
    wb.simplify(problem)
    after = (problem.scene.revision, problem.goals, len(problem.scene.pair_table.pairs), problem.start.tolist())
    assert before == after
    assert active_joints(problem).moving.any()


def test_mistakes_are_refused(human: Figure) -> None:
    problem = standing(human)
    with pytest.raises(InputError, match="problem is a Scene"):
        wb.simplify(problem.scene)  # type: ignore[arg-type]
    problem.scene.add(wb.Sphere(0.1), name="new", at=(2.0, 0.0, 1.0))
    with pytest.raises(InputError, match="state the problem anew"):
        wb.simplify(problem)


def test_a_measure_counts_for_what_it_is(human: Figure) -> None:
    """Without measures of its own the smaller problem stands for the same default."""
    problem = standing(human)
    part = wb.simplify(problem).problem
    assert part.measures_given is problem.measures_given is False
    assert isinstance(part.measures[0], Measure)
