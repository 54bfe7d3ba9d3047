"""Hips and thighs of the drawn body: as large as people's standing, and as broad as they are on a seat."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from tests.audits.seated_surface import differences, drawn
from wholebody.base.arrays import Array
from wholebody.figures import load
from wholebody.figures.surface.garments import Bone, Turn, halfway, turned

FINE_SURFACES = True

THIGHS: dict[str, tuple[dict[str, Any], float, float]] = {
    "woman": ({"sex": "female"}, 0.781, 0.611),
    "tall light man": ({"sex": "male", "stature": 1.87, "mass": 66.0}, 0.925, 0.524),
}
"""Crotch height and circumference of the thigh, m, of people of ANSUR II of that stature and mass (regression)."""

SPREAD = 0.023
"""Standard deviation of the circumference among people of one stature and mass, m."""


def drawn_at(figure: Any, degrees: dict[str, float]) -> tuple[Array, pin.Data]:
    """Points (n, 3) on the surface of pelvis and left thigh in a posture, and its frames."""
    data = figure.model.createData()
    joints = {f"{side}_{name}": radians(angle) for side in ("left", "right") for name, angle in degrees.items()}
    pin.framesForwardKinematics(figure.model, data, figure.with_joints(pin.neutral(figure.model), joints))
    points = drawn(figure, data)
    return np.concatenate([*points["pelvis"], *points["left_thigh"]]), data


@pytest.mark.parametrize("who", THIGHS)
def test_who_stands_has_the_thighs_and_hips_of_people(who: str) -> None:
    built, crotch, girth = THIGHS[who]
    figure = load("human", **built)
    person = figure.describe().person
    assert person is not None
    points, data = drawn_at(figure, {"hip_abduction": 2.0})
    below = data.oMf[figure.frame_id("left_sole")].translation[2] + crotch - 0.03
    around = points[(abs(points[:, 2] - below) < 0.003) & (points[:, 1] > 0.0), :2]
    assert ConvexHull(around).area == pytest.approx(girth, abs=2.0 * SPREAD)
    hips = points[abs(points[:, 2] - data.oMf[figure.frame_id("left_hip")].translation[2]) < 0.15]
    assert person.size("hip_breadth") < 2.0 * hips[:, 1].max() < person.size("hip_breadth") + 0.025


@pytest.mark.parametrize("who", THIGHS)
def test_who_sits_is_as_broad_as_people_are_on_a_seat(who: str) -> None:
    found = differences(load("human", **THIGHS[who][0]), drawn)
    assert found["hip_breadth_sitting"] == pytest.approx(0.0, abs=12.0)
    assert 0.0 < found["under the seat"] < 20.0
    assert found["popliteal_height"] == pytest.approx(0.0, abs=5.0)
    assert found["buttock_popliteal_length"] == pytest.approx(0.0, abs=12.0)


def test_a_half_bone_slides_by_the_cosine() -> None:
    slide, place = (0.01, 0.02, 0.03), np.array([0.5, 0.0, 1.0])
    bone = Bone("shank", "thigh", None, np.eye(4), np.eye(4), slide)
    for degrees, share in ((0.0, 0.0), (60.0, 0.5), (90.0, 1.0)):
        second = pin.SE3(pin.rpy.rpyToMatrix(0.0, radians(degrees), 0.0), place).homogeneous
        turn = pin.rpy.rpyToMatrix(0.0, radians(0.5 * degrees), 0.0)
        found = halfway(np.eye(4), second, bone)
        np.testing.assert_allclose(found[:3, :3], turn, atol=1e-12)
        np.testing.assert_allclose(found[:3, 3], place + share * turn @ slide, atol=1e-12)
    about = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 1.0), place).homogeneous  # a turn about the limb moves no flesh
    np.testing.assert_allclose(halfway(np.eye(4), about, bone)[:3, 3], place, atol=1e-12)


@pytest.mark.parametrize(("flexion", "abduction"), [(165.0, 15.0), (0.0, 155.0)])
def test_no_flesh_of_a_raised_arm_hangs_below_the_shoulder(flexion: float, abduction: float) -> None:
    """Under the joint there is the arm's radius, cloth, and some of the fold of the armpit."""
    figure = load("human", **THIGHS["tall light man"][0])
    data = figure.model.createData()
    raised = {"shoulder_flexion": flexion, "shoulder_abduction": abduction, "clavicle_elevation": 25.0}
    joints = {f"left_{name}": radians(angle) for name, angle in raised.items()}
    pin.framesForwardKinematics(figure.model, data, figure.with_joints(pin.neutral(figure.model), joints))
    lowest = np.concatenate(drawn(figure, data)["left_upper_arm"])[:, 2].min()
    person = figure.describe().person
    assert person is not None
    below = data.oMf[figure.frame_id("left_shoulder")].translation[2] - lowest
    assert below < person.radius("upper_arm") + 0.03


def test_flesh_of_a_shoulder_swings_with_the_arm_and_does_not_twist() -> None:
    rng, aside = np.random.default_rng(4), (0.0, 0.8, -0.6)
    down = np.array((0.0, 0.0, -1.0))
    for _ in range(20):
        whole = pin.exp3(rng.uniform(-1.5, 1.5, 3))
        about = pin.exp3(rng.uniform(-1.5, 1.5) * down)
        swing = turned(whole, Turn(1.0, 0.0, aside))
        np.testing.assert_allclose(swing @ down, whole @ down, atol=1e-12)  # it points where the arm does
        np.testing.assert_allclose(turned(whole @ about, Turn(1.0, 0.0, aside)), swing, atol=1e-12)
        half = turned(whole, Turn(1.0, 0.5, aside))
        np.testing.assert_allclose(half @ swing.T @ half, whole, atol=1e-9)  # the second half of the twist
        np.testing.assert_allclose(turned(whole, Turn(1.0, 1.0, aside)), whole, atol=1e-12)
    for degrees in (0.0, 70.0, 160.0):  # a swing through the direction aside has no twist
        raised = pin.exp3(np.radians(degrees) * np.array((1.0, 0.0, 0.0)))
        np.testing.assert_allclose(turned(raised, Turn(1.0, 0.0, aside)), raised, atol=1e-9)
