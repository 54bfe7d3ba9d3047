"""placo's answers by the independent assessment, its terms against facts, and what it refuses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.answers import honest
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.methods.placo.robot import Robot

pytest.importorskip("placo", reason="placo is not installed (the extra placo)")


def feet() -> list[wb.Hold]:
    return [wb.Hold("left_foot"), wb.Hold("right_foot")]


def frame_at(figure: wb.Figure, q: Any, name: str) -> pin.SE3:
    return pin.SE3(wb.Scene(figure).state(q).frame(figure.frame_id(name)))


def test_a_reach_over_a_table_is_solved_with_feet_held_and_the_floor_kept(human: wb.Figure) -> None:
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.5, 1.0, 0.04)), name="table", at=(0.5, 0.0, 0.75))
    problem = wb.Problem(
        scene,
        goals=[wb.Point("right_index_tip", (0.45, -0.2, 0.85))],
        constraints=feet(),
        measures=[wb.tasks.Displacement()],  # placo's tasks for joints leave out the root
        clearance=0.003,
    )
    solution = wb.solve(problem, "placo")
    assert solution.solved, solution.message
    assert solution.method == "placo"
    assert honest(problem, solution).least_distance > -1e-5
    assert len(solution.trace) == solution.iterations + 1
    best = wb.methods.QP().solve(problem).assessment.measure
    assert solution.assessment.measure == pytest.approx(best, rel=1e-2)


def test_every_term_that_it_takes_means_what_ours_means(human: wb.Figure) -> None:
    witness = human.with_joints(
        human.neutral, {"right_elbow_flexion": 1.1, "right_shoulder_flexion": 0.5, "left_elbow_flexion": 0.8}
    )
    palm, hand = frame_at(human, witness, "right_palm"), frame_at(human, witness, "left_hand")
    thorax = frame_at(human, witness, "thorax")
    problem = wb.Problem(
        wb.Scene(human),
        goals=[
            wb.Frame("right_palm", palm),
            wb.Point("right_forearm", frame_at(human, witness, "right_forearm").act(np.array([0.0, 0.0, -0.1])),
                     offset=(0.0, 0.0, -0.1)),
            wb.Axis("head", (1.0, 0.0, 0.0), direction=(1.0, 0.2, 0.1)),
            wb.Relative("left_hand", "thorax", thorax.actInv(hand)),
            wb.Orientation("thorax", thorax.rotation),
        ],
        constraints=[
            *feet(), wb.Balance(margin=0.01), wb.Plane("pelvis", (0.0, 1.0, 0.3)), wb.Freeze("right_hip_rotation"),
        ],
        measures=[wb.Effort(), wb.tasks.Displacement(0.1)],
    )  # fmt: skip
    solution = wb.methods.Placo().solve(problem)
    assert solution.solved, solution.message
    honest(problem, solution)
    still = human.dofs(["right_hip_rotation"])
    assert np.abs(pin.difference(human.model, problem.start, solution.q)[still]).max() < 1e-9


def test_center_of_mass_and_posture(human: wb.Figure) -> None:
    scene = wb.Scene(human)
    turned = human.with_joints(human.neutral, {"neck1_rotation": 0.3})
    over = scene.state(human.neutral).center_of_mass() + (0.03, 0.02, 0.0)
    problem = wb.Problem(
        scene,
        goals=[wb.CenterOfMass(over, axes="xy"), wb.Posture(turned, joints=["neck1_rotation"])],
        constraints=feet(),
    )  # fmt: skip
    solution = wb.methods.Placo().solve(problem)
    assert solution.solved, solution.message
    honest(problem, solution)


def test_its_robot_has_our_kinematics_mass_and_distances(human: wb.Figure) -> None:
    scene = wb.Scene(human).add(wb.Box((0.3, 0.3, 0.3)), name="box", at=(0.5, 0.1, 1.0))
    scene.add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, clearance=0.004)
    tip = human.frame_id("right_index_tip")
    frame = human.model.frames[tip]
    robot = Robot(human, {"tip": (frame.parentJoint, frame.placement)})
    robot.add_pieces(problem, wb.methods.Placo().pairs(problem))
    rng = np.random.default_rng(4)
    for _ in range(3):
        q = human.clamp(pin.integrate(human.model, human.neutral, 0.3 * rng.normal(size=human.model.nv)))
        robot.move(q)
        state = scene.state(q)
        assert np.allclose(robot.wrapper.get_T_world_frame("tip"), state.frame(tip).homogeneous, atol=1e-12)
        assert np.allclose(robot.wrapper.com_world(), state.center_of_mass(), atol=1e-12)
        data, placed = human.model.createData(), pin.GeometryData(scene.geometry)
        pin.computeDistances(human.model, data, scene.geometry, placed, q)
        ours = np.array([result.min_distance for result in placed.distanceResults])
        theirs = np.array([distance.min_distance for distance in robot.wrapper.distances()])
        assert np.allclose(theirs + 0.005 + problem.clearances, ours, atol=3e-6)


def test_a_continuous_joint_turns_more_than_once_round_half(root: Any) -> None:
    figure = wb.load(root / "tests/data/arm/arm.urdf")
    witness = pin.integrate(figure.model, figure.neutral, np.array([2.8, 0.6, 0.7, 0.0, 0.5, 0.0]))
    tip = figure.model.names[-1]
    goal = wb.Point(tip, frame_at(figure, figure.clamp(witness), tip).translation)
    problem = wb.Problem(wb.Scene(figure), goals=[goal])
    solution = wb.methods.Placo().solve(problem)
    assert solution.solved, solution.message
    honest(problem, solution)


def test_out_of_reach_by_a_metre_ends_and_is_not_called_solved(planar_arm: Callable[..., wb.Figure]) -> None:
    problem = wb.Problem(
        wb.Scene(planar_arm((0.4, 0.3))), np.array([0.2, 0.9]), goals=[wb.Point("tip", (0.0, 1.7, 0.0))]
    )
    solution = wb.methods.Placo().solve(problem)
    assert solution.status == "unreachable", solution.message
    assert honest(problem, solution).goal_error == pytest.approx(1.0, abs=1e-4)


def test_a_goal_that_is_met_at_the_start_needs_no_program(human: wb.Figure) -> None:
    place = frame_at(human, human.neutral, "right_index_tip").translation
    problem = wb.Problem(wb.Scene(human), goals=[wb.Point("right_index_tip", place)])
    solution = wb.methods.Placo().solve(problem)
    assert solution.solved
    assert solution.iterations == 0
    assert np.array_equal(solution.q, problem.start)


def test_where_placo_finds_no_solution_its_words_are_told(human: wb.Figure) -> None:
    scene = wb.Scene(human).add(wb.Box((0.6, 0.6, 0.6)), name="block", at=(0.0, 0.0, 1.2))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.0))], constraints=feet())
    solution = wb.methods.Placo().solve(problem)
    assert solution.status == "infeasible"
    assert "placo gave up" in solution.message
    assert "nfeasible" in solution.message
    assert np.array_equal(solution.q, human.clamp(problem.start))
    assert honest(problem, solution).penetration > 0.1


def test_an_object_that_moved_is_avoided_where_it_is_now(planar_arm: Callable[..., wb.Figure]) -> None:
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.2))).add(wb.Sphere(0.05), name="ball", at=(3.0, 0.0, 0.0))
    problem = wb.Problem(scene, np.array([0.3, 0.4, 0.4]), goals=[wb.Point("tip", (0.1, 0.7, 0.0))])
    method = wb.methods.Placo()
    first = method.solve(problem)
    assert first.solved, first.message
    elbow = frame_at(scene.figure, first.q, "link2").translation
    scene.move("ball", at=tuple(elbow + (0.03, 0.0, 0.0)))
    second = method.solve(problem)
    assert wb.assess(problem, first.q).penetration > 0.01
    assert honest(problem, second).penetration < 1e-5


@pytest.mark.parametrize(
    ("terms", "word"),
    [
        ({"constraints": [wb.tasks.ReachCones()]}, "ReachCones.*circular"),
        ({"constraints": [wb.Plane("right_hand", (0, 0, 1), side="above")]}, "Plane"),
        ({"goals": [wb.Axis("head", (1, 0, 0), toward=(2, 0, 1))]}, "Axis"),
        ({"measures": [wb.tasks.PotentialEnergy()]}, "PotentialEnergy"),
        ({"measures": [wb.Soft(wb.Point("head", (0.1, 0.0, 1.6)))]}, "Soft.*give way"),
        ({"measures": [wb.Effort(), wb.tasks.Discomfort()]}, r"measures\[1\], Discomfort"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_it_has_no_class_for_is_refused_by_name(human: wb.Figure, terms: dict[str, Any], word: str) -> None:
    problem = wb.Problem(wb.Scene(human), **terms)
    with pytest.raises(InputError, match=word):
        wb.methods.Placo().solve(problem)
    with pytest.raises(InputError, match=word):
        wb.methods.Placo().prepare(problem)


def test_a_ball_joint_is_refused_by_name(free_bodies: Callable[..., wb.Figure]) -> None:
    figure = free_bodies(wb.Sphere(0.1), wb.Sphere(0.1))
    with pytest.raises(InputError, match="free1"):
        wb.methods.Placo().solve(wb.Problem(wb.Scene(figure)))


def test_two_free_roots_move_or_are_frozen() -> None:
    avatar = wb.load("avatar")
    pair = wb.Scene({"anna": avatar, "ben": (avatar, (1.2, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    figure, start = pair.figure, pair.figure.neutral
    away = [figure.placement(start, f"{name}/pelvis") * pin.SE3(np.eye(3), np.full(3, 0.2)) for name in ("anna", "ben")]
    free = [wb.Frame("anna/pelvis", away[0]), wb.Frame("ben/pelvis", away[1])]
    with pytest.warns(UserWarning, match="nothing holds"):
        both = wb.solve(wb.Problem(pair, goals=free, balance=False, range_of_motion=False), "placo")
    assert both.status == "solved", both.message
    reach = wb.Point("ben/left_palm", figure.placement(start, "ben/left_palm").translation + (-0.2, 0.0, 0.3))
    kept = wb.Problem(
        pair, goals=[free[0], reach], constraints=[wb.Freeze("ben/root")], balance=False, range_of_motion=False
    )
    one = wb.solve(kept, "placo")
    assert one.status == "solved", one.message
    assert figure.part("ben", one.q)[:7] == pytest.approx(figure.part("ben", start)[:7], abs=1e-12)


def test_each_of_two_people_keeps_balance_and_a_centre_of_mass_of_one_is_refused(human: wb.Figure) -> None:
    pair = wb.Scene({"anna": human, "ben": (human, (1.5, 0.3, 0.0))}).add(wb.HalfSpace(), name="floor")
    held = [wb.Hold(f"{name}/{side}_foot") for name in ("anna", "ben") for side in ("left", "right")]
    # too far in front and to the side for a person who only stretches an arm
    goals = [wb.Point("anna/right_palm", (0.6, -0.4, 0.9)), wb.Point("ben/right_palm", (2.1, -0.1, 0.9))]
    problem = wb.Problem(pair, goals=goals, constraints=held)
    for kind in ("hard", "soft"):
        solution = wb.solve(problem, wb.methods.Placo(holds=kind))
        assert solution.solved, solution.message
        honest(problem, solution)
        for name in ("anna", "ben"):
            alone, q = wb.Scene(human), pair.figure.part(name, solution.q)
            balance = wb.Balance().resolve(alone, pair.figure.part(name, problem.start))
            assert balance.value(alone.state(q)).min() > 0.03
    loose = wb.solve(wb.Problem(pair, goals=goals, constraints=held, balance=False), "placo")
    assert loose.solved
    assert wb.assess(problem, loose.q).constraint_violation > 0.01  # so balance was no matter of course
    message = wb.methods.Placo().accepts(wb.Problem(pair, goals=[wb.CenterOfMass((1.2, 0.3, 1.0), figure="ben")]))
    assert message is not None
    assert "CenterOfMass (placo" in message
    of_both = wb.CenterOfMass((0.6, 0.15, 0.0), axes="xy")
    assert wb.methods.Placo().accepts(wb.Problem(pair, goals=[of_both], balance=False)) is None


def test_a_program_without_a_solution_is_solved_again_with_soft_holds() -> None:
    """Straight legs: placo finds no step of hard feet that restores what the first one turned."""
    problem, _ = SETS["balance"].pose(1, np.random.default_rng([11, 1]))
    solution = wb.solve(problem, "placo")
    assert solution.solved, solution.message
    honest(problem, solution)
