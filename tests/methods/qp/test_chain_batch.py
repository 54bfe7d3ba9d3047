"""Many goals of one chain at once against solves one by one, against Pinocchio and coal, and what is left out."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.assessment.posture import Numbers, judged_postures
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.stability.bodies import spatial_arm
from wholebody.methods.qp.chain_kernel import reach_all
from wholebody.tasks.base import Goal

OFFSET = (0.02, 0.0, 0.01)


@pytest.fixture(scope="module")
def arm() -> wb.Figure:
    return spatial_arm()


@pytest.fixture(scope="module")
def scene(arm: wb.Figure) -> wb.Scene:
    return wb.Scene(arm).add(wb.Box((0.2, 0.5, 0.3)), name="box", at=(0.5, 0.2, 0.4))


def posed(scene: wb.Scene, count: int, kind: str = "frame", **stated) -> list[wb.Problem]:
    """Problems whose starts and goals differ, some of them blocked by the box or out of reach."""
    figure, rng, problems = scene.figure, np.random.default_rng(31), []
    lower, upper = figure.model.lowerPositionLimit, figure.model.upperPositionLimit
    for _ in range(count):
        place = figure.placement(rng.uniform(lower, upper), "tip")
        goals: dict[str, Goal] = {
            "frame": wb.Frame("tip", place),
            "point": wb.Point("tip", place.translation, offset=OFFSET),
            "turned": wb.Orientation("tip", place.rotation),
        }
        problems.append(wb.Problem(scene, rng.uniform(0.5 * lower, 0.5 * upper), goals=[goals[kind]], **stated))
    return problems


@pytest.mark.parametrize("kind", ["frame", "point", "turned"])
def test_answers_are_those_of_solves_one_by_one(scene, kind):
    problems = posed(scene, 28, kind, clearance=0.01)
    batch = wb.methods.QP().batches(problems, 64)[0].run()
    assert 10 < batch.solved.sum() < 28, "some are left to a solve of their own"
    for problem, record in zip(problems, wb.solve_many(problems), strict=True):
        alone = wb.solve(problem)
        np.testing.assert_array_equal(record.q, alone.q)
        assert (record.outcome, record.message, record.iterations) == (alone.status, alone.message, alone.iterations)
        for name in ("goal_error", "goal_angle", "penetration", "limit_violation", "measure"):
            assert getattr(record, name) == pytest.approx(getattr(alone.assessment, name), abs=1e-12)


def test_rows_that_are_the_same_leave_joints_free_in_batches_too():
    """Seven joints have room at nine rows of rank six: what is in the way counts as in solves one by one."""
    figure, start = robots.known_arm("panda")
    scene, rng, problems = wb.Scene(figure), np.random.default_rng(0), []
    for number, at in enumerate([(0.35, 0.0, 0.75), (0.2, 0.3, 0.5), (0.2, -0.3, 0.5)]):
        scene.add(wb.Sphere(0.08), name=f"ball {number}", at=at)
    while len(problems) < 40:
        there = rng.uniform(figure.limits.lower, figure.limits.upper)
        if not scene.penetration(there):
            at = figure.placement(there, "tool")
            other = wb.Point("tool", at.act(np.array([0.0, 0.0, 0.1])), offset=(0.0, 0.0, 0.1))
            goals = [wb.Point("tool", at.translation), wb.Orientation("tool", at.rotation), other]
            problems.append(wb.Problem(scene, start, goals=goals))
    for problem, record in zip(problems, wb.solve_many(problems), strict=True):
        np.testing.assert_array_equal(record.q, wb.solve(problem).q)


def test_answers_are_where_pinocchio_has_the_tool(scene, arm):
    problems = posed(scene, 30)
    answers = wb.methods.QP().batches(problems, 64)[0].run()
    data = arm.model.createData()
    for place in answers.solved.nonzero()[0]:
        pin.framesForwardKinematics(arm.model, data, answers.q[place])
        off = pin.log6(data.oMf[arm.frame_id("tip")].actInv(problems[place].goals[0].resolved_target)).vector
        assert np.abs(off).max() < 1e-5
        assert (arm.limits.lower <= answers.q[place]).all()
        assert (answers.q[place] <= arm.limits.upper).all()


def test_the_judge_of_many_says_what_the_judge_of_one_says(scene, two_arms):
    """At postures that meet nothing, beyond limits and inside of the box."""
    rng, alone = np.random.default_rng(3), wb.Scene(two_arms)
    relative = [
        wb.Problem(
            alone, rng.uniform(-1.0, 1.0, 7),
            goals=[wb.Point("right", rng.uniform(-1.0, 1.0, 3), offset=OFFSET), wb.Relative("left", "right", place)],
            measures=[wb.tasks.Displacement(weight=0.3)],
        )
        for place in rng.uniform(-0.5, 0.5, (12, 3))
    ]  # fmt: skip
    seen = np.zeros(5, dtype=bool)
    for problems in (posed(scene, 25, clearance=0.02), relative):
        postures = rng.uniform(-3.0, 3.0, (len(problems), problems[0].scene.model.nq))
        many = np.transpose(judged_postures(problems[0], Numbers.of(problems), postures))
        for problem, q, numbers in zip(problems, postures, many, strict=True):
            one = wb.assess(problem, q)
            found = [one.goal_error, one.goal_angle, one.penetration, one.clearance_violation, one.limit_violation]
            np.testing.assert_allclose(numbers, [*found, 0.0, one.measure], rtol=1e-9, atol=1e-12)
            seen |= np.array(found) > 0.0
    assert seen.all()


def test_what_is_not_alike_is_left_out_or_apart(scene, arm):
    free = wb.Scene(arm)
    given = posed(scene, 2) + posed(free, 2) + posed(scene, 2, "point") + posed(scene, 1, measures=[])
    given += posed(scene, 1, constraints=[wb.Freeze("base")])
    places = [batch.places for batch in wb.methods.QP().batches(given, 64)]
    assert places == [[0, 1], [2, 3], [4, 5]]
    assert [len(batch.places) for batch in wb.methods.QP().batches(posed(free, 5), 2)] == [2, 2, 1]
    assert not wb.methods.QP(time_limit=1.0).batches(given, 64)


def test_the_loop_lets_other_threads_run():
    assert reach_all.targetoptions["nogil"]
