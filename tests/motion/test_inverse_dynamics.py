"""Loads of a frame: a box on two feet by hand, and derivatives by finite differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.motion.inverse_dynamics import InverseDynamics, Touches, zero_moment_point

GRAVITY = 9.81

BOX = """<robot name="box"><link name="body"><inertial><mass value="10"/>
<inertia ixx="0.2" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
{feet}</robot>"""
FOOT = """<link name="{side}_foot"><inertial><mass value="{mass}"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.1 0.02"/></geometry></collision></link>
<joint name="{side}_ankle" type="revolute"><parent link="body"/><child link="{side}_foot"/>
<origin xyz="0 {y} -0.5"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="20" velocity="5"/></joint>"""


@pytest.fixture
def box(tmp_path: Path) -> wb.Figure:
    """A body of 10 kg on two feet of 1 kg each, 0.4 m apart, 0.5 m below it."""
    feet = "".join(FOOT.format(side=side, y=y, mass=1.0) for side, y in (("left", 0.2), ("right", -0.2)))
    (tmp_path / "box.urdf").write_text(BOX.format(feet=feet))
    return wb.load(tmp_path / "box.urdf", root="free")


def test_a_box_that_is_pushed_leans_on_one_foot(box: wb.Figure) -> None:
    dynamics = InverseDynamics(box, ("left_foot", "right_foot"), 1.0)
    q, nothing = box.neutral.copy(), np.zeros(box.model.nv)
    q[2] = 0.51
    stand = dynamics.stand(q, [True, True])
    assert stand.height == pytest.approx(0.0, abs=1e-9)
    still = dynamics.loads(q, nothing, nothing, stand)
    np.testing.assert_allclose(still.wrench[:3], [0.0, 0.0, 12.0 * GRAVITY], atol=1e-9)
    np.testing.assert_allclose(zero_moment_point(still.wrench, 0.0), [0.0, 0.0], atol=1e-12)
    # moved sidewards at 3 m/s^2 the zero moment point lags by acceleration times height of the mass over gravity
    a = nothing.copy()
    a[1] = 3.0
    pushed = dynamics.loads(q, nothing, a, stand)
    high = (10.0 * 0.51 + 2.0 * 0.01) / 12.0
    place = zero_moment_point(pushed.wrench, 0.0)
    np.testing.assert_allclose(place, [0.0, -3.0 * high / GRAVITY], atol=1e-9)
    assert dynamics.outside(pushed, stand) == 0.0
    # on the left foot alone, 0.15 to 0.25 m to the left, it is outside by the rest
    one = dynamics.stand(q, [True, False])
    assert dynamics.outside(pushed, one) == pytest.approx(0.15 + 3.0 * high / GRAVITY, abs=1e-6)
    # a foot that hangs bears its own mass, 0.01 m below the ankle; its joint turns about x
    assert dynamics.loads(q, nothing, nothing, one).torque[7] == pytest.approx(0.0, abs=1e-9)


def test_a_frame_in_the_air_has_no_zero_moment_point_outside(box: wb.Figure) -> None:
    dynamics = InverseDynamics(box, ("left_foot", "right_foot"), 1.0)
    nothing = np.zeros(box.model.nv)
    stand = dynamics.stand(box.neutral, [False, False])
    assert dynamics.outside(dynamics.loads(box.neutral, nothing, nothing, stand), stand) == 0.0
    falling = nothing.copy()
    falling[2] = -GRAVITY
    both = dynamics.stand(box.neutral, [True, True])
    assert dynamics.outside(dynamics.loads(box.neutral, nothing, falling, both), both) == 0.0


def test_a_foot_without_width_supports_along_a_line() -> None:
    """A foot that is tilted onto its edge: the distance from it is what the zero moment point is outside by."""
    human = wb.load("human")
    dynamics = InverseDynamics(human, ("left_foot", "right_foot"), 0.8)
    nothing = np.zeros(human.model.nv)
    tilt = pin.Quaternion(pin.rpy.rpyToMatrix(0.35, 0.0, 0.0)).coeffs()
    q = human.posture("standing").copy()
    q[3:7] = tilt
    stand = dynamics.stand(q, [True, False])
    assert len(stand.corners) == 2
    place = pin.centerOfMass(human.model, human.model.createData(), q)[:2]
    way = stand.corners[1] - stand.corners[0]
    share = np.clip((place - stand.corners[0]) @ way / (way @ way), 0.0, 1.0)
    away = float(np.linalg.norm(stand.corners[0] + share * way - place))
    assert away > 0.05
    assert dynamics.outside(dynamics.loads(q, nothing, nothing, stand), stand) == pytest.approx(away, abs=1e-6)


def wandering(figure: wb.Figure, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    q = pin.integrate(figure.model, figure.posture("standing"), 0.05 * random.normal(size=figure.model.nv))
    return q, 0.1 * random.normal(size=figure.model.nv), 0.3 * random.normal(size=figure.model.nv)


def leaning(human: wb.Figure) -> tuple[InverseDynamics, Touches]:
    """A person who may touch something with the right hand, on two points of a slope."""
    hand = human.model.frames[human.frame_id("right_hand")].parentJoint
    points = np.array([[0.4, -0.3, 0.9], [0.45, -0.3, 0.9]])
    touches = Touches(points, np.array([2, 2]), np.tile([-0.6, 0.0, 0.8], (2, 1)))
    return InverseDynamics(human, ("left_foot", "right_foot"), 0.8, [hand]), touches


def test_parts_of_loads_add_up_where_a_hand_bears_too() -> None:
    human = wb.load("human")
    dynamics, touches = leaning(human)
    q, v, a = wandering(human, 3)
    stand = dynamics.stand(q, (True, True), touches).shifted([np.array([0.01, 0.0, 0.0]), np.zeros(3)])
    np.testing.assert_array_equal(stand.points[stand.owner == 2], touches.points)
    np.testing.assert_array_equal(stand.axes[stand.owner == 2], touches.axes)
    whole = dynamics.loads(q, v, a, stand)
    still = dynamics.free_torque(q, 0.0 * v, 0.0 * a)
    parts, wrenches = dynamics.grounded(
        q, np.array([still, dynamics.free_torque(q, v, a) - still]), np.ones(2), stand
    )  # fmt: skip
    assert np.linalg.norm(whole.ground.forces[stand.owner == 2]) > 1.0
    np.testing.assert_allclose(parts.sum(axis=0)[6:], whole.strained[6:], atol=1e-6)
    np.testing.assert_allclose(wrenches.sum(axis=0), whole.wrench, atol=1e-6)


@pytest.mark.parametrize(("feet", "touching"), [((True, False), False), ((False, False), False), ((True, True), True)])
def test_derivatives_are_those_of_finite_differences(feet: tuple[bool, bool], touching: bool) -> None:
    """While the points of the soles stay, and the same edges of friction bear.

    On one foot the ground cannot give all; the least squares then change a little with the centre of mass.
    """
    human = wb.load("human")
    dynamics, touches = leaning(human)
    q, v, a = wandering(human, 3)
    stand = dynamics.stand(q, feet, touches if touching else None)
    found = dynamics.derivatives(q, v, a, stand)
    bears = dynamics.loads(q, v, a, stand).ground.split.any(axis=1)
    step, model = 1e-6, human.model
    checked = 0
    for dof in range(model.nv):
        way = step * np.eye(model.nv)[dof]
        for number, moves in enumerate((
            [(pin.integrate(model, q, sign * way), v, a) for sign in (1, -1)],
            [(q, v + sign * way, a) for sign in (1, -1)],
            [(q, v, a + sign * way) for sign in (1, -1)],
        )):  # fmt: skip
            ends = [dynamics.loads(*one, stand) for one in moves]
            if any((one.ground.split.any(axis=1) != bears).any() for one in ends):
                continue
            checked += 1
            slope = (ends[0].strained - ends[1].strained)[6:] / (2 * step)
            np.testing.assert_allclose(found.torque[number][6:, dof], slope, atol=1e-2 * max(1.0, np.abs(slope).max()))
            if any(feet):
                places = [zero_moment_point(one.wrench, stand.height) for one in ends]
                slope = (places[0] - places[1]) / (2 * step)
                np.testing.assert_allclose(found.place[number][:, dof], slope, atol=1e-5)
    assert checked > 2 * model.nv
