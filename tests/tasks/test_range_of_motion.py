"""Ranges of motion against the numbers of their sources, and against rotations that are made by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State


def room(figure: wb.Figure, name: str, degrees: Mapping[str, float]) -> float:
    """Degrees to the end of a range where some joints have these angles and the others are at zero."""
    scene = wb.Scene(figure)
    q = figure.with_joints(pin.neutral(figure.model), {joint: math.radians(value) for joint, value in degrees.items()})
    term = wb.tasks.RangeOfMotion([name]).resolve(scene, q)
    return math.degrees(float(term.value(State(figure.model).update(q))[0]))


@pytest.fixture(scope="module")
def man() -> wb.Figure:
    return wb.load("human")


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("sex", "straight", "knee"), [("male", 62.0, 31.0), ("female", 70.0, 20.0)])
def test_hamstrings_end_where_the_straight_leg_raise_does(sex: str, straight: float, knee: float, side: str) -> None:
    figure = wb.load("human", sex=sex)
    hip, name = f"{side}_hip_flexion", f"{side}_hamstrings"
    assert room(figure, name, {hip: straight}) == pytest.approx(0.0, abs=1e-9)
    assert room(figure, name, {hip: 90.0, f"{side}_knee_flexion": knee}) == pytest.approx(0.0, abs=0.2)
    assert room(figure, name, {hip: 90.0}) < -15.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_calf_lets_the_bent_knee_go_farther(man: wb.Figure, side: str) -> None:
    ankle, knee = f"{side}_ankle_dorsiflexion", f"{side}_knee_flexion"
    assert room(man, f"{side}_gastrocnemius", {ankle: 25.0}) == pytest.approx(0.0, abs=1e-9)
    assert room(man, f"{side}_gastrocnemius", {ankle: 38.0, knee: 20.0}) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_extended_hip_takes_flexion_from_the_knee(man: wb.Figure, side: str) -> None:
    hip, knee = f"{side}_hip_flexion", f"{side}_knee_flexion"
    assert room(man, f"{side}_rectus_femoris", {knee: 135.0}) == pytest.approx(0.0, abs=1e-9)
    assert room(man, f"{side}_rectus_femoris", {hip: -15.0, knee: 120.0}) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_inward_rotation_lessens_as_the_arm_is_raised_aside(man: wb.Figure, side: str) -> None:
    """An arm turns inward freely at its side, by 70 degrees abducted by 80, not at all by 120, outward overhead."""
    name, raised, turned = f"{side}_shoulder_twist", f"{side}_shoulder_abduction", f"{side}_shoulder_rotation"
    assert room(man, name, {turned: 70.0}) > 90.0
    assert room(man, name, {raised: 80.0, turned: 70.0}) == pytest.approx(0.0, abs=1e-6)
    assert room(man, name, {raised: 120.0}) == pytest.approx(0.0, abs=1e-6)
    assert room(man, name, {raised: 167.0, turned: -20.0}) < -30.0
    assert room(man, name, {raised: 167.0, turned: -90.0}) > 20.0
    assert room(man, name, {f"{side}_shoulder_flexion": 170.0}) > 50.0


@pytest.mark.parametrize("joint", ["shoulder_flexion", "shoulder_abduction", "shoulder_rotation"])
def test_sides_are_mirror_images(man: wb.Figure, joint: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(5):
        bent = {part: rng.uniform(-60.0, 60.0) for part in (joint, "shoulder_abduction", "clavicle_elevation")}
        left, right = (
            room(man, f"{side}_shoulder_twist", {f"{side}_{part}": value for part, value in bent.items()})
            for side in ("left", "right")
        )
        assert left == pytest.approx(right, abs=1e-9)


def test_twist_is_that_of_the_swing_and_twist_of_the_rotation(man: wb.Figure) -> None:
    """Twice the angle of the quaternion's z and w, seen from the central rotation (Grassia 1998)."""
    part = man.ranges["right_shoulder_twist"]
    scene = wb.Scene(man)
    rng = np.random.default_rng(2)
    for _ in range(20):
        q = pin.integrate(man.model, man.neutral, rng.normal(0.0, 0.5, man.model.nv))
        state = State(man.model).update(q)
        base, limb = (state.frame(man.frame_id(name)).rotation for name in ("thorax", "right_upper_arm"))
        _, _, z, w = pin.Quaternion(part.center.T @ base.T @ limb).coeffs()
        twist = 2.0 * math.atan2(z, w)
        twist -= 2.0 * math.pi * round(twist / (2.0 * math.pi))
        height = -(base.T @ limb)[2, 2]
        lowest, highest = math.cos(math.radians(80.0)), math.cos(math.radians(120.0))
        at_80, at_120 = math.radians(70.0 + 40.85), math.radians(57.67)  # see the next test
        bound = at_80 + (at_120 - at_80) * (height + lowest) / (lowest - highest)
        value = wb.tasks.RangeOfMotion(["right_shoulder_twist"]).resolve(scene, q).value(state)[0]
        assert value == pytest.approx(bound - twist, abs=2e-4)


@pytest.mark.parametrize(("elevation", "excess"), [(80.0, 40.85), (120.0, 57.67)])
def test_planes_of_elevation_differ_by_the_area_between_them(elevation: float, excess: float) -> None:
    """The spherical excess of the triangle of hanging, central and raised arm (Todhunter 1886, article 103)."""
    a, angle = math.tan(math.radians(elevation) / 2.0), math.radians(45.0)
    half = math.atan2(a * math.sin(angle), 1.0 + a * math.cos(angle))
    assert math.degrees(2.0 * half) == pytest.approx(excess, abs=0.01)


def test_neck_has_all_of_its_range_in_one_direction_and_no_more_in_three(man: wb.Figure) -> None:
    ends = ({"neck1_flexion": 40.0, "neck2_flexion": 10.0}, {"neck1_lateral": -45.0}, {"neck2_rotation": 80.0})
    for end in ends:
        assert room(man, "neck", end) == pytest.approx(0.0, abs=1e-9)
    assert room(man, "neck", ends[0] | ends[1] | ends[2]) == pytest.approx(-45.0, abs=1e-9)  # 1 - 3 of half the least
    assert room(man, "neck", {}) == pytest.approx(22.5)
    assert room(man, "neck", {"neck1_flexion": -40.0, "neck2_flexion": -20.0}) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("posture", wb.load("human").postures)
@pytest.mark.parametrize("sex", ["male", "female"])
def test_named_postures_are_within_all_ranges(sex: str, posture: str) -> None:
    figure = wb.load("human", sex=sex)
    q = figure.posture(posture)
    term = wb.tasks.RangeOfMotion().resolve(wb.Scene(figure), q)
    assert term.value(State(figure.model).update(q)).min() > 0.0


def test_locked_joints_keep_their_share(man: wb.Figure) -> None:
    """A figure with straight knees has 62 degrees of hip flexion, one that sits has 62 + 0.9 * 90."""
    standing, sitting = (man.reduced(["right_hip_flexion", "neck1_flexion"], q) for q in ("standing", "sitting"))
    assert set(standing.ranges) == {"right_hamstrings", "right_rectus_femoris", "neck"}
    assert room(standing, "right_hamstrings", {}) == pytest.approx(62.0)
    assert room(sitting, "right_hamstrings", {}) == pytest.approx(62.0 + 81.0)
    assert not wb.load("avatar").ranges


def test_judge_sees_straight_knees(man: wb.Figure) -> None:
    q = man.with_joints(man.neutral, {"left_hip_flexion": math.radians(98.0), "right_hip_flexion": math.radians(98.0)})
    scene = wb.Scene(man)
    assert wb.assess(wb.Problem(scene, q), q).constraint_violation == pytest.approx(math.radians(36.0), abs=1e-9)
    assert wb.assess(wb.Problem(scene, q, range_of_motion=False), q).constraint_violation == 0.0


def test_knees_bend_to_reach_the_floor(man: wb.Figure) -> None:
    goals = [wb.Point(f"{side}_palm", (0.25, y, 0.12)) for side, y in (("left", 0.15), ("right", -0.15))]
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(wb.Scene(man), goals=goals, constraints=feet)
    solution = wb.solve(problem)
    assert solution.status == "solved"
    term = wb.tasks.RangeOfMotion().resolve(problem.scene, problem.start)
    assert term.value(State(man.model).update(solution.q)).min() >= -1e-5
    without = wb.solve(wb.Problem(problem.scene, goals=goals, constraints=feet, range_of_motion=False))
    assert term.value(State(man.model).update(without.q)).min() < -math.radians(5.0)
