"""Angles that were meant in degrees are said, wherever postures and descriptions of robots come in."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import wholebody as wb
from wholebody.tracking.loop import FrameLoop

ELBOW = "right_elbow_flexion"
SAID = r"'right_elbow_flexion'.* is 90 rad, far out of its limits; 90 degrees are 1.571"


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


@pytest.fixture(scope="module")
def wrong(scene: wb.Scene) -> np.ndarray:
    q = scene.figure.neutral.copy()
    q[scene.model.joints[scene.figure.joint_id(ELBOW)].idx_q] = 90.0
    return q


def shown(scene: wb.Scene) -> wb.Viewer:
    return wb.Viewer(scene, title="degrees")


@pytest.mark.parametrize(
    "enter",
    [
        lambda scene, q: scene.figure.with_joints(scene.figure.neutral, {ELBOW: 90.0}),
        lambda scene, q: wb.Problem(scene, q),
        lambda scene, q: wb.Problem(scene).with_start(q),
        lambda scene, q: wb.Problem(scene, goals=[wb.Posture(q)]),
        lambda scene, q: wb.assess(wb.Problem(scene), q),
        lambda scene, q: wb.Clip(scene.figure, np.array([scene.figure.neutral, q]), 0.02),
        lambda scene, q: FrameLoop(scene, scene.figure.neutral).frame(q),
        lambda scene, q: scene.figure.reduced("left_arm", q),
        lambda scene, q: wb.methods.QP().tracker(wb.Problem(scene), 0.02).step(q),
        lambda scene, q: wb.methods.Newton().tracker(wb.Problem(scene), 0.02).step(q),
        lambda scene, q: wb.methods.CCD().tracker(wb.Problem(scene), 0.02).step(q),
        lambda scene, q: wb.ergonomics.lift_between(scene.figure, scene.figure.neutral, q),
        lambda scene, q: wb.ergonomics.body_angles(scene.figure, q),
        lambda scene, q: scene.contacts(q),
        lambda scene, q: scene.overlapping(q),
        lambda scene, q: scene.penetration(q),
        lambda scene, q: scene.sweep(scene.figure.neutral, q),
        lambda scene, q: shown(scene).show(q),
        lambda scene, q: shown(scene).play([scene.figure.neutral, q]),
        lambda scene, q: shown(scene).ghosts([q]),
    ],
)
def test_degrees_are_said_where_postures_come_in(scene, wrong, enter):
    with pytest.warns(UserWarning, match=SAID) as told:
        enter(scene, wrong)
    assert any(warning.filename == __file__ for warning in told)  # at the line that is to be mended


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        (lambda: wb.tasks.StepLimit(180.0), r"velocity is 180 rad/s; 180 degrees/s are 3.142"),
        (lambda: wb.tasks.StepLimit(joints={"left_arm": 90.0}), r"left_arm is 90 rad/s"),
        (lambda: wb.tasks.StepLimit(root_turn=90.0), r"root_turn is 90 rad/s"),
        (lambda: wb.motion.MotionBounds(deviation=30.0), r"deviation is 30 rad; 30 degrees are 0.5236"),
    ],
)
def test_degrees_in_settings_are_said(setting, said):
    with pytest.warns(UserWarning, match=said) as told:
        setting()
    assert len(told) == 1


def test_far_out_of_the_limits_is_said_also_where_degrees_would_be(scene):
    with pytest.warns(UserWarning, match=r"is 720 rad, far out of its limits, which are 0 and .* rad"):
        q = scene.figure.with_joints(scene.figure.neutral, {ELBOW: 720.0})
    assert scene.figure.joint_values(q)[ELBOW] == 720.0  # as it was given


def test_postures_may_be_lists(scene, wrong):
    assert not scene.figure.warn_of_angles(scene.figure.neutral.tolist(), "here")
    with pytest.warns(UserWarning, match=SAID):
        assert scene.figure.warn_of_angles(wrong.tolist(), "here")


def test_postures_within_and_a_little_beyond_the_limits_are_not_said(scene):
    figure = scene.figure
    high = figure.model.upperPositionLimit[figure.model.joints[figure.joint_id(ELBOW)].idx_q]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in figure.postures:
            wb.Problem(scene, figure.posture(name))
        beyond = wb.Problem(scene, figure.with_joints(figure.neutral, {ELBOW: high + 0.9}))
    assert figure.joint_values(beyond.start)[ELBOW] == pytest.approx(high + 0.9)


ROBOT = """<robot name="arm"><link name="base"/><link name="tip">
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="{kind}"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/><origin rpy="{rpy}"/>
<limit lower="{low}" upper="{high}" velocity="1" effort="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("rpy", "kind", "low", "said"),
    [
        ("0 90 0", "revolute", -1.0, r"the pitch of <origin> is 90 rad; 90 degrees are 1.571"),
        ("0 0 0", "revolute", -90.0, r"the lower limit is -90 rad; -90 degrees are -1.571"),
    ],
)
def test_degrees_in_the_description_of_a_robot_are_said(tmp_path, rpy, kind, low, said):
    (tmp_path / "arm.urdf").write_text(ROBOT.format(rpy=rpy, kind=kind, low=low, high=1))
    with pytest.warns(UserWarning, match=said) as told:
        wb.load(str(tmp_path / "arm.urdf"))
    assert len(told) == 1


def test_degrees_in_the_limits_of_an_mjcf_are_said(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "arm.xml").write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body name="tip"><joint name="turn" range="-90 1"/>'
        '<geom type="sphere" size="0.1"/></body></worldbody></mujoco>'
    )
    with pytest.warns(UserWarning, match=r"joint 'turn': the lower limit is -90 rad; -90 degrees are -1.571"):
        robot = wb.load(str(tmp_path / "arm.xml"))
    assert robot.limits.lower.tolist() == [-90.0]  # as the file says


def test_turns_without_limits_are_said_beyond_two_turns(tmp_path):
    (tmp_path / "arm.urdf").write_text(ROBOT.format(rpy="0 0 0", kind="continuous", low=0, high=0))
    figure = wb.load(str(tmp_path / "arm.urdf"))
    with pytest.warns(UserWarning, match=r"'turn' is 90 rad; 90 degrees are 1.571"):
        q = figure.with_joints(figure.neutral, {"turn": 90.0})
    assert q == pytest.approx((np.cos(90.0), np.sin(90.0)))
