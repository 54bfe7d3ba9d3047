"""Answers of a smaller problem are answers of the whole one, and what it says it left out is what is missing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.methods.simplification import Simplified
from wholebody.tasks.base import Measure

FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]
TARGET = (0.45, -0.25, 1.1)


def standing(human: Figure, **more: object) -> wb.Problem:
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    plain = {"range_of_motion": False, "balance": False}  # what is left out shows in lists of all constraints
    settings = {"goals": [wb.Point("right_index_tip", TARGET)], "constraints": FEET} | plain | more
    return wb.Problem(scene, "standing", **settings)  # type: ignore[arg-type]


FROZEN = [wb.Freeze("root", "legs", "spine", "neck", "left_arm")]


def test_pairs_that_frozen_joints_keep_apart_or_in_place_are_left_out(human: Figure) -> None:
    box = wb.Box((0.1, 0.1, 0.1))

    def beside(constraints: list[object]) -> Simplified:
        whole = standing(human, constraints=constraints)
        whole.scene.add(box, name="box", at=(0.3, 0.9, 1.0))  # within reach of the left hand alone
        return wb.simplify(wb.Problem(whole.scene, "standing", goals=whole.goals, constraints=constraints))

    free, part = beside(FEET), beside([*FEET, *FROZEN])
    assert (free.left_out.things, part.left_out.things) == ((), ("floor", "box"))
    assert part.left_out.rigid > 100
    scene = part.problem.scene
    assert scene.figure is human
    owners = [[scene.piece_owner[k] for k in pair] for pair in scene.pair_table.pairs]
    assert all(any(name.startswith("right_") for name in pair) for pair in owners)
    assert [type(term) for term in (*part.problem.constraints, *part.problem.bounds)].count(wb.Freeze) == 1
    left = {"pairs": (len(part.whole.scene.pair_table.pairs), len(scene.pair_table.pairs))}
    assert part.left_out.counts.items() >= left.items()


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
    stale = Simplified(part.problem, late, part.left_out)
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


def test_a_measure_counts_for_what_it_is(human: Figure) -> None:
    """Without measures of its own the smaller problem stands for the same default."""
    problem = standing(human)
    part = wb.simplify(problem).problem
    assert part.measures_given is problem.measures_given is False
    assert isinstance(part.measures[0], Measure)
