"""Planned motions, judged by coal at many postures between the frames, and from the frames alone."""

from __future__ import annotations

import hashlib
import signal
import threading
import time
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits.plan_scenes import SCENES, hand_into_box, person_at_gap
from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.figures.description import Description
from wholebody.figures.figure import Figure
from wholebody.methods.control import BUDGET, within_budget
from wholebody.planning import Pace, Plan
from wholebody.planning.contact_values import ContactValues, joined_contacts
from wholebody.planning.ends import nearer
from wholebody.planning.local_planner import Geodesics
from wholebody.planning.projected_motions import ProjectedMotions
from wholebody.planning.projection_kernel import displace, projected_gauss_seidel
from wholebody.planning.rrt_connect import RRTConnect, Tree
from wholebody.planning.sampling import Sampler
from wholebody.planning.smoothing import length, places, refined, shortcut
from wholebody.planning.tightening import DAMPING, programmed, tighten
from wholebody.planning.timing import Timing
from wholebody.planning.tracked_motions import TrackedMotions
from wholebody.tasks.contact_parts import TermOfParts


def shelf(number: int) -> tuple[wb.Problem, Array]:
    """An arm among things, and a posture that answers its problem."""
    problem = problem_set("arms_among_things").make(number, 0).problem
    return problem, wb.solve(problem).q


Distance = Callable[[wb.Scene, Array], float]


def least_along(scene: wb.Scene, q: Array, distance: Distance) -> float:
    """Least distance of any pair along a motion through postures (n, nq), at three places between two of them."""
    ways = (pin.interpolate(scene.model, *pair, share) for pair in pairwise(q) for share in (0.0, 1.0 / 3.0, 2.0 / 3.0))
    return min(distance(scene, at) for at in ways)


def check(plan: Plan, start: Array, end: Array, pace: Pace) -> None:
    """The ends are pinned, and differences of the frames keep the limits."""
    assert plan.solved, plan.message
    model, q = plan.clip.figure.model, plan.clip.q
    np.testing.assert_allclose(q[0], start, atol=1e-12)
    np.testing.assert_allclose(q[-1], end, atol=1e-12)
    speed = np.array([pin.difference(model, *pair) for pair in pairwise(q)]) / pace.dt
    assert (np.abs(speed) <= 1.001 * pace.fastest(plan.clip.figure)).all()
    rest = np.zeros((1, model.nv))
    assert np.abs(np.diff(np.vstack([rest, speed, rest]), axis=0)).max() / pace.dt <= 1.001 * pace.acceleration


@pytest.mark.parametrize("number", [8, 9])
def test_an_arm_goes_round_what_is_in_the_way(number: int, least_distance: Distance) -> None:
    problem, end = shelf(number)
    scene, pace = problem.scene, Pace(velocity=2.0, acceleration=8.0)
    blocked = scene.sweep(problem.start, end) is not None
    found = wb.plan(scene, problem.start, end, pace=pace)
    check(found, problem.start, end, pace)
    assert (found.message == "the straight motion") == (not blocked)
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6


def test_a_clearance_is_kept_where_the_ends_keep_it(least_distance: Distance) -> None:
    problem, end = shelf(9)
    ends = min(least_distance(problem.scene, q) for q in (problem.start, end))
    asked = min(0.5 * ends, 0.01)
    found = wb.plan(problem.scene, problem.start, end, clearance=asked)
    assert found.solved, found.message
    assert least_along(problem.scene, found.clip.q, least_distance) >= asked - 1e-6


def test_an_arm_plans_with_a_clearance_beyond_the_distance_of_queries() -> None:
    """Pairs that are not near had 20 mm as their bound, which counted as too near for a clearance of that."""
    figure, start = known_arm("panda")
    end = figure.with_joints(start, {"axis1": 0.5})  # no distance changes
    found = wb.plan(wb.Scene(figure), start, end, clearance=0.03)
    check(found, start, end, Pace())
    assert found.message == "the straight motion"


def test_a_person_reaches_through_a_hole_on_its_feet(least_distance: Distance) -> None:
    problem = problem_set("passage").make(3, 0).problem
    scene, figure = problem.scene, problem.scene.figure
    found = wb.plan(scene, problem.start, list(problem.goals), constraints=problem.stated)
    assert found.solved, found.message
    goal = problem.goals[0]
    assert np.linalg.norm(goal.error(scene.state(found.clip.q[-1]))) < 1e-4
    for foot in ("left_foot", "right_foot"):
        places = np.array([figure.placement(q, foot).translation for q in found.clip.q])
        assert np.abs(places - places[0]).max() < 1e-4
    assert least_along(scene, found.clip.q, least_distance) >= -5e-4


class NothingButParts:
    """A local planner by which no two postures are joined, and every path between them is free."""

    searches, tries = 1, 300

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        return []

    def through(self, path: Array) -> list[Array]:
        return list(path[1:])


def test_a_joint_that_turns_back_on_the_way_moves_evenly_though_no_two_postures_are_joined(
    planar_arm: Callable[..., wb.Figure],
) -> None:
    """The shortest path is the straight one of two joints, of which one goes there and back five times."""
    model, share = planar_arm((0.5, 0.5)).model, np.linspace(0.0, 1.0, 41)
    path = list(np.stack([share, 0.5 * np.sin(5.0 * np.pi * share)], axis=1))
    local: Any = NothingButParts()
    found = shortcut(model, path, local, np.random.default_rng(0), partial=True)
    straight = float(np.linalg.norm(path[-1] - path[0]))
    assert length(model, path) > 3.0 * straight
    assert length(model, found) < 1.1 * straight
    np.testing.assert_array_equal([found[0], found[-1]], [path[0], path[-1]])


def test_the_limbs_of_a_body_that_turn_back_on_the_way_move_evenly() -> None:
    """A person goes a metre straight on, and all of it waves: to straighten each joint alone takes a try for each."""
    figure, rng = wb.load("human"), np.random.default_rng(0)
    model, start, path = figure.model, figure.posture("standing"), []
    waving = rng.uniform(0.1, 0.3, model.nv)
    for share in np.linspace(0.0, 1.0, 41):
        away = np.sin(5.0 * np.pi * share) * np.sin(np.pi * share) * waving
        q = np.asarray(pin.integrate(model, start, away))
        q[0] += share
        path.append(q)
    local: Any = NothingButParts()
    asked = iter(range(40))
    local.through = lambda part: [] if next(asked, None) is None else list(part[1:])
    found = shortcut(model, path, local, rng, partial=True)
    assert length(model, path) > 10.0
    assert length(model, found) < 1.5
    np.testing.assert_array_equal([found[0], found[-1]], [path[0], path[-1]])


def test_a_path_to_a_goal_ends_where_this_is_met_near_to_it(planar_arm: Callable[..., wb.Figure]) -> None:
    """Three hinges meet a point in many postures; a path to a far one need not be gone to its end."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3), limit=3.0))
    tip, start = scene.figure.segments[-1], np.array((0.2, 0.3, 0.2))
    far = np.array((1.5, -1.2, -1.0))
    offset = (0.3, 0.0, 0.0)
    at = scene.figure.placement(far, tip).act(np.array(offset))
    problem = wb.Problem(scene, start, goals=[wb.Point(tip, at, offset=offset)])
    with problem.borrow() as workspace:
        found = nearer(
            problem,
            [start, 0.5 * far + 0.5 * start, far],
            Geodesics(problem, workspace),
            Sampler(problem, np.random.default_rng(0)),
        )
    assert length(scene.model, found) < 0.8 * length(scene.model, [start, far])
    np.testing.assert_array_equal(found[0], start)
    end = scene.figure.placement(found[-1], tip).act(np.array(offset))
    np.testing.assert_allclose(end, at, atol=1e-4)


def test_a_path_round_a_ball_is_drawn_tight(free_bodies: Callable[..., wb.Figure], least_distance: Distance) -> None:
    """The shortest one consists of two tangents and an arc, along which nothing turns."""
    figure, far, around = free_bodies(wb.Sphere(0.1)), 1.0, 0.4
    scene = wb.Scene(figure).add(wb.Sphere(around - 0.1), name="ball")
    rng, path = np.random.default_rng(0), []
    for share in np.linspace(0.0, np.pi, 13):
        q = figure.neutral.copy()
        q[:3] = -far * np.cos(share), 0.0, 1.3 * np.sin(share)
        turned = np.asarray(pin.integrate(figure.model, q, np.hstack([np.zeros(3), rng.normal(0.0, 0.3, 3)])))
        path.append(turned if 0.0 < share < np.pi else q)
    problem = wb.Problem(scene, path[0])
    with problem.borrow() as workspace:
        slides = TrackedMotions(problem, workspace)
        found = tighten(figure.model, path, slides.geodesics, slides)
    shortest = 2.0 * np.sqrt(far**2 - around**2) + around * (np.pi - 2.0 * np.arccos(around / far))
    assert length(figure.model, path) > 1.5 * shortest
    assert shortest <= length(figure.model, found) < 1.02 * shortest
    np.testing.assert_array_equal([found[0], found[-1]], [path[0], path[-1]])
    assert least_along(scene, np.array(found), least_distance) >= 0.0


def test_a_path_in_a_plane_beside_the_middle_of_a_ball_is_drawn_tight_and_stays_in_it(
    free_bodies: Callable[..., wb.Figure], least_distance: Distance
) -> None:
    """The shortest one consists of two tangents and an arc of the circle that the plane cuts."""
    figure, far, around, high = free_bodies(wb.Sphere(0.1)), 1.0, 0.4, 0.25
    scene = wb.Scene(figure).add(wb.Sphere(around - 0.1), name="ball")
    rng, path = np.random.default_rng(0), []
    for share in np.linspace(0.0, np.pi, 40):
        q = figure.neutral.copy()
        q[:3] = -far * np.cos(share), 1.1 * np.sin(share) + 0.05 * rng.normal() * np.sin(share), high
        path.append(q)
    ball = next(iter(figure.segments))
    problem = wb.Problem(scene, path[0], constraints=[wb.tasks.Plane(ball, (0.0, 0.0, 1.0))])
    with problem.borrow() as workspace:
        steps = TrackedMotions(problem, workspace)
        steps.admit(path[0])
        steps.admit(path[-1])
        found = tighten(figure.model, path, steps, steps)
    circle = np.sqrt(around**2 - high**2)
    shortest = 2.0 * np.sqrt(far**2 - circle**2) + circle * (np.pi - 2.0 * np.arccos(circle / far))
    assert length(figure.model, path) > 1.3 * shortest
    assert shortest - 1e-3 <= length(figure.model, found) < 1.03 * shortest
    assert np.abs(np.array(found)[:, 2] - high).max() < 5e-5
    assert least_along(scene, np.array(found), least_distance) >= -1e-4


def test_a_path_of_an_arm_whose_tip_is_held_is_drawn_tight(planar_arm: Callable[..., wb.Figure]) -> None:
    """What is held is curved: displacements along its tangents leave it, and are projected."""
    figure = planar_arm((0.5, 0.5, 0.5, 0.5))
    scene, start, tip = wb.Scene(figure), np.array([0.9, -0.7, -0.6, -0.5]), "tip"
    problem = wb.Problem(scene, start, constraints=[wb.Hold(tip, orientation=False)])
    rng, path = np.random.default_rng(1), [start]
    with problem.borrow() as workspace:
        steps = TrackedMotions(problem, workspace)
        steps.admit(start)
        for _ in range(3):
            path += steps.geodesics.towards(path[-1], start + rng.normal(0.0, 0.5, 4))[0]
        found = tighten(figure.model, path, steps.geodesics, steps)
    straight = length(figure.model, [path[0], path[-1]])
    assert length(figure.model, path) > 1.5 * straight
    assert straight <= length(figure.model, found) < 1.15 * straight
    held = figure.placement(start, tip).translation
    missed = [np.linalg.norm(figure.placement(q, tip).translation - held) for q in found]
    assert np.max(missed) < 1e-4


def test_no_motion_is_looked_at_after_the_time_limit(
    planar_arm: Callable[..., wb.Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of somebody who sits each took 40 ms, so that a plan of 4 s took 6."""
    seen, follows = list[bool](), Geodesics.follows

    def late(self: Geodesics, q: Array, there: Array) -> bool:
        seen.append(BUDGET.over)
        while not BUDGET.over:
            pass
        return follows(self, q, there)

    monkeypatch.setattr(Geodesics, "follows", late)
    figure = planar_arm((0.5, 0.5))
    assert not wb.plan(wb.Scene(figure), None, figure.neutral + 1.0, time_limit=0.3).solved
    assert seen == [False]


def test_feet_that_are_held_on_a_floor_let_a_body_move(human: wb.Figure) -> None:
    """Between two postures of a step feet get into the floor by its square, which ends no motion."""
    scene, start, model = wb.Scene(human), human.posture("standing"), human.model
    scene.add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, start, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance()])
    toes = [joint.idx_v for joint, name in zip(model.joints, model.names, strict=True) if "toe" in name]
    rng, followed = np.random.default_rng(0), []
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        local.admit(start)

        def beside(q: Array, by: float) -> Array:
            away = rng.uniform(-by, by, model.nv)
            away[toes], away[2] = 0.0, -abs(away[2])  # a standing body gets no higher
            return local.projected(human.clamp(np.asarray(pin.integrate(model, q, away))))

        for _ in range(40):
            q = beside(start, 0.1)
            there = beside(q, 0.05)
            if local.free(q) and local.free(there):
                followed.append(local.follows(q, there))
    assert len(followed) > 4
    assert all(followed)


def test_a_path_of_a_body_whose_feet_are_held_is_drawn_tight(human: wb.Figure, least_distance: Distance) -> None:
    """What is held is kept by the program to first order; postures that are added to it are joined to the others."""
    scene, start = wb.Scene(human), human.posture("standing")
    scene.add(wb.HalfSpace(), name="floor")
    held = [wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance()]
    problem = wb.Problem(scene, start, constraints=held)
    rng, path = np.random.default_rng(1), [start]
    with problem.borrow() as workspace:
        steps = TrackedMotions(problem, workspace)
        local = steps.geodesics
        steps.admit(start)
        for _ in range(3):
            away = rng.normal(0.0, 0.3, human.model.nv)
            away[:6] = 0.0
            path += local.towards(path[-1], human.clamp(np.asarray(pin.integrate(human.model, start, away))))[0]
        program = programmed(human.model, path, steps, DAMPING)
        found = tighten(human.model, path, local, steps)
        assert all(local.follows(*pair) for pair in pairwise(found))
    assert program is not None
    for q, turn, away in zip(path[1:-1], program.turns[1:-1], program.away, strict=True):
        little = np.asarray(pin.integrate(human.model, q, 1e-4 * (turn.T @ away)))
        moved = [
            np.subtract(*(human.placement(at, f"{side}_foot").translation for at in (q, little)))
            for side in ("left", "right")
        ]
        assert np.abs(moved)[:, :2].max() < 1e-9  # upwards they come back from what they miss
    straight = length(human.model, [path[0], path[-1]])
    assert length(human.model, path) > 1.5 * straight > 0.3
    assert length(human.model, found) < 1.1 * straight
    for foot in ("left_foot", "right_foot"):
        places = [human.placement(q, foot).translation for q in found]
        assert np.ptp(places, axis=0).max() < 1e-4
    assert min(least_distance(scene, q) for q in found) > -1e-4


class HitLate(wb.Goal):
    """A point that is out of reach, during whose first search Ctrl-C is hit."""

    asked = 0

    def error(self, state: Any) -> Array:
        HitLate.asked += 1
        if HitLate.asked == 40:
            signal.raise_signal(signal.SIGINT)
        return np.asarray(state.center_of_mass()[:1] - 9.0)

    def jacobian(self, state: Any) -> Array:
        return np.asarray(state.center_of_mass_jacobian()[:1])


def test_ctrl_c_ends_what_has_many_solves_and_not_one_of_these(planar_arm: Callable[..., wb.Figure]) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.5)))
    HitLate.asked = 0
    with pytest.raises(KeyboardInterrupt):
        wb.plan(scene, None, HitLate(), time_limit=2.0)
    HitLate.asked = 0
    with pytest.raises(KeyboardInterrupt):
        wb.solutions(wb.Problem(scene, goals=[HitLate()]), starts=3)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_path_of_a_turning_body_that_waves_among_nothing_is_drawn_straight(
    free_bodies: Callable[..., wb.Figure],
) -> None:
    """The shortest path goes straight through the world while the body turns evenly; a screw motion is an arc."""
    figure = free_bodies(wb.Sphere(0.1))
    model, ahead = figure.model, np.array((1.0, 0.5, 0.0, 0.0, 0.0, 2.5))
    path = []
    for share in np.linspace(0.0, 1.0, 13):
        line, away = np.asarray(pin.integrate(model, figure.neutral, share * ahead)), np.zeros(6)
        away[[1, 2, 4]] = 0.3 * np.sin(3.0 * np.pi * share)
        path.append(np.asarray(pin.integrate(model, line, away)))
    problem = wb.Problem(wb.Scene(figure), path[0])
    with problem.borrow() as workspace:
        slides = TrackedMotions(problem, workspace)
        found = tighten(model, path, slides.geodesics, slides)
    straight = float(np.hypot(np.linalg.norm(path[-1][:3] - path[0][:3]), 2.5))
    assert length(model, path) > 1.3 * straight
    assert length(model, found) == pytest.approx(straight, rel=1e-3)


def test_a_path_that_is_straight_is_tight_after_few_programs(
    planar_arm: Callable[..., wb.Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rounding makes the foreseen length of some longer, and the same program came again until the time was over."""
    figure, rng, asked = planar_arm((0.5, 0.5, 0.5)), np.random.default_rng(0), list[float]()

    def counted(*of: Any) -> Any:
        asked.append(of[-1])
        assert len(asked) < 100
        return programmed(*of)

    monkeypatch.setattr("wholebody.planning.tightening.programmed", counted)
    for _ in range(10):
        ends = rng.uniform(-1.0, 1.0, (2, 3))
        problem = wb.Problem(wb.Scene(figure), ends[0])
        with problem.borrow() as workspace:
            slides = TrackedMotions(problem, workspace)
            found = tighten(figure.model, list(np.linspace(*ends, 5)), slides, slides)
        assert length(figure.model, found) == pytest.approx(np.linalg.norm(ends[1] - ends[0]), rel=1e-6)
    assert len(asked) <= 20


def test_multipliers_are_those_of_the_complementarity_problem() -> None:
    """Forces and gaps are not negative, and one of the two is zero, which is so of one solution alone."""
    rng = np.random.default_rng(0)
    for rows, freedoms in ((1, 3), (8, 12), (40, 60)):
        derivative, gap = rng.normal(size=(rows, freedoms)), rng.normal(size=rows)
        response, force = derivative @ derivative.T, np.zeros(rows)
        projected_gauss_seidel(response, gap.copy(), force)
        kept = gap + response @ force
        assert (force >= 0.0).all()
        assert kept.min() > -1e-3
        assert np.abs(kept[force > 0.0]).max(initial=0.0) < 1e-3
        assert (force > 0.0).any() == (gap < 0.0).any()


def test_steps_along_things_keep_what_always_holds() -> None:
    """Reach cones are curved, so that steps along them miss them; by as much as frames may, no more."""
    asked = person_at_gap(0)
    problem = wb.Problem(asked.scene, asked.start)
    sampler, missed = Sampler(problem, np.random.default_rng(0)), list[float]()
    with problem.borrow() as workspace:
        steps = TrackedMotions(problem, workspace)
        for _ in range(8):
            way, _ = steps.towards(asked.start, sampler.near(asked.start, 1.0))
            missed += [wb.assess(problem, q).constraint_violation for q in way]
    assert len(missed) > 100
    assert max(missed) < 1e-4


def test_no_corner_of_a_path_is_cut_before_it_is_smoothed(planar_arm: Callable[..., wb.Figure]) -> None:
    model, rng = planar_arm((0.5, 0.5)).model, np.random.default_rng(0)
    path = list(np.cumsum(rng.uniform(-0.1, 0.1, (12, 2)), axis=0))
    found = refined(model, path, 30)
    at = [int(np.flatnonzero((found == q).all(axis=1))[0]) for q in path]
    assert at == sorted(at)
    assert (at[0], at[-1]) == (0, len(found) - 1)
    assert length(model, list(found)) == pytest.approx(length(model, path), rel=1e-9)
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert steps.max() < 2.0 * length(model, path) / 29


def test_between_ends_in_contact_nothing_is_gone_through(
    free_bodies: Callable[..., wb.Figure], least_distance: Distance
) -> None:
    """Two balls touch at both ends, between which the straight motion is 1.5 mm deep."""
    figure = free_bodies(wb.Sphere(0.1))
    scene, angle = wb.Scene(figure).add(wb.Sphere(0.1), name="ball"), 0.1225
    start, end = (
        np.concatenate([[0.2 * np.cos(angle), side * 0.2 * np.sin(angle), 0.0], figure.neutral[3:]])
        for side in (1.0, -1.0)
    )
    problem = wb.Problem(scene, start)
    with problem.borrow() as workspace:
        local = Geodesics(problem, workspace)
        local.admit(start)
        local.admit(end)
        assert not local.joined(start, end, np.inf)
    found = wb.plan(scene, start, end)
    assert found.solved, found.message
    assert least_along(scene, found.clip.q, least_distance) >= -1e-4


def test_a_motion_rests_at_corners_where_curves_fail(
    free_bodies: Callable[..., wb.Figure], monkeypatch: pytest.MonkeyPatch, least_distance: Distance
) -> None:
    """Curves that go through a wall are given up, not the path that goes round it."""

    def straight(model: Any, path: Any, _: Any) -> Array:
        return np.linspace(path[0], path[-1], 20)

    for name in ("refined", "smooth"):
        monkeypatch.setattr(f"wholebody.planning.planner.{name}", straight)
    figure = free_bodies(wb.Sphere(0.1))
    scene = wb.Scene(figure).add(wb.Box((0.1, 2.0, 4.0)), name="wall")
    start, end = (np.concatenate([(x, 0.9, 0.0), figure.neutral[3:]]) for x in (-0.3, 0.3))
    found = wb.plan(scene, start, end)
    check(found, start, end, Pace())
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6
    speed = np.abs(np.diff(found.clip.q[:, :3], axis=0)).max(axis=1)
    assert (speed[1:-1] < 1e-9).any()


def test_the_same_seed_plans_the_same_motion() -> None:
    problem, end = shelf(9)
    first, second = (wb.plan(problem.scene, problem.start, end, seed=4).clip.q for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_no_motion_leads_past_a_wall_that_limits_close_in(planar_arm: Callable[..., wb.Figure]) -> None:
    """A bar turns about one joint, with a post on its circle; limits keep it from going round the other way."""
    scene = wb.Scene(planar_arm((1.0,), limit=3.0))
    scene.add(wb.Sphere(0.2), name="post", at=(0.0, 0.9, 0.0))
    found = wb.plan(scene, np.zeros(1), np.array([2.8]), time_limit=0.3)
    assert not found.solved
    assert found.message == "no motion was found within the time limit"
    assert len(found.clip) == 1
    scene.remove("post")
    assert wb.plan(scene, np.zeros(1), np.array([2.8])).solved


def test_of_several_postures_the_one_that_is_reached_soonest_is_the_end(planar_arm: Callable[..., wb.Figure]) -> None:
    """Behind a post the nearer one is out of reach, and an arm of two links has two answers of a place."""
    scene = wb.Scene(planar_arm((1.0,)))
    start, ends = np.zeros(1), np.array([[-1.5], [1.0]])
    for goal in (ends, list(ends), [list(each) for each in ends]):
        found = wb.plan(scene, start, goal)
        assert found.solved
        assert found.clip.q[-1] == pytest.approx(1.0)
    scene.add(wb.Box((0.1, 0.1, 0.5)), name="post", at=(0.8 * np.cos(0.6), 0.8 * np.sin(0.6), 0.0))
    assert wb.plan(scene, start, ends).clip.q[-1] == pytest.approx(-1.5)
    two = wb.Scene(planar_arm((0.5, 0.5)))
    answers = wb.solutions(wb.Problem(two, goals=[wb.Point("tip", (0.5, 0.5, 0.0))]), apart=0.5)
    found = wb.plan(two, np.array([1.4, -1.4]), answers)
    assert found.solved
    np.testing.assert_allclose(found.clip.q[-1], (0.5 * np.pi, -0.5 * np.pi), atol=1e-4)
    assert wb.plan(two, np.zeros(2), answers[0]).solved
    with pytest.raises(wb.InputError, match=r"plan: at goal\[1\] turn0 is 9, beyond its limits"):
        wb.plan(two, np.zeros(2), [np.ones(2), np.array([9.0, 0.0])])
    with pytest.raises(wb.InputError, match=r"plan: goal has a Soft, and a plan takes no measures; give a posture"):
        wb.plan(two, np.zeros(2), [wb.Point("tip", (0.5, 0.5, 0.0)), wb.Soft(wb.Point("tip", (0.5, 0.5, 0.0)))])


def test_goals_out_of_reach_and_wrong_ends_are_told() -> None:
    problem, end = shelf(8)
    scene = problem.scene
    far = wb.plan(scene, problem.start, wb.Point("tool", (9.0, 0.0, 0.0)))
    assert not far.solved
    assert far.message.startswith("no posture meets the goals")
    human = wb.load("human")
    far_away, feet = wb.Point("left_palm", (9.0, 0.0, 0.0)), [wb.Hold("left_foot"), wb.Hold("right_foot")]
    late = wb.plan(wb.Scene(human), "standing", far_away, constraints=feet, time_limit=0.1)
    assert late.message.startswith("no posture was found in time that meets the goals")
    beyond = np.array(end)
    joint, limit = scene.model.names[1], scene.figure.limits.upper[0]
    beyond[0] = limit + 0.1
    named = rf"plan: at the goal {joint} is {limit + 0.1:.4g}, beyond its limits .* and {limit:.4g}"
    with pytest.raises(wb.InputError, match=named):
        wb.plan(scene, problem.start, beyond)
    with pytest.raises(wb.InputError, match=r"a StepLimit bounds no plan; give pace="):
        wb.plan(scene, problem.start, end, constraints=[wb.tasks.StepLimit(0.5)])
    folded = np.array(end)
    folded[2] = scene.figure.limits.lower[2] - 0.1  # into itself too, as that is beyond
    with pytest.raises(wb.InputError, match=r"plan: at the goal .*, beyond its limits"):
        wb.plan(scene, problem.start, folded)
    scene.add(wb.Sphere(0.2), name="ball", at=scene.figure.placement(problem.start, "tool").translation)
    with pytest.raises(wb.InputError, match=r"plan: at the start .*ball.* overlap by \d+ mm"):
        wb.plan(scene, problem.start, end)
    moved = human.posture("standing").copy()
    moved[0] += 0.3
    with pytest.raises(wb.InputError, match=r"plan: the goal misses Hold\(.*left_foot.*\) by 0\.3"):
        wb.plan(wb.Scene(human), "standing", moved, constraints=feet)


def test_a_half_space_that_is_carried_is_refused(planar_arm: Callable[..., wb.Figure]) -> None:
    """It is endless, so that no part of a turn is short enough to be proven free."""
    figure = planar_arm((0.5, 0.5))
    scene = wb.Scene(figure).attach(wb.HalfSpace(), to=figure.segments[-1], name="plate", at=(0.0, 0.0, -9.0))
    with pytest.raises(wb.InputError, match=r"plan: how much a motion brings .*plate.* has no bound; attach a box"):
        wb.plan(scene, np.zeros(2), np.array([0.2, 0.2]))


def test_the_nearest_posture_of_a_tree_is_that_of_all_differences() -> None:
    rng = np.random.default_rng(0)
    problem, _ = shelf(8)
    figure, shares = problem.scene.figure, rng.uniform(0.1, 1.0, problem.scene.model.nv)
    tree = Tree(figure.model, problem.start, shares)
    drawn = rng.uniform(figure.limits.lower, figure.limits.upper, (200, figure.model.nq))
    for number, q in enumerate(drawn):
        tree.add(q, number - 1)
    at = rng.uniform(figure.limits.lower, figure.limits.upper)
    assert tree.nearest(at) == int(np.argmin(np.linalg.norm(shares * (drawn - at), axis=1)))
    np.testing.assert_array_equal(tree.path(5), drawn[:6])


def test_samples_are_within_limits_and_no_whole_turn_away_where_these_let_them(
    planar_arm: Callable[..., wb.Figure],
) -> None:
    """Of two joints that turn by two turns either way, both sides of a turn are the same posture."""
    figure = planar_arm((0.5, 0.5), limit=4.0 * np.pi)
    sampler = Sampler(wb.Problem(wb.Scene(figure), np.zeros(2)), np.random.default_rng(0))
    at = np.array([3.0, -4.0 * np.pi + 0.1])
    drawn = np.array([sampler.near(at, 1.0) for _ in range(400)])
    assert (np.abs(drawn) <= 4.0 * np.pi).all()
    assert np.abs(drawn[:, 0] - at[0]).max() <= np.pi
    assert np.abs(drawn[:, 1] - at[1]).max() <= 2.0 * np.pi  # a limit is near on one side
    assert np.ptp(drawn[:, 0]) > 6.0
    np.testing.assert_allclose(sampler.turned(at + [2.0 * np.pi, 0.0], at), at, atol=1e-12)


@pytest.mark.parametrize("goal", [4.0, -5.0])
def test_a_goal_for_joint_values_is_met_on_its_own_side_of_a_whole_turn(
    goal: float, planar_arm: Callable[..., wb.Figure]
) -> None:
    scene, wanted = wb.Scene(planar_arm((0.5, 0.5), limit=2.0 * np.pi)), np.array([goal, 0.5])
    found = wb.plan(scene, np.zeros(2), wb.Posture(wanted))
    assert found.solved, found.message
    np.testing.assert_allclose(found.clip.q[-1], wanted, atol=1e-4)


def test_an_end_on_the_other_side_of_a_whole_turn_is_reached_past_a_wall(planar_arm: Callable[..., wb.Figure]) -> None:
    """A post stands on the short way to the point; its posture less a whole turn is free to reach."""
    scene = wb.Scene(planar_arm((1.0,), limit=6.2)).add(wb.Sphere(0.2), name="post", at=(-0.9, 0.0, 0.0))
    tip = scene.figure.segments[-1]
    there = wb.Point(tip, (np.cos(3.8), np.sin(3.8), 0.0), offset=(1.0, 0.0, 0.0))
    found = wb.plan(scene, np.array([2.5]), there)
    assert found.solved, found.message
    assert found.clip.q[-1] == pytest.approx(3.8 - 2.0 * np.pi, abs=1e-4)


TURNTABLE = """<robot name="bar"><link name="base"/>
<link name="bar"><collision><origin xyz="0.5 0 0"/><geometry><box size="0.9 0.05 0.05"/></geometry></collision></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
<limit effort="1" velocity="3"/></joint></robot>"""


def test_a_joint_without_limits_goes_the_long_way_round(tmp_path: Path, least_distance: Distance) -> None:
    """A post stands on the short way, so the bar turns by more than half a turn."""
    path = tmp_path / "bar.urdf"
    path.write_text(TURNTABLE)
    figure = wb.load(path)
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name="post", at=(0.3, 0.8, 0.0))
    end = np.asarray(pin.integrate(figure.model, figure.neutral, np.array([2.5])))
    found = wb.plan(scene, figure.neutral, end)
    check(found, figure.neutral, end, Pace())
    assert found.length == pytest.approx(2.0 * np.pi - 2.5, rel=0.05)
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6


CART = """<robot name="cart"><link name="ground"/>
<link name="base"><collision><geometry><box size="0.5 0.2 0.2"/></geometry></collision></link>
<joint name="move" type="planar"><parent link="ground"/><child link="base"/><axis xyz="0 0 1"/></joint></robot>"""


def test_a_cart_goes_as_far_as_it_goes_and_turns_on_beyond_half_a_turn(tmp_path: Path) -> None:
    path = tmp_path / "cart.urdf"
    path.write_text(CART)
    model = wb.load(path).model
    driven = [np.array((0.0, 0.0, 1.0, 0.0))]
    for _ in range(40):
        driven.append(np.asarray(pin.integrate(model, driven[-1], np.array((0.1, 0.0, 0.14)))))
    found = places(model, driven)
    np.testing.assert_allclose(found[:, 2], 0.14 * np.arange(41), atol=1e-9)
    for q, place in zip(driven, found, strict=True):
        np.testing.assert_allclose(pin.integrate(model, driven[0], place), q, atol=1e-9)
    far = np.asarray(pin.integrate(model, driven[0], np.array((5.0, 0.0, 0.0))))
    np.testing.assert_allclose(places(model, [driven[0], far])[1], (5.0, 0.0, 0.0), atol=1e-12)


def test_a_cart_goes_round_what_stands_between_far_from_the_origin(tmp_path: Path, least_distance: Distance) -> None:
    path = tmp_path / "cart.urdf"
    path.write_text(CART)
    scene = wb.Scene(wb.load(path)).add(wb.Box((0.1, 1.0, 1.0)), name="wall", at=(10.7, 0.0, 0.0))
    start, end = np.array((10.0, 0.0, 1.0, 0.0)), np.array((12.0, 0.75, 0.0, 1.0))
    found = wb.plan(scene, start, end)
    check(found, start, end, Pace())
    assert found.length < 4.0
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6


def test_a_second_free_body_goes_round_a_wall(free_bodies: Callable[..., wb.Figure], least_distance: Distance) -> None:
    figure = free_bodies(wb.Sphere(0.1), wb.Sphere(0.1))
    scene = wb.Scene(figure).add(wb.Box((0.1, 3.0, 3.0)), name="wall")
    start, end = figure.neutral.copy(), figure.neutral.copy()
    start[:3] = end[:3] = -3.0, 0.0, 0.0
    start[7:10], end[7:10] = (0.5, 0.8, 0.0), (-0.5, 0.8, 0.0)
    found = wb.plan(scene, start, end)
    check(found, start, end, Pace())
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6


def test_samples_of_a_ball_joint_turn_about_all_axes() -> None:
    model, geometry = pin.Model(), pin.GeometryModel()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    none = Description(
        groups={}, chains={}, frames=(), segments=(), postures={"neutral": lambda own: pin.neutral(own.model)}
    )
    figure = Figure("ball", model, geometry, "own", none)
    sampler, at = Sampler(wb.Problem(wb.Scene(figure)), np.random.default_rng(0)), pin.Quaternion(pin.exp3(np.ones(3)))
    for spread in (1.0, 0.1):
        turns = np.array([pin.difference(model, at.coeffs(), sampler.near(at.coeffs(), spread)) for _ in range(300)])
        np.testing.assert_allclose(turns.mean(axis=0), 0.0, atol=0.3 * spread)
        assert (np.abs(turns).max(axis=0) > 2.0 * spread).all()
        assert np.linalg.norm(turns, axis=1).max() <= np.pi * spread + 1e-9


class NoTrees(RRTConnect):
    """Trees that never meet."""

    def grow(self, sample: Array) -> list[Array] | None:
        return None


def test_steps_along_a_wall_from_the_end_find_the_way_that_steps_from_the_start_do_not(
    free_bodies: Callable[..., wb.Figure], monkeypatch: pytest.MonkeyPatch, least_distance: Distance
) -> None:
    """A ball behind a wall is drawn along it past its edge; from the other side it is drawn to the wall's middle."""
    monkeypatch.setattr("wholebody.planning.search.RRTConnect", NoTrees)
    figure = free_bodies(wb.Sphere(0.1))
    scene = wb.Scene(figure).add(wb.Box((0.1, 2.0, 4.0)), name="wall")
    beside, behind = np.array((-0.3, 1.2, 0.0)), np.array((0.3, 0.5, 0.0))  # the wall's edge is at y = 1
    start, end = (np.concatenate([at, figure.neutral[3:]]) for at in (beside, behind))
    found = wb.plan(scene, start, end)
    check(found, start, end, Pace())
    assert found.message != "the straight motion"
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6
    assert not wb.plan(scene, end, start, time_limit=0.5).solved


def test_a_hand_that_is_pulled_out_of_a_box_gives_way_to_its_edges(least_distance: Distance) -> None:
    scene, start, inside, _ = hand_into_box(0)
    problem, out = wb.Problem(scene, start), inside - 0.35 * np.eye(len(inside))[0]
    with problem.borrow() as workspace:
        steps = TrackedMotions(problem, workspace)
        steps.admit(inside)
        _, met = steps.towards(inside, out)  # keeps its grip, which is larger than the hole
        pulled = steps.pulled(inside, out)
        _, opened = steps.towards(pulled[-1], np.hstack((pulled[-1][:7], start[7:])))  # by joints again
    assert opened
    assert not met
    assert np.linalg.norm(pulled[-1][:3] - out[:3]) < 0.02
    assert np.linalg.norm(pulled[-1][7:] - inside[7:]) > 0.1
    assert least_along(scene, np.array([inside, *pulled]), least_distance) > 0.0


def test_a_free_root_keeps_to_the_usual_speed(free_bodies: Callable[..., wb.Figure]) -> None:
    """Pinocchio's limit of a free root is the largest number that there is."""
    figure = free_bodies(wb.Box((0.2, 0.2, 0.2)))
    end = figure.neutral.copy()
    end[0] += 10.0
    found = wb.plan(wb.Scene(figure), figure.neutral, end)
    check(found, figure.neutral, end, Pace())
    assert np.abs(np.diff(found.clip.q[:, 0])).max() * 60.0 == pytest.approx(2.0, rel=0.01)


class Slow(wb.tasks.Bound):
    """No freedom moves by more from one frame to the next."""

    def __init__(self, most: float, second: bool) -> None:
        self.most, self.second = most, second  # rad, or rad/s

    def bounds(self, state: Any, dt: float | None) -> tuple[Array, Array]:
        most = np.full(state.model.nv, np.inf if self.second and dt is None else self.most * (dt or 1.0) ** self.second)
        return -most, most


@pytest.mark.parametrize(("most", "second"), [(0.01, False), (0.001, False), (0.5, True)])
def test_a_bound_of_ones_own_limits_the_steps_from_frame_to_frame(most: float, second: bool) -> None:
    scene = wb.Scene(wb.load("hand"))
    found = wb.plan(scene, "open", "grip", constraints=[Slow(most, second)])
    assert found.solved, found.message
    steps = np.diff(found.clip.q, axis=0)
    assert 0.9 * most < np.abs(steps).max() / (found.clip.dt if second else 1.0) <= 1.001 * most


def test_who_may_only_move_slowly_goes_round_a_thing(planar_arm: Any) -> None:
    """Steps of 4 mrad counted as none that get nearer, and no motion was found."""
    scene = wb.Scene(planar_arm([0.3, 0.3])).add(wb.Sphere(0.06), name="ball", at=(0.5, 0.0, 0.0))
    start, end = np.array([-0.6, 0.0]), np.array([0.6, 0.0])
    assert scene.sweep(start, end) is not None
    found = wb.plan(scene, start, end, constraints=[Slow(4e-3, False)])
    assert found.solved, found.message
    assert np.abs(np.diff(found.clip.q, axis=0)).max() <= 1.001 * 4e-3


def test_no_more_frames_are_made_than_there_is_time_to_judge(planar_arm: Any) -> None:
    figure, path = planar_arm([0.3, 0.2]), np.linspace(np.zeros(2), np.ones(2), 20)
    with within_budget(1.0):
        q = Timing(figure, path, Pace(), [Slow(1e-5, False)]).within()
    assert len(q) < 1000


def test_what_is_frozen_stays_and_a_goal_that_moves_it_is_refused() -> None:
    scene = wb.Scene(wb.load("human"))
    figure, given = scene.figure, [wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Freeze("left_arm")]
    start = figure.posture("standing")
    found = wb.plan(scene, start, wb.Point("right_index_tip", (0.3, -0.3, 1.2)), constraints=given)
    assert found.solved, found.message
    frozen = figure.dofs(["left_arm"])
    away = [pin.difference(figure.model, start, q)[frozen] for q in found.clip.q]
    assert np.abs(away).max() < 1e-4
    raised = figure.with_joints(start, {"left_elbow_flexion": 1.0})
    with pytest.raises(wb.InputError, match="frozen"):
        wb.plan(scene, start, raised, constraints=given)


def test_trees_are_grown_where_steps_along_things_are_not_proven_free() -> None:
    """Steps lead an arm out of a shelf, the last of which slides: it was all that was tried, of a tenth of the time."""
    asked = SCENES["shelf"](5)
    found = wb.plan(asked.scene, asked.start, asked.goal)
    assert found.solved, found.message


def test_goals_come_in_any_list() -> None:
    problem, _ = shelf(8)
    assert wb.plan(problem.scene, problem.start, (goal for goal in problem.goals)).solved
    with pytest.raises(wb.InputError, match="goal is empty"):
        wb.plan(problem.scene, problem.start, [])


def test_nothing_is_begun_that_the_time_limit_does_not_let_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that goes on by 10 ms whenever it is looked at is looked at thirteen times after the limit, at most."""
    shown = [0.0]

    def now(clock: str) -> float:
        shown[0] += 0.01 * (clock == "thread_time")
        return shown[0]

    problem = problem_set("passage").make(3, 0).problem
    monkeypatch.setattr("wholebody.methods.control._now", now)
    for limit in (0.0, 0.5, 2.0):
        began = shown[0]
        found = wb.plan(problem.scene, problem.start, list(problem.goals), constraints=problem.stated, time_limit=limit)
        assert not found.solved
        assert shown[0] - began <= max(limit, 0.1) + 0.13 + 1e-9  # rounding


def test_who_is_held_and_stays_has_a_motion_of_no_length(human: wb.Figure) -> None:
    found = wb.plan(wb.Scene(human), "standing", "standing", constraints=[wb.Hold("left_foot")])
    assert found.solved
    assert found.length < 1e-6


def test_time_of_a_plan_is_that_of_its_own_thread(planar_arm: Callable[..., wb.Figure]) -> None:
    """What another thread computes meanwhile is neither limited nor counted."""
    figure, ended = planar_arm((0.5, 0.4)), threading.Event()

    def busy() -> None:
        while not ended.is_set():
            hashlib.sha256(bytes(1_000_000)).digest()  # beside the interpreter's lock

    other = threading.Thread(target=busy)
    wb.plan(wb.Scene(figure), np.zeros(2), np.array((2.0, 1.0)))  # all is compiled
    other.start()
    try:
        began = time.thread_time()
        found = wb.plan(wb.Scene(figure), np.zeros(2), np.array((2.0, 1.0)))
        took = time.thread_time() - began
    finally:
        ended.set()
        other.join()
    assert 0.0 < found.seconds <= took


def test_a_board_turns_to_get_through_a_gap(free_bodies: Callable[..., wb.Figure], least_distance: Distance) -> None:
    """It is wider than the gap and stands across it at both ends, so its root turns on the way."""
    figure = free_bodies(wb.Box((0.1, 0.7, 0.1)))
    scene = wb.Scene(figure)
    for name, y in (("left", 0.85), ("right", -0.85)):
        scene.add(wb.Box((0.1, 1.2, 4.0)), name=name, at=(0.8, y, 0.0))  # the gap is 0.5 m wide
    end = figure.neutral.copy()
    end[0] += 1.6
    found = wb.plan(scene, figure.neutral, end)
    check(found, figure.neutral, end, Pace())
    assert least_along(scene, found.clip.q, least_distance) >= -1e-6


def test_an_iteration_of_a_projection_is_the_least_within_limits() -> None:
    """The pseudo-inverse gives it, and where a joint ends at its limit, that of the other columns."""
    rng = np.random.default_rng(3)
    rows, missed, away = rng.normal(size=(3, 6)), 0.1 * rng.normal(size=3), np.zeros(6)
    none, wide = np.zeros((2, 3)), np.array([[-1.0], [1.0]]) + np.zeros((2, 6))
    assert displace(rows, missed, none, none, wide, away)
    free = -np.linalg.pinv(rows) @ missed
    np.testing.assert_allclose(away, free, atol=1e-6)
    narrow, joint = wide.copy(), int(np.argmax(np.abs(free)))
    narrow[:, joint] *= 0.5 * abs(free[joint])
    assert displace(rows, missed, none, none, narrow, away)
    ends = np.clip(free[joint], *narrow[:, joint])
    others = -np.linalg.pinv(np.delete(rows, joint, axis=1)) @ (missed + rows[:, joint] * ends)
    np.testing.assert_allclose(np.delete(away, joint), others, atol=1e-6)
    assert not displace(rows, np.zeros(3), none, none, wide, away)


def test_a_frame_that_overlaps_leaves_that_and_stays_on_what_is_held(
    free_bodies: Callable[..., wb.Figure], least_distance: Distance
) -> None:
    """Between two postures of a path a frame is 0.3 mm in a wall, and as far off the plane that it is held in."""
    figure = free_bodies(wb.Sphere(0.1))
    scene = wb.Scene(figure).add(wb.Box((0.2, 1.0, 1.0)), name="wall", at=(0.2, 0.0, 0.0))  # up to x = 0.1
    start, body = figure.neutral.copy(), next(iter(figure.segments))
    start[0] = -0.5
    problem = wb.Problem(scene, start, constraints=[wb.tasks.Plane(body, (0.0, 0.0, 1.0), side="on")])
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        frame = start.copy()
        frame[:3] = 3e-4, 0.2, 3e-4
        found = local.corrected(frame)
    assert least_distance(scene, frame) < -2e-4
    assert least_distance(scene, found) > -6e-5
    assert abs(found[2]) < 1e-7
    assert np.linalg.norm(found[:3] - frame[:3]) < 5e-4


@cache
def seated() -> tuple[wb.Problem, Array]:
    """Somebody at a desk with a screen on it, and the posture in which the right hand is behind that."""
    human = wb.load("human", sex="male", percentile=25)
    person = human.describe().person
    assert person is not None
    high = dict(person.dimensions)["popliteal_height"] + person.shoes - 0.01
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.44, 0.48, 0.04)), name="seat", at=(-0.35, 0.0, high - 0.02))
    scene.add(wb.Box((0.03, 0.48, 0.36)), name="backrest", at=(-0.6, 0.0, high + 0.42, 0.0, -0.0697565, 0.0, 0.9975641))
    scene.add(wb.Box((0.7, 1.4, 0.03)), name="desk", at=(0.23, 0.0, high + 0.285))
    scene.add(wb.Box((0.05, 0.55, 0.35)), name="screen", at=(0.15, 0.0, high + 0.48))
    sits: list[Any] = [wb.Sit("seat", back="backrest"), wb.Stand("floor", balance=False)]
    hands = [wb.Point(f"{side}_index_tip", (0.0, y, high + 0.33)) for side, y in (("right", -0.18), ("left", 0.18))]
    q = wb.solve(wb.Problem(scene, "sitting", goals=[*hands, sits[0]], constraints=sits[1:])).q
    q = wb.solve(wb.Problem(scene, q, goals=hands, constraints=sits)).q
    problem = wb.Problem(scene, q, goals=[wb.Point("right_index_tip", (0.22, -0.22, high + 0.45))], constraints=sits)
    answer = wb.solve(problem)
    assert answer.solved
    return problem, answer.q


def test_who_sits_reaches_behind_a_screen(least_distance: Distance) -> None:
    """Of trunk and backrest now one piece touches and now another one, none of which needs room then."""
    problem, end = seated()
    scene, given = problem.scene, problem.stated
    assert scene.sweep(problem.start, end) is not None
    found = wb.plan(scene, problem.start, end, constraints=given)
    check(found, problem.start, end, Pace())
    for q in found.clip.q:
        state = scene.state(q)
        assert max(np.abs(term.value(state)).max() for term in given) <= 1e-4
    assert least_along(scene, found.clip.q, least_distance) >= -5e-4


def test_contact_terms_as_arrays_hold_where_the_terms_do_and_have_the_derivatives_of_their_values() -> None:
    """At postures of a person who sits at a desk, and beside these; ranges are bounds, and their rows no kinks."""
    problem, end = seated()
    rng, model = np.random.default_rng(0), problem.scene.model
    # pieces of the right side come after those of the left
    terms = *problem.constraints, wb.Touch("right_hand", "left_thigh").resolve(problem.scene, problem.start)
    contacts = [term for term in terms if isinstance(term, TermOfParts)]
    with problem.borrow() as workspace:
        (joined,) = (each for each in joined_contacts(terms, workspace) if isinstance(each, ContactValues))
        state = workspace.state
        for size, here in [(0.0, problem.start), (0.0, end), *((0.02, problem.start) for _ in range(5))]:
            q = pin.integrate(model, here, size * rng.normal(size=model.nv))
            values, rows = joined.value_and_jacobian(state.update(q), joined.value)
            missed = np.sort(np.maximum(joined.lower - values, values - joined.upper).clip(min=0.0))
            *others, touch = (np.abs(term.value(state)).max() for term in contacts)
            assert missed[-2:] == pytest.approx(np.sort([max(others), touch]), abs=2e-5, rel=0.01)
            away, step = rng.normal(size=model.nv), 1e-6
            ends = [joined.value(state.update(pin.integrate(model, q, side * step * away))) for side in (1.0, -1.0)]
            wrong = np.abs((ends[0] - ends[1]) / (2.0 * step) - rows @ away)
            # where it rests distances have kinks, as corners of a sole are as deep as others; rows are the slope to one
            assert (wrong < 1e-4).sum() >= len(values) - (0 if size else 5)


def tray(folder: Path) -> wb.Figure:
    """An arm, and a tray that is only drawn."""
    link = """<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
        </inertial><{1}><origin xyz="0 0 {2}" rpy="0 {3} 0"/><geometry><box size="0.1 0.1 0.02"/></geometry></{1}>
        </link>"""
    joint = """<joint name="j{0}" type="revolute"><parent link="base"/><child link="{0}"/><origin xyz="{1} 0 0.3"/>
        <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
    parts = [link.format("base", "collision", -0.3, 0), link.format("arm", "collision", 0.2, 0)]
    parts += [link.format("tray", "visual", 0, 0.3), joint.format("arm", 0), joint.format("tray", 0.5)]
    (folder / "tray.urdf").write_text(f'<robot name="tray">{"".join(parts)}</robot>')
    return wb.load(folder / "tray.urdf")


@pytest.mark.parametrize("face", ["of a point", "only drawn", "of flesh"])
def test_contact_terms_as_arrays_hold_where_the_terms_do_at_faces_of_no_rigid_piece(face: str, tmp_path: Path) -> None:
    """Those of fingertips were an IndexError in a plan; others were taken to be where another piece is."""
    term: Any
    start: Any
    if face == "of a point":
        scene, start, term = wb.Scene(wb.load("human")), "standing", wb.Touch("right_index_tip", "left_index_tip")
    elif face == "only drawn":
        scene, start = wb.Scene(tray(tmp_path)), None
        term = wb.tasks.Lean("tray", part="arm", side=(0.0, 0.0, 1.0))
    else:
        scene = wb.Scene({"one": wb.load("human"), "two": (wb.load("human"), (0.6, 0.1, 0.0))})
        start = scene.figure.posture({"one": "sitting", "two": "standing"})
        term = wb.Sit("two/left_thigh:3", pelvis="one/pelvis", trunk="one/thorax")
    problem = wb.Problem(scene, start, constraints=[term])
    (term,) = (each for each in problem.constraints if isinstance(each, TermOfParts))
    with problem.borrow() as workspace:
        *_, joined = joined_contacts(problem.constraints, workspace)
        state = workspace.state.update(problem.start)
        values = joined.value(state)
        missed = np.maximum(joined.lower - values, values - joined.upper).clip(min=0.0)
        assert np.sort(missed)[-2:] == pytest.approx(np.sort(np.abs(term.value(state)))[-2:], abs=1e-5)


def test_what_a_constraint_lets_touch_needs_no_room() -> None:
    """Postures in which nothing overlaps, and only what sits or stands is nearer to anything than 2 mm, are free."""
    problem, end = seated()
    scene, model, rng, freed = problem.scene, problem.scene.model, np.random.default_rng(0), list[bool]()
    trunk = scene.figure.dofs(scene.figure.groups["spine"])
    touch = {frozenset(pair) for term in problem.stated for pair in term.touching}
    known = {tuple(pair) for at in (problem.start, end) for pair in scene.contacts(at, 2.1e-3).pair.tolist()}
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        local.admit(problem.start)
        local.admit(end)
        for _ in range(200):
            away = np.zeros(model.nv)
            away[trunk] = rng.uniform(-0.15, 0.15, len(trunk))
            q = local.projected(scene.figure.clamp(np.asarray(pin.integrate(model, problem.start, away))))
            near = scene.contacts(q, 2.1e-3)
            owners = [frozenset(scene.piece_owner[k] for k in pair) for pair in near.pair.tolist()]
            others = np.array([pair not in touch for pair in owners])
            if local.met(q) and not near.distance[others].min(initial=1.0) < 2.1e-3 and near.distance.min() > -1e-5:
                anew = not known >= {tuple(pair) for pair in near.pair[near.distance < 1.5e-3].tolist()}
                freed += [local.free(q)] * anew
    assert len(freed) > 2
    assert all(freed)


class Upright(wb.Constraint):
    """The third axis of a frame stays vertical."""

    upper = np.zeros(())

    def __init__(self, frame: str) -> None:
        self.frame = frame

    def resolve(self, scene: wb.Scene, start: Array) -> Upright:
        self.index = scene.model.getFrameId(self.frame)
        return self

    def value(self, state: Any) -> Array:
        return np.array(state.frame(self.index).rotation[:2, 2])

    def jacobian(self, state: Any) -> Array:
        turned = pin.getFrameJacobian(state.model, state.data, self.index, pin.LOCAL_WORLD_ALIGNED)[3:]
        return np.asarray((-pin.skew(state.frame(self.index).rotation[:, 2]) @ turned)[:2])


@pytest.mark.parametrize("seed", [0, 1])
def test_a_level_tool_goes_past_a_box(least_distance: Distance, seed: int) -> None:
    """Every frame is level by the arm's own kinematics, and between frames it is as nearly so."""
    figure, start = known_arm("panda")
    scene = wb.Scene(figure).add(wb.Box((0.25, 0.08, 0.35)), name="box", at=(0.45, 0.0, 0.175))
    held: list[Any] = []
    level, ends, q = wb.Axis("tool", (0, 0, 1), direction=(0, 0, 1)), list[Array](), start
    for side in (0.3, -0.3):
        goals = [wb.Point("tool", (0.45, side, 0.3)), level]
        answer = wb.solve(wb.Problem(scene, q, goals=goals, constraints=held, clearance=0.005))
        assert answer.solved
        ends.append(q := answer.q)
        held = [Upright("tool")]
    assert scene.sweep(*ends) is not None
    found = wb.plan(scene, *ends, constraints=[Upright("tool")], seed=seed)
    assert found.solved, found.message
    for q in found.clip.q:
        assert np.abs(figure.placement(q, "tool").rotation[:2, 2]).max() <= 1e-4
    assert least_along(scene, found.clip.q, least_distance) >= -5e-4


def test_a_tip_is_displaced_and_all_else_follows_on_what_is_held() -> None:
    human = wb.load("human")
    start, scene, tip = human.posture("standing"), wb.Scene(human), "right_index_tip"
    problem = wb.Problem(scene, start, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])
    place = human.placement(start, tip).translation + (0.25, 0.1, -0.35)
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        local.admit(start)
        found = local.reaching(start, tip, place)
    np.testing.assert_allclose(human.placement(found, tip).translation, place, atol=1e-3)
    for side in ("left", "right"):
        apart = human.placement(start, f"{side}_foot").actInv(human.placement(found, f"{side}_foot"))
        np.testing.assert_allclose(apart.homogeneous, np.eye(4), atol=1e-4)
    assert np.abs(pin.difference(human.model, start, found)[:3]).max() > 0.02


def test_a_projection_leaves_what_is_within_the_bounds_of_an_end(planar_arm: Callable[..., wb.Figure]) -> None:
    """A tip is held along x and stays below y, where it is at the start; rows are nearly dependent: it is stretched."""
    arm, start = planar_arm((0.5, 0.5)), np.array([0.78, 0.02])
    place = arm.placement(start, "tip").translation
    problem = wb.Problem(wb.Scene(arm), start, constraints=[Beside(), Below()])
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        local.admit(start)
        for turn in ((2e-4, -2e-4), (-1e-4, 3e-4), (1e-4, -4e-4)):
            beside = start + turn
            miss = abs(arm.placement(beside, "tip").translation[0] - place[0])
            assert miss > 1e-5
            found = local.projected(beside)
            assert np.linalg.norm(found - beside) < 0.03  # 5 mm along y take 0.7 rad
            assert arm.placement(found, "tip").translation[0] == pytest.approx(place[0], abs=2e-5)


def test_steps_that_join_two_postures_end_at_the_second(
    planar_arm: Callable[..., wb.Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps count as there within 1 mrad, and a shortcut to the end of a path must not displace that."""
    problem, end = wb.Problem(wb.Scene(planar_arm((0.5, 0.5)))), np.array([1.0, 0.7])
    monkeypatch.setattr(Geodesics, "joined", lambda *_: [])
    monkeypatch.setattr(TrackedMotions, "towards", lambda *_: ([0.5 * end, end - 5e-4], True))
    with problem.borrow() as workspace:
        slides = TrackedMotions(problem, workspace)
        slides.admit(problem.start)
        np.testing.assert_array_equal(slides.joined(problem.start, end, np.inf)[-1], end)


def test_what_is_near_at_one_end_alone_is_not_passed_through(planar_arm: Callable[..., wb.Figure]) -> None:
    """A tip goes past a ball that it overlaps by 1 mm on the way; sweeps count 0.5 mm."""
    scene = wb.Scene(planar_arm((0.5,))).add(wb.Sphere(0.01), name="ball", at=(0.529, 0.0, 0.0))
    problem = wb.Problem(scene, np.array([-0.02]), constraints=[Flat()])
    assert scene.sweep(problem.start, np.array([0.02]), 5e-4) is not None
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        for q in (problem.start, np.array([1.5])):
            local.admit(q)
        assert not local.follows(problem.start, np.array([0.02]))
        assert local.follows(problem.start, np.array([-0.06]))


class Below(wb.Constraint):
    """The tip goes no farther along y than at the start."""

    lower, upper, axis = np.full(1, -np.inf), np.zeros(1), 1

    def resolve(self, scene: wb.Scene, start: Array) -> Below:
        self.index = scene.model.getFrameId("tip")
        self.place = scene.figure.placement(start, "tip").translation[self.axis]
        return self

    def value(self, state: Any) -> Array:
        return np.array([state.frame(self.index).translation[self.axis] - self.place])

    def jacobian(self, state: Any) -> Array:
        whole = pin.getFrameJacobian(state.model, state.data, self.index, pin.LOCAL_WORLD_ALIGNED)
        return np.asarray(whole[self.axis : self.axis + 1])


class Beside(Below):
    """The tip stays where it is along x."""

    lower, axis = np.zeros(1), 0


class Flat(Below):
    """The tip stays in its plane, as all of it does."""

    lower, axis = np.zeros(1), 2


def test_projected_steps_stay_on_what_is_held_and_end_where_they_should() -> None:
    """Both feet are held, so a raw step of all joints would slide them by centimetres."""
    human = wb.load("human")
    start = human.posture("standing")
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    scene, lower = wb.Scene(human), wb.Point("pelvis", human.placement(start, "pelvis").translation - (0.0, 0.0, 0.1))
    bent = wb.solve(wb.Problem(scene, start, goals=[lower], constraints=feet))
    assert bent.solved
    problem = wb.Problem(scene, start, constraints=feet)
    with problem.borrow() as workspace:
        local = ProjectedMotions(problem, workspace)
        for q in (start, bent.q):
            local.admit(q)
        way, met = local.towards(start, bent.q)
        raw = np.asarray(pin.interpolate(human.model, start, bent.q, 0.5))
    assert met
    assert len(way) > 5
    np.testing.assert_array_equal(way[-1], bent.q)

    def slid(q: Array) -> float:
        feet = [[human.placement(at, f"{side}_foot").translation for side in ("left", "right")] for at in (q, start)]
        return float(np.abs(np.subtract(*feet)).max())

    assert slid(raw) > 1e-3
    assert max(map(slid, way)) <= 2e-5
