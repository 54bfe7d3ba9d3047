"""Static torques: levers by hand."""

from __future__ import annotations

import pickle
from math import radians

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

GRAVITY = 9.81


@pytest.fixture(scope="module")
def person() -> wb.Figure:
    return wb.load("human")


def test_a_load_in_the_palm_is_its_lever_at_the_elbow(person: wb.Figure) -> None:
    q = person.with_joints(person.posture("standing"), {"left_elbow_flexion": radians(90.0)})
    empty, loaded = (wb.ergonomics.static_torques(person, q, load=load) for load in (0.0, 10.0))
    lever = (person.placement(q, "left_palm").translation - person.placement(q, "left_elbow").translation)[:2]
    added = loaded.torque["left_elbow_flexion"] - empty.torque["left_elbow_flexion"]
    assert added == pytest.approx(5.0 * GRAVITY * np.linalg.norm(lever), rel=0.05)
    assert loaded.share["left_elbow_flexion"] == pytest.approx(loaded.torque["left_elbow_flexion"] / 77.0, rel=1e-6)


def test_a_hanging_arm_needs_nothing_and_a_raised_one_its_weight(person: wb.Figure) -> None:
    q = person.with_joints(person.posture("standing"), {"right_shoulder_flexion": radians(90.0)})
    found = wb.ergonomics.static_torques(person, q)
    assert abs(found.torque["right_shoulder_flexion"]) > 5.0 > abs(found.torque["left_shoulder_flexion"])


def test_on_one_foot_its_ankle_holds_the_whole_body(person: wb.Figure) -> None:
    q = person.with_joints(person.posture("standing"), {"left_knee_flexion": radians(90.0)})
    found = wb.ergonomics.static_torques(person, q).torque
    ankle = person.placement(q, "right_ankle").translation[0]
    data = person.model.createData()
    center = pin.centerOfMass(person.model, data, q)[0]
    first = person.joint_id("right_ankle_dorsiflexion")
    foot = sum(  # its moment about the ankle
        GRAVITY * person.model.inertias[k].mass * ((data.oMi[k] * person.model.inertias[k].lever)[0] - ankle)
        for k in range(first, person.model.njoints)
        if first in person.model.supports[k]
    )
    weight = GRAVITY * pin.computeTotalMass(person.model)
    assert abs(found["right_ankle_dorsiflexion"]) == pytest.approx(abs(weight * (center - ankle) - foot), rel=1e-6)
    assert abs(found["left_ankle_dorsiflexion"]) < 5.0  # it hangs


def test_a_seat_takes_the_legs_out(person: wb.Figure) -> None:
    found = wb.ergonomics.static_torques(person, person.posture("sitting"), seated=True)
    assert not [name for name in found.torque if "knee" in name or "hip" in name]
    assert found.worst[0] in found.share


def test_the_compression_is_that_of_the_load_in_both_hands(person: wb.Figure) -> None:
    q = person.with_joints(person.posture("standing"), {"spine1_flexion": radians(20.0)})
    forces = [wb.Force(f"{side}_palm", (0.0, 0.0, -5.0 * GRAVITY)) for side in ("left", "right")]
    found = wb.ergonomics.static_torques(person, q, load=10.0).compression
    assert found == pytest.approx(wb.ergonomics.back_compression(person, q, forces))


def test_strength_is_that_of_the_figure_and_falls_with_age() -> None:
    """Of the table for women, 106 N m of knee extension; less 7.6 % of it in each ten years from 40 on."""
    woman = wb.load("human", sex="female", stature=1.6)
    knee = woman.model.joints[woman.joint_id("left_knee_flexion")].idx_v
    for age, left in ((None, 1.0), (25, 1.0), (40, 1.0), (60, 0.848)):
        older = wb.load("human", sex="female", stature=1.6, age=age)
        assert -wb.motion.Strength().limits(older)[0][knee] == pytest.approx(106.0 * left)
        assert -wb.motion.Strength(sex="female", age=age).limits(woman)[0][knee] == pytest.approx(106.0 * left)
    assert -wb.motion.Strength(sex="male", age=60).limits(woman)[0][knee] == pytest.approx(168.0 * 0.76)
    with pytest.raises(wb.InputError, match="age"):
        wb.motion.Strength(age=80)


def test_a_weaker_person_needs_a_greater_share(person: wb.Figure) -> None:
    q = person.with_joints(person.posture("standing"), {"left_shoulder_flexion": radians(90.0)})
    man, woman = (
        wb.ergonomics.static_torques(person, q, load=5.0, strength=wb.motion.Strength(5, sex))
        for sex in ("male", "female")
    )
    assert woman.worst[1] > man.worst[1]


def test_who_carries_something_mounted_keeps_sex_and_age() -> None:
    woman = wb.load("human", sex="female", age=60)
    hat = wb.figures.adjustable({"rim": wb.Torus(0.1, 0.01)}, tilt=(-0.1, 0.1))
    wears = woman.mounted(hat, on="head_top", name="hat")
    figures = (wears, pickle.loads(pickle.dumps(wears)), wears.reduced(list(woman.joints)))
    for one in figures:
        limits = wb.motion.Strength().limits(one)[1][one.model.joints[one.joint_id("left_elbow_flexion")].idx_v]
        own = wb.motion.Strength().limits(woman)[1][woman.model.joints[woman.joint_id("left_elbow_flexion")].idx_v]
        assert limits == own
    bare, hatted = (
        wb.ergonomics.static_torques(one, one.posture("standing"), load=20.0).worst for one in (woman, wears)
    )
    assert hatted == (bare[0], pytest.approx(bare[1], rel=0.02))
