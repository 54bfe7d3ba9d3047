"""The judge on postures whose distances and errors are plain, and on answers that claim what is not so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.attack.judging import Pairs, Verdict, judge
from wholebody.bench.attack.solves import verdict
from wholebody.bench.suite.stability.bodies import Builder, planar_arm, sliding_tool

REACHED = (0.6, 0.0, 0.0)


@pytest.fixture
def arm() -> wb.Scene:
    """Return an arm along x of 0.5 and 0.4 m, with a ball 0.1 m above its second rod."""
    return wb.Scene(planar_arm([0.5, 0.4])).add(wb.Sphere(0.05), name="ball", at=(0.7, 0.0, 0.18))


def test_distances_are_those_of_plain_geometry(arm: wb.Scene) -> None:
    pairs = Pairs(arm)
    distances = dict(zip(pairs.owners, pairs.distances(np.zeros(2)), strict=True))
    assert distances["turn2_link", "ball"] == pytest.approx(0.18 - 0.05 - 0.03, abs=1e-6)
    assert pairs.asked(np.zeros(2), 0.3).min() == pytest.approx(0.1, abs=1e-6)  # what rests nearer keeps its distance
    arm.move("ball", at=(0.7, 0.0, 0.06))
    assert Pairs(arm).distances(np.zeros(2)).min() == pytest.approx(0.06 - 0.08, abs=1e-6)


def test_what_cannot_move_is_no_posture_s_fault() -> None:
    builder = Builder("post")
    joint = builder.joint("rz", "turn")
    builder.rod(joint, (0.3, 0.0, 0.0), 0.02)
    builder.geometry.geometryObjects[0].parentJoint = 0
    scene = wb.Scene(builder.figure()).add(wb.Sphere(0.1), name="ball")
    assert not len(Pairs(scene).distances(np.zeros(1)))


def test_errors_are_those_of_plain_geometry(arm: wb.Scene) -> None:
    problem = wb.Problem(arm, np.zeros(2))
    q = np.array([0.0, -np.pi / 2])  # the second rod points up
    tip = (0.5, 0.0, 0.4)

    def goal(term: Any) -> float:
        return judge(problem, [term], [], q).goal

    assert goal(wb.Point("tip", tip)) == pytest.approx(0.0, abs=1e-12)
    assert goal(wb.Point("tip", (0.5, 0.3, 0.0))) == pytest.approx(0.5)
    assert goal(wb.Orientation("tip", (0.0, 0.0, 0.0, 1.0))) == pytest.approx(np.pi / 2)
    assert goal(wb.Axis("tip", (1.0, 0.0, 0.0), direction=(1.0, 0.0, 1.0))) == pytest.approx(np.pi / 4)
    assert goal(wb.Frame("tip", tip)) == pytest.approx(np.pi / 2)
    assert goal(wb.Posture([0.3, -np.pi / 2])) == pytest.approx(0.3)
    held = judge(problem, [], [wb.Hold("tip", orientation=False)], q).constraints
    assert held == pytest.approx(0.4 * np.sqrt(2.0))
    assert judge(problem, [], [wb.Freeze("turn2")], q).constraints == pytest.approx(np.pi / 2)
    assert judge(problem, [], [wb.Plane("tip", (0, 0, 1), point=(0, 0, 0.1), side="above")], q).constraints == 0.0
    assert judge(problem, [], [], np.array([0.0, 3.0])).limits == pytest.approx(0.1)
    assert not judge(problem, [], [], np.array([0.0, np.nan])).finite


def test_a_persons_ranges_of_motion_count_without_being_stated() -> None:
    scene = wb.Scene(wb.load("human", detail="capsules"))
    figure, problem = scene.figure, wb.Problem(scene)
    assert judge(problem, [], [], problem.start).constraints == 0.0
    bent = figure.with_joints(problem.start, {name: 1.0 for name in figure.joints if name.startswith("neck")})
    bent = figure.clamp(bent)  # each angle of the neck is one that it has, but not all of them together
    assert judge(problem, [], [], bent).limits == 0.0
    assert judge(problem, [], [], bent).constraints > 0.05
    assert judge(wb.Problem(scene, range_of_motion=False), [], [], bent).constraints == 0.0


def test_a_place_and_a_turn_of_a_free_root_are_told_apart() -> None:
    scene = wb.Scene(wb.load("hand"))
    q = scene.figure.neutral
    there = q.copy()
    there[0] += 0.3
    assert judge(wb.Problem(scene), [wb.Posture(there)], [], q).goal == pytest.approx(0.3)


@pytest.fixture
def solved(arm: wb.Scene) -> tuple[wb.Problem, list[wb.Goal], wb.Solution]:
    goals: list[wb.Goal] = [wb.Point("tip", REACHED)]
    problem = wb.Problem(arm, np.array([0.5, -0.5]), goals=goals)
    solution = wb.solve(problem)
    assert solution.solved
    return problem, goals, solution


def judged(problem: wb.Problem, goals: Sequence[wb.Goal], solution: wb.Solution, *, witness: bool) -> Verdict:
    found = judge(problem, goals, [], solution.q)
    return verdict(problem, found, solution, tolerance=wb.methods.QP().tolerance, witness=witness, seconds=0.1)


def outcome(solved: tuple[wb.Problem, list[wb.Goal], wb.Solution], **changed: Any) -> tuple[str, str]:
    problem, goals, solution = solved
    found = judged(problem, goals, replace(solution, **changed), witness=True)
    return found.outcome, found.words


def test_a_true_answer_is_right(solved: Any) -> None:
    assert outcome(solved)[0] == "right"


def test_false_claims_are_wrong(solved: Any) -> None:
    problem, _, solution = solved
    aside = wb.assess(problem, problem.start)
    assert "goals are missed" in outcome(solved, q=problem.start, assessment=aside)[1]
    assert outcome(solved, q=problem.start, assessment=aside)[0] == "wrong"
    assert outcome(solved, q=problem.start, assessment=aside, status="unreachable")[0] == "gave up"
    assert "everything holds" in outcome(solved, status="infeasible")[1]
    better = replace(solution.assessment, least_distance=solution.assessment.least_distance + 1e-4)
    assert "its least distance is" in outcome(solved, assessment=better)[1]
    assert outcome(solved, q=np.full(2, np.nan))[0] == "wrong"
    out = np.array([0.0, 3.0])
    assert "constraints are violated" in outcome(solved, q=out, assessment=wb.assess(problem, out))[1]


def test_an_answer_inside_of_something_is_wrong() -> None:
    tool = sliding_tool((wb.Sphere(0.1), pin.SE3.Identity()))
    scene = wb.Scene(tool).add(wb.Box((1.0, 1.0, 1.0)), name="box", at=(0.0, 0.0, 1.0))
    goals = [wb.Point("tool", (0.0, 0.0, 0.5))]
    problem = wb.Problem(scene, goals=goals)
    solution = wb.solve(problem)
    inside = np.array([0.0, 0.0, 0.5])
    lie = replace(solution, q=inside, status="solved", assessment=wb.assess(problem, inside))
    found = judged(problem, goals, lie, witness=False)
    assert found.outcome == "wrong"
    assert "violated by 0.1 m" in found.words
    honest = judged(problem, goals, solution, witness=False)
    assert honest.outcome == "right"
