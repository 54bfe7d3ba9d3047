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
from wholebody.methods.simplification.simplify import Simplified
from wholebody.tasks.base import Constraint, Goal, Measure

FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]
TARGET = (0.45, -0.25, 1.1)


def standing(human: Figure, **more: object) -> wb.Problem:
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    plain = {"range_of_motion": False, "balance": False}  # what is left out shows in lists of all constraints
    settings = {"goals": [wb.Point("right_index_tip", TARGET)], "constraints": FEET} | plain | more
    return wb.Problem(scene, "standing", **settings)  # type: ignore[arg-type]


FROZEN = [wb.Freeze("root", "legs", "spine", "neck", "left_arm")]


def test_frozen_joints_and_pairs_between_them_are_left_out(human: Figure) -> None:
    whole = standing(human, constraints=[*FEET, *FROZEN], measures=[wb.Effort(), wb.tasks.Discomfort()])
    part = wb.simplify(whole)
    model = part.problem.scene.model
    assert {*part.left_out.joints, *model.names} == {*human.model.names}
    assert part.left_out.counts["degrees of freedom"] == (55, model.nv)
    assert part.problem.constraints == ()  # nothing moves the feet any more
    assert part.left_out.rigid > 100
    owners = [[part.problem.scene.piece_owner[k] for k in pair] for pair in part.problem.scene.pair_table.pairs]
    assert all(any(name.startswith("right_") for name in pair) for pair in owners)
    here, there = State(model), State(human.model)
    for q in random_postures(model, 3, 0):
        here.update(q), there.update(part.posture(q))
        for one, other in zip(part.problem.goals, whole.goals, strict=True):
            np.testing.assert_allclose(one.error(here), other.error(there), atol=1e-9)
        slopes = [sum(term.weight * term.gradient(at) for term in of) for of, at in (
            (part.problem.measures, here), (whole.measures, there))]  # fmt: skip
        moved = [human.model.joints[human.model.getJointId(name)].idx_v for name in list(model.names)[1:]]
        np.testing.assert_allclose(slopes[0], slopes[1][moved], atol=1e-9)


class Lean(Constraint):
    """A term of a user's own that asks the whole posture by index."""

    def value(self, state: State) -> np.ndarray:
        return np.array([state.q[52] - state.q[49] ** 2])

    def jacobian(self, state: State) -> np.ndarray:
        row = np.zeros((1, state.model.nv))
        row[0, 51], row[0, 48] = 1.0, -2.0 * state.q[49]
        return row


@pytest.mark.parametrize("term", [wb.Posture(np.zeros(56), joints=["right_arm"]), Lean()])
def test_frozen_joints_stay_where_a_term_needs_the_whole_figure(human: Figure, term: Goal | Constraint) -> None:
    if isinstance(term, Goal):
        whole = standing(human, goals=[wb.Posture(human.posture("standing"), joints=["right_arm"])], constraints=FROZEN)
    else:
        whole = standing(human, constraints=[*FROZEN, term])
    part = wb.simplify(whole)
    assert part.left_out.joints == ()
    assert part.problem.scene.figure is human
    assert [type(bound) for bound in part.problem.bounds] == [wb.Freeze]


class Behind(Constraint):
    """The right palm stays behind a plane, as a hinge that is level where the palm is."""

    lower, upper = np.array([-np.inf]), np.array([0.0])

    def value(self, state: State) -> np.ndarray:
        return np.array([max(0.0, self._palm(state).translation[0] - 0.4)])

    def jacobian(self, state: State) -> np.ndarray:
        data, palm = state.model.createData(), state.model.getFrameId("right_palm")
        row = pin.computeFrameJacobian(state.model, data, state.q, palm, pin.LOCAL_WORLD_ALIGNED)[:1]
        return row * (self.value(state)[0] > 0.0)

    def _palm(self, state: State) -> pin.SE3:
        return state.frame(state.model.getFrameId("right_palm"))


def test_a_constraint_of_ones_own_that_does_not_act_at_the_start_stays(human: Figure) -> None:
    goals = [wb.Point("right_index_tip", (0.6, -0.2, 1.2))]
    part, answer = solved(standing(human, goals=goals, constraints=[*FROZEN, Behind()]))
    assert [type(term) for term in part.problem.constraints] == [Behind]
    assert answer.status == "unreachable"


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
    problem = wb.Problem(scene, goals=[wb.Point(tip, at)], measures=[wb.tasks.Displacement()], clearance=0.001)
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
    stale = Simplified(part.problem, late, part.left_out, part._part)
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


def test_what_a_figure_was_asked_before_changes_nothing() -> None:
    """It carries a pole, begins outside of its limits or has a frozen arm, and is asked again without."""

    def pairs(figure: Figure, case: str) -> tuple[str, ...]:
        scene = wb.Scene(figure)
        for k, at in enumerate(((0.6, 0.2, 0.9), (-0.9, 0.1, 1.3), (0.2, 1.4, 1.0), (1.9, 0.0, 1.0), (2.6, -1.0, 1.0))):
            scene.add(wb.Box((0.2, 0.2, 0.2)), name=f"box {k}", at=at)
        if case == "carries":
            scene.attach(wb.Capsule(0.02, 1.0), name="pole", to="right_hand", at=(0.0, 0.0, -0.6))
        start = figure.posture("standing")
        if case == "outside":
            start = figure.with_joints(start, {"right_elbow_flexion": -1.2})
        terms = [wb.Hold("left_foot"), *([wb.Freeze("right_arm")] if case == "frozen" else [])]
        return tuple(str(wb.simplify(wb.Problem(scene, start, constraints=terms)).left_out).splitlines())

    cases = ("plain", "carries", "outside", "frozen", "plain")
    one = wb.load("human")
    found = [pairs(one, case) for case in cases]
    assert found == [pairs(wb.load("human"), case) for case in cases]
    assert len(set(found)) > 2


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
