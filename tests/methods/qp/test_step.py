"""Tracking step by step: never inside, never out of limits, never faster than allowed, at any length of a step."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.geometry.continuous.sweep import Sweep

CLEARANCE = 0.005
STEPS = {1e-3: 40, 1e-2: 40, 0.1: 30, 1.0: 30}


def follow(problem, method, dt, targets, check):
    """Track goals; `check` sees every posture and the one before it."""
    q, tracker = problem.start, method.tracker(problem, dt)
    for goal in targets:
        problem.retarget([goal])
        step = tracker.step(q)
        assert np.isfinite(step.q).all()
        assert step.velocity == pytest.approx(step.displacement / dt)
        assert step.q == pytest.approx(pin.integrate(problem.scene.model, q, step.displacement), abs=1e-12)
        check(q, step)
        q = step.q
    return q


class Jumping:
    """A goal that jumps a metre, through a millimetre of plate and into a box, for a free body or a fixed arm."""

    def __init__(self, figure, limits=()):
        self.figure, fixed = figure, figure.root == "fixed"
        self.tip = "tip" if fixed else "body0"
        self.scene = wb.Scene(figure).add(wb.Box((0.001, 3.0, 3.0)), name="plate", at=(0.6, 0.0, 0.0))
        self.scene.add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(0.2, 0.5, 0.0))
        start = np.array([0.3, -1.9, -0.5]) if fixed else figure.neutral
        goal = wb.Point(self.tip, (0.3, 0.0, 0.0))
        self.problem = wb.Problem(self.scene, start=start, goals=[goal], constraints=limits, clearance=CLEARANCE)

    def targets(self, steps):
        places = [(0.3, 0.0, 0.0), (1.05, 0.1, 0.0), (0.2, 0.5, 0.0), (1.05, 0.4, 0.0)]
        return [wb.Point(self.tip, place) for place in places for _ in range(steps)]

    def tip_at(self, q):
        return self.scene.state(q).frame(self.figure.frame_id(self.tip)).translation


@pytest.fixture(params=["body", "arm"])
def jumping(request, free_bodies, planar_arm):
    """Return a function: bounds -> the case, free and fixed in turn."""
    body = request.param == "body"

    def make(bounded=False):
        if body:
            limits = [wb.tasks.StepLimit(root_velocity=0.7, root_turn=1.0)] if bounded else []
            return Jumping(free_bodies(wb.Capsule(0.05, 0.2)), limits)
        return Jumping(planar_arm((0.4, 0.4, 0.3)), [wb.tasks.StepLimit(2.0)] if bounded else [])

    return make


@pytest.mark.parametrize(("solver", "dt"), [("osqp", 1e-2), *(("daqp", dt) for dt in STEPS)])
def test_nothing_is_jumped_over_or_entered_at_any_length_of_a_step(jumping, dt, solver, least_distance):
    case = jumping()

    def check(q, step):
        assert case.tip_at(step.q)[0] < 0.6
        assert case.figure.within_limits(step.q)
        assert least_distance(case.scene, step.q) >= 0.0

    follow(case.problem, wb.methods.QP(solver), dt, case.targets(STEPS[dt]), check)


@pytest.mark.parametrize(("solver", "dt"), [("osqp", 1e-2), ("daqp", 1e-3)])
def test_clearance_is_kept_at_the_speeds_people_move_with(jumping, dt, solver, least_distance):
    case = jumping(bounded=True)
    sweep = Sweep(case.scene.model, case.scene.geometry)

    def check(q, step):
        assert least_distance(case.scene, step.q) >= 0.9 * CLEARANCE
        assert sweep.first_contact(q, step.q) is None

    follow(case.problem, wb.methods.QP(solver), dt, case.targets(50), check)


def test_a_person_whose_goals_jump_enters_nothing(least_distance):
    """Two hands sent somewhere else every 20 steps, standing, among a table, a sheet, a ball and a bar."""
    rng = np.random.default_rng(0)
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(offset=-0.003), name="floor")
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.8, 0.0, 0.72))
    scene.add(wb.Box((0.001, 2.0, 2.0)), name="sheet", at=(0.6, 0.0, 1.2))
    scene.add(wb.Sphere(0.1), name="ball", at=(0.3, -0.3, 1.1))
    scene.add(wb.Capsule(0.03, 1.0), name="bar", at=(0.4, 0.45, 1.0))
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    for dt, bounds in ((0.1, [wb.tasks.StepLimit(2.0, root_velocity=0.5, root_turn=1.0)]), (0.01, []), (1.0, [])):
        problem = wb.Problem(scene, constraints=[*holds, *bounds], clearance=CLEARANCE)
        assert least_distance(scene, problem.start) > 0.0
        places = [rng.uniform([-0.2, -0.6, 0.2], [1.0, 0.6, 1.8], (2, 3)) for _ in range(5)]
        q, tracker = problem.start, wb.methods.QP("daqp").tracker(problem, dt)
        for k in range(100):
            right, left = places[k // 20]
            problem.retarget([wb.Point("right_index_tip", right), wb.Point("left_index_tip", left)])
            q = tracker.step(q).q
            assert scene.figure.within_limits(q)
            assert least_distance(scene, q) >= 0.0, (dt, k)


@pytest.mark.parametrize("dt", STEPS)
def test_step_limit_is_velocity_times_dt(free_bodies, planar_arm, dt):
    arm = planar_arm((0.4, 0.4, 0.3))
    limit = wb.tasks.StepLimit(0.7, joints={"turn1": 0.2})
    problem = wb.Problem(
        wb.Scene(arm), start=np.array([0.5, 1.6, 0.3]), goals=[wb.Point("tip", (-0.9, 0.0, 0.0))], constraints=[limit]
    )
    tracker, q, fastest = wb.methods.QP().tracker(problem, dt), problem.start, np.zeros(3)
    for _ in range(30):
        step = tracker.step(q)
        assert (np.abs(step.displacement) <= np.array([0.7, 0.2, 0.7]) * dt + 1e-12).all()
        fastest, q = np.maximum(fastest, np.abs(step.velocity)), step.q
    if dt <= 0.1:
        assert fastest == pytest.approx([0.7, 0.2, 0.7], rel=0.3)  # and it uses what it may

    body = wb.Problem(
        wb.Scene(free_bodies(wb.Sphere(0.1))),
        goals=[wb.Point("body0", (5.0, 3.0, -2.0))],
        constraints=[wb.tasks.StepLimit(root_velocity=0.3, root_turn=0.1)],
    )
    q, tracker = body.start, wb.methods.QP().tracker(body, dt)
    for _ in range(10):
        step = tracker.step(q)
        assert (np.abs(step.displacement[:3]) <= 0.3 * dt + 1e-12).all()
        assert (np.abs(step.displacement[3:]) <= 0.1 * dt + 1e-12).all()
        q = step.q


def test_step_limit_holds_near_joint_limits_and_contacts(planar_arm, least_distance):
    scene = wb.Scene(planar_arm((0.4, 0.4, 0.3), limit=1.0)).add(wb.Sphere(0.2), name="ball", at=(0.6, 0.6, 0.0))
    problem = wb.Problem(
        scene, start=np.array([-0.9, 0.9, 0.9]), goals=[wb.Point("tip", (0.6, 0.6, 0.0))],
        constraints=[wb.tasks.StepLimit(1.0)], clearance=CLEARANCE,
    )  # fmt: skip
    tracker, q = wb.methods.QP().tracker(problem, 0.02), problem.start
    for _ in range(150):
        step = tracker.step(q)
        assert np.abs(step.displacement).max() <= 0.02 + 1e-12
        assert scene.figure.within_limits(step.q)
        assert least_distance(scene, step.q) >= 0.9 * CLEARANCE
        q = step.q


def test_a_goal_within_reach_is_reached_and_kept(planar_arm):
    problem = wb.Problem(
        wb.Scene(planar_arm((0.4, 0.4, 0.3))), start=np.array([0.5, 1.0, 0.3]), goals=[wb.Point("tip", (0.5, 0.6, 0.0))]
    )
    tracker, q = wb.methods.QP().tracker(problem, 0.01), problem.start
    for _ in range(100):
        q = tracker.step(q).q
    assert wb.assess(problem, q).goal_error < 1e-4
    still = tracker.step(q)
    assert np.abs(still.displacement).max() < 1e-3


def test_goals_may_come_and_go_between_steps(planar_arm):
    """One method for goals that change in number and kind, and for two problems on one scene in turn."""
    figure = planar_arm((0.4, 0.4, 0.3))
    scene, method = wb.Scene(figure), wb.methods.QP()
    problems = [wb.Problem(scene, start=np.array([0.5, 1.0, 0.3])) for _ in range(2)]
    trackers = [method.tracker(problem, 0.01) for problem in problems]
    choices = [
        [],
        [wb.Point("tip", (0.3, 0.6, 0.0))],
        [wb.Posture("neutral")],
        [wb.Point("tip", (0.3, 0.6, 0.0)), wb.Point("link1", (0.3, 0.2, 0.0))],
    ]
    q = problems[0].start
    for k in range(16):
        problem = problems[k % 2]
        problem.retarget(choices[(k // 2) % 4])
        step = trackers[k % 2].step(q)
        fresh = method.tracker(problem, 0.01).step(q)
        # a new tracker looks less far than one that has seen a long step, and then goes a part of the way
        assert step.displacement / step.share == pytest.approx(fresh.displacement / fresh.share, abs=1e-7)
        q = step.q


def test_a_tracker_is_kept_from_step_to_step(planar_arm):
    problem = wb.Problem(
        wb.Scene(planar_arm((0.4, 0.4, 0.3))), start=np.array([0.5, 1.0, 0.3]), goals=[wb.Point("tip", (0.5, 0.6, 0.0))]
    )
    tracker, q = wb.methods.QP().tracker(problem, 0.01), problem.start
    closed = []
    for _ in range(10):
        step = tracker.step(q)
        closed.append(set(step.programs))
        q = step.q
    assert all(each == {"active set"} for each in closed)


def test_answers_of_steps_are_kept_when_the_next_step_comes(planar_arm):
    scene = wb.Scene(planar_arm((0.4, 0.4, 0.3))).add(wb.Sphere(0.1), name="ball", at=(0.3, 0.5, 0.0))
    problem = wb.Problem(scene, goals=[wb.Point("tip", (0.3, 0.4, 0.0))])
    tracker, q = wb.methods.QP().tracker(problem, 0.01), problem.start
    steps, copies = [], []
    for _ in range(5):
        steps.append(tracker.step(q))
        copies.append([np.array(part) for part in steps[-1][:3]])
        q = steps[-1].q
    for step, kept in zip(steps, copies, strict=True):
        assert all(np.array_equal(part, copy) for part, copy in zip(step[:3], kept, strict=True))
        assert np.abs(step.displacement).max() > 0.0


def test_moved_objects_count_in_the_next_step(free_bodies, least_distance):
    """A wall that comes nearer pushes the body before it."""
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Box((0.1, 1.0, 1.0)), name="wall", at=(-0.3, 0.0, 0.0))
    problem = wb.Problem(scene, clearance=CLEARANCE)
    tracker, q = wb.methods.QP().tracker(problem, 0.01), problem.start
    for k in range(100):
        scene.move("wall", at=(-0.3 + 0.004 * k, 0.0, 0.0))
        q = tracker.step(q).q
        assert least_distance(scene, q) > 0.0
    assert q[0] == pytest.approx(-0.3 + 0.004 * 99 + 0.15 + CLEARANCE, abs=1e-3)


def test_a_start_inside_gets_out_step_by_step(free_bodies, least_distance):
    scene = wb.Scene(free_bodies(wb.Box((0.1, 0.1, 0.1)))).add(wb.Box((0.5, 0.5, 0.5)), name="thing")
    q = scene.figure.neutral
    q[:3] = 0.2, 0.01, 0.02
    problem = wb.Problem(scene, start=q, clearance=CLEARANCE)
    tracker = wb.methods.QP().tracker(problem, 0.01)
    for _ in range(100):
        q = tracker.step(q).q
    assert least_distance(scene, q) >= 0.99 * CLEARANCE


@pytest.mark.parametrize("dt", [0.0, np.nan])
def test_dt_that_is_no_step_is_refused(planar_arm, dt):
    problem = wb.Problem(wb.Scene(planar_arm((0.4, 0.4))))
    with pytest.raises(wb.InputError, match="dt is"):
        wb.methods.QP().tracker(problem, dt)


def test_a_changed_scene_is_refused_in_the_next_step(planar_arm):
    problem = wb.Problem(wb.Scene(planar_arm((0.4, 0.4))))
    tracker = wb.methods.QP().tracker(problem, 0.01)
    tracker.step(problem.start)
    problem.scene.add(wb.Sphere(0.1), name="late", at=(0.6, 0.0, 0.0))
    with pytest.raises(wb.InputError, match="state the problem anew"):
        tracker.step(problem.start)


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_a_limb_gets_out_of_the_way_of_a_thrown_ball(planar_arm, least_distance, speed):
    """The ball is inside when the frame begins, by up to 50 mm: more than a step may go that looks 60 mm far."""
    dt, radius = 1.0 / 60.0, 0.05
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(radius), name="ball", at=(0.7, -0.6, 0.0))
    problem = wb.Problem(scene, start=np.array([0.0, 0.4, 0.4]), goals=[wb.Point("tip", (0.9, 0.5, 0.0))])
    tracker, q = wb.methods.QP().tracker(problem, dt), problem.start
    for frame in range(int(0.8 / (speed * dt))):
        scene.move("ball", at=(0.7, -0.6 + speed * dt * frame, 0.0))
        q = tracker.step(q).q
        assert least_distance(scene, q) > -2e-4, frame


def test_steps_without_measures_converge_quadratically_and_stay_where_goals_are_met(planar_arm):
    """What a step with measures leaves of a goal is squared by each step without; at the goal nothing moves."""
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.3)))
    start = np.array([0.4, 0.9, 0.3])
    place = scene.state(start).frame(scene.frame_id("tip")).translation + np.array([-0.02, 0.01, 0.0])
    problem = wb.Problem(scene, start, goals=[wb.Point("tip", place)], measures=[wb.tasks.Discomfort()])
    tracker, errors = wb.methods.QP().tracker(problem, 0.02), []
    q = tracker.step(problem.start).q
    for _ in range(4):
        errors.append(float(np.linalg.norm(problem.goals[0].error(scene.state(q)))))
        q = tracker.step(q, measures=False).q
    assert errors[0] > 1e-5
    for before, after in itertools.pairwise(errors[:3]):
        assert after < max(10.0 * before**2, 1e-11)
    assert tracker.step(q, measures=False).displacement == pytest.approx(0.0, abs=1e-9)
    assert np.abs(tracker.step(q).displacement).max() > 1e-3  # with them it goes on along its self-motion
