"""Whole solves: arms with known answers, clutter, starts inside, goals out of reach, and what contradicts itself."""

from __future__ import annotations

from math import inf

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.bench.suite.stability.catalogue import cases

LENGTHS = (0.5, 0.4)


def two_link_angles(x, y, elbow):
    """Both joint angles of the two-link arm by the law of cosines."""
    a, b = LENGTHS
    bend = elbow * np.arccos((x * x + y * y - a * a - b * b) / (2 * a * b))
    return np.array([np.arctan2(y, x) - np.arctan2(b * np.sin(bend), a + b * np.cos(bend)), bend])


@pytest.mark.parametrize("angle", [0.0, 2.2])
@pytest.mark.parametrize("distance", [0.2, 0.5, 0.85])
def test_two_link_arm_against_the_law_of_cosines(planar_arm, honest, distance, angle):
    scene = wb.Scene(planar_arm(LENGTHS))
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    for elbow in (1.0, -1.0):
        start = np.array([0.1, 0.4 * elbow])
        problem = wb.Problem(scene, start=start, goals=[wb.Point("tip", (x, y, 0.0))])
        solution = honest(problem, wb.solve(problem))
        assert solution.status == "solved"
        both = [two_link_angles(x, y, side) for side in (1.0, -1.0)]
        assert min(np.abs(pin.difference(scene.model, q, solution.q)).max() for q in both) < 1e-4


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("solver", ["osqp", "daqp"])
def test_tolerance_asked_for_is_reached(planar_arm, honest, tolerance, solver):
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    problem = wb.Problem(scene, start=np.array([0.1, 0.2, 0.3]), goals=[wb.Point("tip", (0.3, 0.5, 0.0))])
    solution = honest(problem, wb.methods.QP(solver, tolerance=tolerance).solve(problem), tolerance)
    assert solution.status == "solved"
    assert solution.assessment.goal_error <= tolerance


def test_what_is_left_free_minimises_the_measures(planar_arm):
    """Least effort of a redundant arm, against a fine search along its self-motion."""
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    start, target = np.array([0.1, 0.4, 0.3]), np.array([0.3, 0.5])
    problem = wb.Problem(scene, start=start, goals=[wb.Point("tip", (*target, 0.0))])
    solution = wb.methods.QP(tolerance=1e-8).solve(problem)
    best = np.inf
    for last in np.linspace(-3.0, 3.0, 8001):  # direction of the last link in the plane
        wrist = target - 0.3 * np.array([np.cos(last), np.sin(last)])
        reach = (wrist @ wrist - 0.4**2 - 0.3**2) / (2 * 0.4 * 0.3)
        if abs(reach) > 1.0:
            continue
        for side in (1.0, -1.0):
            bend = side * np.arccos(reach)
            turn = np.arctan2(wrist[1], wrist[0]) - np.arctan2(0.3 * np.sin(bend), 0.4 + 0.3 * np.cos(bend))
            best = min(best, float(((np.array([turn, bend, last - turn - bend]) - start) ** 2).sum()))
    assert solution.assessment.measure == pytest.approx(best, rel=1e-6)
    # the measures, whose curvature is 2, may be higher by tolerance (1 + measure)
    assert solution.assessment.optimality < np.sqrt(1e-8 * (1.0 + best))


@pytest.mark.parametrize("beyond", [0.001, 1.0])
@pytest.mark.parametrize("start", [(0.1, 0.4), (2.0, -1.0)])
def test_goals_out_of_reach_are_answered_with_the_nearest_posture(planar_arm, honest, beyond, start):
    scene = wb.Scene(planar_arm(LENGTHS))
    away = sum(LENGTHS) + beyond
    target = away * np.array([np.cos(0.7), np.sin(0.7), 0.0])
    problem = wb.Problem(scene, start=np.array(start), goals=[wb.Point("tip", target)])
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "unreachable"
    # of postures that are nearly as near the one of less effort is taken
    assert solution.assessment.goal_error == pytest.approx(beyond, rel=2e-3, abs=2e-5)
    assert "beyond the reach of its joints in one line" in solution.message


def test_goals_too_near_are_out_of_reach_too(planar_arm, honest):
    scene = wb.Scene(planar_arm(LENGTHS))
    problem = wb.Problem(scene, start=np.array([0.1, 1.0]), goals=[wb.Point("tip", (0.03, 0.0, 0.0))])
    solution = honest(problem, wb.solve(problem))
    nearest = np.sqrt(LENGTHS[0] ** 2 + LENGTHS[1] ** 2 + 2 * np.prod(LENGTHS) * np.cos(3.0)) - 0.03
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(nearest, abs=2e-5)


def test_goal_out_of_the_plane_leaves_its_height(planar_arm, honest):
    scene = wb.Scene(planar_arm(LENGTHS))
    problem = wb.Problem(scene, start=np.array([0.1, 0.4]), goals=[wb.Point("tip", (0.5, 0.3, 0.2))])
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(0.2, abs=1e-5)


@pytest.mark.parametrize("clearance", [0.0, 0.005])
def test_goal_inside_an_obstacle_ends_at_the_clearance(free_bodies, honest, clearance):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.2), name="ball")
    q = scene.figure.neutral
    q[0] = 0.6
    problem = wb.Problem(scene, start=q, goals=[wb.Point("body0", (0.05, 0.0, 0.0))], clearance=clearance)
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "unreachable"
    assert solution.assessment.least_distance == pytest.approx(clearance, abs=1.1e-5)
    assert solution.assessment.goal_error == pytest.approx(0.25 + clearance, abs=2e-5)


@pytest.mark.parametrize("depth", [0.001, 0.05, 0.3])
@pytest.mark.parametrize("shape", [wb.Box((0.7, 0.7, 0.7)), wb.Sphere(0.35)], ids=["box", "sphere"])
def test_starts_inside_get_out(free_bodies, honest, shape, depth):
    scene = wb.Scene(free_bodies(wb.Capsule(0.05, 0.2))).add(shape, name="thing")
    q = scene.figure.neutral
    q[:3] = 0.35 + 0.05 - depth, 0.01, 0.02
    problem = wb.Problem(scene, start=q, clearance=0.002)
    assert wb.assess(problem, q).penetration > 0.8 * depth
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "solved"
    assert solution.assessment.least_distance >= 0.002 - 2e-5
    assert np.linalg.norm(solution.q[:3] - q[:3]) < 3.0 * depth + 0.05  # by a way that is not absurd


@pytest.mark.parametrize("solver", ["osqp", "daqp"])
def test_reachable_targets_in_clutter_are_all_solved(planar_arm, honest, solver, least_distance):
    scene = wb.Scene(planar_arm((0.35, 0.3, 0.25, 0.2), radius=0.015))
    rng = np.random.default_rng(5)
    for k in range(7):
        angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(0.45, 1.0)
        shape = wb.Sphere(0.06) if k % 2 else wb.Box((0.1, 0.1, 0.1))
        scene.add(shape, name=f"thing{k}", at=(away * np.cos(angle), away * np.sin(angle), 0.0))
    start = np.zeros(4)
    while least_distance(scene, start) < 0.01:
        start = rng.uniform(-1.0, 1.0, 4)
    data = scene.model.createData()
    done = 0
    while done < 12:
        q = rng.uniform(-2.5, 2.5, 4)
        if least_distance(scene, q) < 0.004:
            continue
        pin.framesForwardKinematics(scene.model, data, q)
        target = data.oMf[scene.frame_id("tip")].translation
        problem = wb.Problem(scene, start=start, goals=[wb.Point("tip", target)], clearance=0.002)
        solution = honest(problem, wb.methods.QP(solver, budget=10_000, restarts=20).solve(problem))
        assert solution.status == "solved", (done, q)
        done += 1


def test_goals_that_contradict_each_other_share_by_weight(free_bodies, honest):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1)))
    goals = [wb.Point("body0", (1.0, 0.0, 0.0), weight=3.0), wb.Point("body0", (0.0, 0.0, 0.0))]
    problem = wb.Problem(scene, goals=goals)
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "unreachable"
    assert solution.q[:3] == pytest.approx([0.75, 0.0, 0.0], abs=1e-3)  # where the error is within 1e-6 of its least


def test_the_same_goal_twice_is_one_goal(planar_arm, honest):
    scene = wb.Scene(planar_arm(LENGTHS))
    goal = wb.Point("tip", (0.5, 0.4, 0.0))
    problem = wb.Problem(scene, start=np.array([0.1, 0.4]), goals=[goal, goal, wb.Point("tip", (0.5, 0.4, 0.0))])
    assert honest(problem, wb.solve(problem)).status == "solved"


def test_goal_on_the_axis_of_a_joint(planar_arm, honest):
    """At the place of the first joint that joint does nothing; links of one length reach it folded."""
    scene = wb.Scene(planar_arm((0.4, 0.4), limit=3.15))
    problem = wb.Problem(scene, start=np.array([0.1, 0.4]), goals=[wb.Point("tip", (0.0, 0.0, 0.0))])
    solution = honest(problem, wb.solve(problem))
    assert solution.assessment.goal_error < 1e-4


def test_straight_arm_asked_to_come_straight_back(planar_arm, honest):
    """Every first-order row is zero along the arm; only bending helps, and no derivative says so."""
    scene = wb.Scene(planar_arm(LENGTHS))
    problem = wb.Problem(scene, start=np.zeros(2), goals=[wb.Point("tip", (0.6, 0.0, 0.0))])
    assert honest(problem, wb.solve(problem)).status == "solved"


def test_holds_that_contradict_each_other_are_infeasible(free_bodies, honest):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1)))
    holds = [wb.Hold("body0", (0.0, 0.0, 0.0)), wb.Hold("body0", (0.3, 0.0, 0.0))]
    problem = wb.Problem(scene, constraints=holds)
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "infeasible"
    assert solution.assessment.constraint_violation == pytest.approx(0.15, abs=1e-3)
    assert "Hold('body0'), is 300 mm from where constraints[0]" in solution.message


def test_hold_inside_an_obstacle_is_infeasible(free_bodies, honest):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.2), name="ball")
    problem = wb.Problem(scene, constraints=[wb.Hold("body0", (0.1, 0.0, 0.0))])
    assert honest(problem, wb.solve(problem)).status == "infeasible"


def test_frozen_joints_and_holds_that_contradict(planar_arm, honest):
    scene = wb.Scene(planar_arm(LENGTHS))
    start = np.array([0.1, 0.4])
    problem = wb.Problem(scene, start=start, constraints=[wb.Freeze("all"), wb.Hold("tip", (0.2, 0.2, 0.0))])
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "infeasible"
    assert solution.q == pytest.approx(start, abs=1e-12)


def test_frozen_joints_stay(planar_arm, honest):
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    start = np.array([0.1, 0.4, 0.3])
    problem = wb.Problem(scene, start=start, goals=[wb.Point("tip", (0.3, 0.5, 0.0))], constraints=[wb.Freeze("turn1")])
    solution = honest(problem, wb.solve(problem))
    assert solution.q[1] == start[1]


def test_nothing_asked_is_solved_where_it_stands(planar_arm, free_bodies):
    for figure in (planar_arm(LENGTHS), free_bodies(wb.Sphere(0.1))):
        for measures in (None, []):
            problem = wb.Problem(wb.Scene(figure), measures=measures)
            solution = wb.solve(problem)
            assert solution.status == "solved"
            assert solution.q == pytest.approx(problem.start, abs=1e-12)


def test_no_measures_leave_goals_reachable(planar_arm, honest):
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    problem = wb.Problem(scene, start=np.array([0.1, 0.4, 0.3]), goals=[wb.Point("tip", (0.3, 0.5, 0.0))], measures=[])
    assert honest(problem, wb.solve(problem)).status == "solved"


def test_start_out_of_limits_ends_within_them(planar_arm, honest):
    scene = wb.Scene(planar_arm(LENGTHS, limit=1.0))
    problem = wb.Problem(scene, start=np.array([2.0, -2.5]), goals=[wb.Point("tip", (0.75, 0.3, 0.0))])
    assert honest(problem, wb.solve(problem)).status == "solved"


def test_the_same_question_has_the_same_answer(planar_arm):
    answers = []
    for _ in range(3):
        scene = wb.Scene(planar_arm((0.4, 0.3, 0.3))).add(wb.Sphere(0.1), name="ball", at=(0.5, 0.3, 0.0))
        problem = wb.Problem(scene, goals=[wb.Point("tip", (0.5, 0.5, 0.0))], clearance=0.002)
        answers.append(wb.methods.QP(seed=3).solve(problem))
    assert np.array_equal(answers[0].q, answers[1].q)
    assert np.array_equal(answers[0].q, answers[2].q)
    assert len({(answer.status, answer.iterations) for answer in answers}) == 1


@pytest.mark.parametrize("solver", ["osqp", "daqp", "proxqp"])
def test_every_solver_poses_the_human(solver, honest):
    from wholebody.methods.qp.solvers.registry import solver_names

    if solver not in solver_names():
        pytest.skip(f"{solver} is not installed")
    scene = wb.Scene(wb.load("human")).add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.6, 0.0, 0.72))
    problem = wb.Problem(
        scene, goals=[wb.Point("right_index_tip", (0.5, -0.2, 0.8))], constraints=[wb.Hold("left_foot")],
        clearance=0.002,
    )  # fmt: skip
    method = wb.methods.QP(solver)
    solution = honest(problem, method.solve(problem))
    assert solution.status == "solved"
    assert solution.method == method.name


def test_what_is_no_problem_or_method_is_refused(planar_arm):
    problem = wb.Problem(wb.Scene(planar_arm(LENGTHS)))
    with pytest.raises(wb.InputError, match="not a Problem"):
        wb.solve("reach")
    with pytest.raises(wb.UnknownNameError, match="did you mean qp"):
        wb.solve(problem, "qpp")
    problem.scene.add(wb.Sphere(0.1), name="late", at=(3.0, 0.0, 0.0))
    with pytest.raises(wb.InputError, match="state the problem anew"):
        wb.solve(problem)


def test_one_degree_of_freedom_is_enough(planar_arm):
    goal = (0.4 * np.cos(0.3), 0.4 * np.sin(0.3), 0.0)
    problem = wb.Problem(wb.Scene(planar_arm((0.4,))), goals=[wb.Point("tip", goal)])
    for method in (wb.methods.QP(), wb.methods.QP(measures=False), wb.methods.Newton(), wb.methods.CCD()):
        assert method.solve(problem).q == pytest.approx([0.3], abs=1e-4)


def test_a_start_whose_contacts_cancel_ends_outside(honest):
    """A fork over a plate too thick for it: both prongs push, in opposite directions, and no gradient is left."""
    problem = cases(["cancelling-normals"])[0].question().problem
    assert wb.assess(problem, problem.start).penetration > 0.01
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "unreachable"
    assert solution.assessment.penetration < 1e-5
    assert solution.assessment.goal_error < 0.1201  # pulled back by 12 cm, and no more


def test_an_arm_that_another_configuration_frees_is_not_called_out_of_reach(honest):
    """A witness proves that the goal is within reach; those that begin near the start all end blocked."""
    number, seed = 17, 12
    case = SETS["robot_arm"].make(number, seed)
    proof = wb.assess(case.problem, case.witness)
    assert proof.holds(1e-6)
    assert proof.goal_error < 1e-6
    solution = wb.methods.QP(tolerance=1e-4, time_limit=inf).solve(case.problem)
    assert honest(case.problem, solution, 1e-4).status == "solved"


def test_a_descent_goes_on_to_what_will_stop_it():
    """Beside its own link an arm has one way to less effort, and ends where they touch, not where it begins."""
    figure, _ = known_arm("xarm7")
    home = np.array([-1.694, -1.72, 2.848, 1.932, -0.815, 0.738, -2.533])
    begin = np.array([-1.021, -1.666, 3.871, 1.093, -1.124, -0.426, -0.757])
    goal = wb.Frame("tool", figure.placement(begin, "tool"))
    problem = wb.Problem(wb.Scene(figure), home, goals=[goal]).with_start(begin)
    answer = wb.methods.QP(restarts=0).solve(problem)
    assert answer.solved
    assert answer.assessment.measure < wb.assess(problem, begin).measure - 0.1
    assert answer.assessment.optimality < 1e-3


def behind_a_panel(number):
    """A standing man, a table, a panel, and a place behind it for a fingertip."""
    scene = wb.Scene(wb.load("human", stature=1.75)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.5, 1.2, 0.04)), name="table", at=(0.55, 0.0, 0.78))
    scene.add(wb.Box((0.04, 0.5, 0.5)), name="panel", at=(0.45, -0.1, 1.25))
    places = np.random.default_rng(11).uniform((0.5, -0.3, 0.95), (0.66, 0.12, 1.45), (number, 3))
    goals, feet = [wb.Point("right_index_tip", places[-1])], [wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(scene, goals=goals, constraints=feet, clearance=0.002)


@pytest.mark.parametrize(("seed", "number"), [(0, 21)])
def test_places_behind_a_panel_are_not_called_out_of_reach(seed, number, honest):
    """Random starts alone find none of these, and other seeds reach all: the way leads round the panel's edge."""
    problem = behind_a_panel(number)
    assert honest(problem, wb.solve(problem, wb.methods.QP(seed=seed))).status == "solved"


def test_the_message_says_what_is_known_of_a_goal_that_is_not_met():
    """Nothing reaches a metre above the head; behind the panel no start of one's own finds a way, others do."""
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    far = wb.Problem(wb.Scene(wb.load("human")), goals=[wb.Point("right_palm", (0.0, 0.0, 3.0))], constraints=feet)
    assert wb.solve(far).message.startswith("seems out of reach: nothing is violated")
    short = wb.solve(behind_a_panel(21), wb.methods.QP(restarts=0))
    assert short.status == "unreachable"
    assert short.message.startswith("not found from ")


@pytest.mark.parametrize("programs", [6, 20])
def test_a_descent_that_runs_out_of_programs_ends_on_its_constraints(human: wb.Figure, programs: int) -> None:
    """A wish 3 m away draws two hands that stay together; the posture is nearer to it than the start, and feasible."""
    start = human.with_joints(human.posture("standing"), {"left_elbow_flexion": 1.2, "right_elbow_flexion": 1.2})
    away = (3.0, 0.0, 1.0)
    problem = wb.Problem(
        wb.Scene(human), start, goals=[wb.Relative("left_palm", "right_palm", orientation=False)],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
        measures=[wb.Soft(wb.Point("right_palm", away))],
    )  # fmt: skip
    solution = wb.solve(problem, wb.methods.QP(iterations=programs))
    assert solution.status == "solved"
    before, after = (np.linalg.norm(human.placement(q, "right_palm").translation - away) for q in (start, solution.q))
    assert after < before - 0.1
    apart = [
        human.placement(q, "right_palm").actInv(human.placement(q, "left_palm")).translation
        for q in (start, solution.q)
    ]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-5)


@pytest.mark.parametrize("percentile", [50])
def test_who_takes_a_box_from_the_floor_squats_with_both_knees_outward(percentile: int, honest) -> None:
    """From upright nothing leads down, and other starts end with a knee straight or inward: each person another way."""
    person = wb.load("human", percentile=percentile)
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.30, 0.32, 0.24)), name="box", at=(0.45, 0.0, 0.1205))
    goals = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        goals += [wb.Point(f"{side}_palm", (0.45, 0.1605 * sign, 0.1205))]
        goals += [wb.Axis(f"{side}_palm", (0, 0, 1), direction=(0, -sign, 0), weight=0.1)]
        goals += [wb.Axis(f"{side}_palm", (1, 0, 0), direction=(1, 0, 0), weight=0.1)]
    problem = wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")])
    solution = honest(problem, wb.solve(problem))
    assert solution.status == "solved"
    angles = person.joint_values(solution.q)
    assert min(angles[f"{side}_knee_flexion"] for side in ("left", "right")) > np.radians(60.0)
    assert min(angles[f"{side}_hip_abduction"] for side in ("left", "right")) > np.radians(10.0)
