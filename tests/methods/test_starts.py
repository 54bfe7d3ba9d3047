"""Where starts are, and when ends are alike."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.methods.starts import alike, crouched, hooked_hands, restarts, seated, throughout


@pytest.mark.parametrize(
    ("ends", "told"),
    [
        ([1.0, 1.05], False),
        ([1.0, 1.05, 1.09], True),
        ([1.0, 1.05, 1.2, 1.09], True),
        ([1.0, 1.2, 1.2, 1.2], False),  # the nearest stands alone
    ],
)
def test_three_ends_that_are_the_nearest_and_equally_near_are_alike(ends: list[float], told: bool) -> None:
    assert alike(ends) is told


JOINT = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 0 1"/>{4}</joint>'
LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'


@pytest.fixture
def problem(tmp_path: Path) -> wb.Problem:
    """A joint with limits, one without, and one that stays where it is."""
    links = "".join(f'<link name="{name}"/>' for name in "abcd")
    joints = (
        JOINT.format("limited", "revolute", "a", "b", LIMIT)
        + JOINT.format("endless", "continuous", "b", "c", "")
        + JOINT.format("frozen", "revolute", "c", "d", LIMIT)
    )
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    return wb.Problem(wb.Scene(wb.load(tmp_path / "r.urdf")), constraints=[wb.Freeze("frozen")])


def angles(problem: wb.Problem, starts: Iterable[np.ndarray]) -> np.ndarray:
    return np.array([list(problem.scene.figure.joint_values(q).values()) for q in starts])


def test_each_part_of_a_joints_range_is_seen_once(problem: wb.Problem) -> None:
    with problem.borrow() as workspace:
        found = angles(problem, throughout(problem, workspace.state, problem.start, np.random.default_rng(0), 12))
    parts = np.floor(12 * (found[:, :2] - [-1.0, -np.pi]) / [3.0, 2.0 * np.pi])
    assert np.array_equal(np.sort(parts, axis=0), np.tile(np.arange(12.0)[:, None], 2))
    assert not found[:, 2].any()


def test_a_joint_without_limits_starts_anywhere(problem: wb.Problem) -> None:
    with problem.borrow() as workspace:
        found = angles(problem, restarts(problem, workspace.state, problem.start, np.random.default_rng(0), 120))
    assert found[:, 1].min() < -2.5
    assert found[:, 1].max() > 2.5


def squats(problem: wb.Problem) -> list[np.ndarray]:
    with problem.borrow() as workspace:
        return [*crouched(problem, workspace.state, problem.start)]


def test_who_balances_squats_where_the_start_is_and_looks_where_it_looks() -> None:
    human = wb.load("human")
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    turn = pin.SE3(pin.utils.rotate("z", 2.0), np.array((3.0, -1.0, 0.0)))
    start, expected = human.posture("standing"), human.posture("squatting")
    start[:7] = pin.SE3ToXYZQUAT(turn * pin.XYZQUATToSE3(start[:7]))
    found, *others = squats(wb.Problem(scene, start, constraints=[wb.Stand("floor")]))
    assert len(others) == 7  # where feet slide, turned by 45 degrees each
    held = squats(wb.Problem(scene, start, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")]))
    assert len(held) == 1
    np.testing.assert_allclose(found[7:], expected[7:], atol=1e-9)
    assert pin.XYZQUATToSE3(found[:7]).isApprox(turn * pin.XYZQUATToSE3(expected[:7]), 1e-9)


def test_of_two_people_the_one_who_balances_squats_and_what_is_frozen_stays() -> None:
    scene = wb.Scene({"anna": wb.load("human", sex="female"), "ben": wb.load("human")})
    scene.add(wb.HalfSpace(), name="floor")
    feet = wb.Stand("floor", feet=["anna/left_foot", "anna/right_foot"])
    problem = wb.Problem(scene, constraints=[feet, wb.Freeze("anna/left_arm")])
    found, figure = squats(problem)[0], scene.figure
    np.testing.assert_array_equal(figure.part("ben", found), figure.part("ben", problem.start))
    still = [figure.model.joints[figure.joint_id(name)].idx_q for name in figure.joint_names("anna/left_arm")]
    np.testing.assert_array_equal(found[still], problem.start[still])
    assert figure.joint_values(found)["anna/left_knee_flexion"] > 1.5


def test_nobody_squats_who_sits_kneels_or_holds_on() -> None:
    human = wb.load("human")
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    shanks = ["left_shank", "right_shank"]
    for constraint in (
        wb.Stand("floor", balance=False),
        wb.Stand("floor", feet=shanks, knees=shanks),
        wb.Hold("pelvis"),
    ):
        assert not squats(wb.Problem(scene, constraints=[constraint]))


@pytest.mark.parametrize("ahead", [0.0, 1.0])
def test_who_sits_is_over_the_seat_in_eight_directions_and_what_is_frozen_stays(ahead: float) -> None:
    scene = wb.Scene({"anna": wb.load("human", sex="female"), "ben": wb.load("human")})
    scene.add(wb.Box((0.5, 0.4, 0.05)), name="seat", at=(2.0, 1.0, 0.425))
    problem = wb.Problem(scene, goals=[wb.Sit("seat", pelvis="anna/pelvis", trunk="anna/thorax")])
    stays = wb.Problem(scene, problem.start, goals=problem.goals, constraints=[wb.Freeze("anna/root")])
    with problem.borrow() as workspace:
        found = list(seated(problem, workspace.state, problem.start, ahead))
        frozen = list(seated(stays, workspace.state, problem.start, ahead))
    figure, yaws = scene.figure, set()
    sitting = figure.placement(figure.posture("anna/sitting"), "anna/pelvis")
    for q in found:
        pelvis = figure.placement(q, "anna/pelvis")
        turn = pelvis.rotation @ sitting.rotation.T
        yaws.add(round(float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])))) % 360)
        away = pelvis.translation - (2.0, 1.0, 0.45)
        assert 0.0 < away[2] < 0.12
        assert away[:2] == pytest.approx(ahead * float(np.linalg.norm(away[:2])) * turn[:2, 0], abs=1e-9)
        assert (np.abs(away[:2]) < (0.171, 0.121)).all()  # 80 mm from the edges at least
        at_edge = np.isclose(np.abs(away[:2]), (0.17, 0.12), atol=1e-6).any()
        assert at_edge == (ahead == 1.0)
        for part in ("ben/pelvis", "ben/left_foot"):
            assert figure.placement(q, part).isApprox(figure.placement(problem.start, part), 1e-9)
    assert yaws == set(range(0, 360, 45))
    for q in frozen:
        assert figure.placement(q, "anna/pelvis").isApprox(figure.placement(problem.start, "anna/pelvis"), 1e-9)


def hooked(scene: wb.Scene, hand: str) -> list[np.ndarray]:
    scene.add(wb.Capsule(0.02, 0.3), name="bar", at=(0.4, 0.0, 1.1))
    problem = wb.Problem(scene, goals=[wb.Grasp(hand, "bar", "power")])
    with scene.figure.posed(problem.start) as state:
        return list(hooked_hands(problem, state, problem.start))


def test_hands_of_one_of_several_people_hook_as_those_of_one_alone() -> None:
    """Such starts were refused: 'anna/right' is no side."""
    person = wb.load("human", hands="fingers")
    alone = hooked(wb.Scene(person), "right")
    pair = wb.Scene({"anna": person, "thumbelina": (person, (2.0, 0.0, 0.0))})
    both = hooked(pair, "anna/right")
    assert len(alone) == len(both) == 3
    for one, two in zip(alone, both, strict=True):
        np.testing.assert_allclose(pair.figure.part("anna", two), one, atol=1e-12)


def test_two_people_take_two_chairs() -> None:
    """With one person on a chair at a time no start met half of the goals: the other was said to be out of reach."""
    people = {"anna": wb.load("human", percentile=30), "ben": (wb.load("human", percentile=70), (0.0, -0.9, 0.0))}
    scene = wb.Scene(people).add(wb.HalfSpace(), name="floor")
    for name, y in (("anna", 0.6), ("ben", -0.8)):
        scene.add(wb.Box((0.45, 0.5, 0.05)), name=f"chair of {name}", at=(0.0, y, 0.42))
    goals = [wb.Sit(f"chair of {name}", pelvis=f"{name}/pelvis", trunk=f"{name}/thorax") for name in ("anna", "ben")]
    problem = wb.Problem(scene, goals=goals)
    with problem.borrow() as workspace:
        found = list(seated(problem, workspace.state, problem.start))
    on = [[abs(scene.figure.placement(q, f"{name}/pelvis").translation[1] - y) < 0.05
           for name, y in (("anna", 0.6), ("ben", -0.8))] for q in found]  # fmt: skip
    assert [tuple(each) for each in on] == [(True, False)] * 8 + [(False, True)] * 8 + [(True, True)] * 8
    assert wb.solve(problem).status == "solved"


def test_who_sits_on_a_floor_begins_where_the_start_is() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Sit("floor")])
    with problem.borrow() as workspace:
        assert not list(seated(problem, workspace.state, problem.start))
    found = wb.solve(problem)
    assert found.status == "solved"
    assert np.linalg.norm(found.q[:2] - problem.start[:2]) < 1.0


CART = """<robot name="cart"><link name="ground"/><link name="cart"><inertial><mass value="20"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.3"/><geometry><box size="0.5 0.4 0.5"/></geometry></collision></link><link name="tip"/>
<joint name="drive" type="planar"><parent link="ground"/><child link="cart"/><axis xyz="0 0 1"/></joint>
<joint name="at" type="fixed"><parent link="cart"/><child link="tip"/><origin xyz="0.25 0 0.6"/></joint></robot>"""


@pytest.mark.parametrize("what", ["cart", "hand", "human"])
def test_goals_behind_a_wall_are_found_by_what_moves_freely(tmp_path: Path, what: str) -> None:
    """Starts moved carts and roots by 0.1 m, and a goal 5 m away behind a wall was called unreachable."""
    path = tmp_path / "cart.urdf"
    path.write_text(CART)
    scene = wb.Scene(wb.load(path if what == "cart" else what)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.1, 3.0, 2.5)), name="wall", at=(1.3, 0.0, 1.25))
    frame = {"cart": "tip", "hand": "right_palm", "human": "right_index_tip"}[what]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nothing holds them
        found = wb.solve(wb.Problem(scene, goals=[wb.Point(frame, (5.0, 0.3, 0.6))]))
    assert found.status == "solved", found.message
    assert found.q[0] > 3.0
    assert not scene.penetration(found.q) or scene.penetration(found.q)[0].depth < 1e-4
