"""Torques of clips: statics, flight, a pendulum, momentum and forward dynamics as oracles; strength of people."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.postures import support
from wholebody.figures.strength import Strength
from wholebody.motion.clip_torques import smoothed, torques
from wholebody.motion.inverse_dynamics import ground_forces

GRAVITY = 9.81


def swaying(human: wb.Figure, frames: int = 60, dt: float = 1 / 60) -> wb.Clip:
    """A clip that bends the knees and swings the arms smoothly, both feet near the ground."""
    base = human.posture("standing")
    q = np.tile(base, (frames, 1))
    phase = 2.0 * np.pi * np.arange(frames) * dt
    for name, size in (("left_shoulder_flexion", 0.4), ("right_elbow_flexion", 0.5), ("spine2_lateral", 0.1)):
        joint = human.model.joints[human.joint_id(name)]
        q[:, joint.idx_q] += size * (1.0 - np.cos(phase))
    q[:, 2] -= 0.004 * (1.0 - np.cos(phase))
    return wb.Clip(human, q, dt, "swaying")


def test_somebody_who_stands_still_weighs_what_he_weighs(human: wb.Figure) -> None:
    found = torques(wb.Clip(human, np.tile(human.posture("standing"), (5, 1)), 0.1))
    mass = sum(inertia.mass for inertia in human.model.inertias[1:])
    center = pin.centerOfMass(human.model, human.model.createData(), human.posture("standing"))
    np.testing.assert_allclose(found.force.sum(axis=1), np.tile([0.0, 0.0, GRAVITY * mass], (5, 1)), atol=0.01)
    np.testing.assert_allclose(found.center_of_pressure[:, :2], np.tile(center[:2], (5, 1)), atol=1e-5)
    assert np.abs(found.missing).max() < 0.01
    assert found.supported.all()


def test_torques_bear_the_part_of_the_body_beyond_the_joint(human: wb.Figure) -> None:
    q = human.posture("standing").copy()
    joint = human.model.joints[human.joint_id("left_elbow_flexion")]
    q[joint.idx_q] = np.pi / 2.0
    found = torques(wb.Clip(human, np.tile(q, (3, 1)), 0.1))
    data = human.model.createData()
    pin.centerOfMass(human.model, data, q, np.zeros(human.model.nv), np.zeros(human.model.nv))
    number = human.joint_id("left_elbow_flexion")
    arm = data.mass[number] * GRAVITY * (data.oMi[number].act(data.com[number]) - data.oMi[number].translation)[0]
    axis = data.oMi[number].rotation @ np.array([0.0, -1.0, 0.0])
    assert found.torque[1, joint.idx_v] == pytest.approx(arm * -axis[1], rel=1e-6)
    assert arm > 1.0


def test_forces_of_the_ground_change_the_momentum(human: wb.Figure) -> None:
    clip = swaying(human)
    found = torques(clip, cutoff=None)
    data = human.model.createData()
    mass = pin.computeTotalMass(human.model)
    centers = np.array([pin.centerOfMass(human.model, data, q).copy() for q in clip.q])
    acceleration = (centers[2:] - 2.0 * centers[1:-1] + centers[:-2]) / clip.dt**2
    wanted = mass * (acceleration + [0.0, 0.0, GRAVITY])
    given = found.force.sum(axis=1) + found.missing[:, :3]
    np.testing.assert_allclose(given[1:-1], wanted, atol=0.003 * mass * GRAVITY)


def test_forward_dynamics_gives_the_motion_back(human: wb.Figure) -> None:
    clip = swaying(human)
    found = torques(clip, cutoff=None)
    assert np.abs(found.missing).max() < 0.01
    v, a = clip.velocities(), clip.accelerations()
    data = human.model.createData()
    for k in (5, 20, 44):
        pin.forwardKinematics(human.model, data, clip.q[k])
        outer = pin.StdVec_Force([pin.Force.Zero() for _ in human.model.joints])
        for number, foot in enumerate(found.feet):
            force, at = found.force[k, number], found.pressure[k, number]
            joint = human.model.frames[human.frame_id(foot)].parentJoint
            turning = found.moment[k, number] + np.cross(at, force)
            outer[joint] = data.oMi[joint].actInv(pin.Force(force, turning))
        torque = found.torque[k].copy()
        torque[:6] = 0.0
        gained = pin.aba(human.model, data, clip.q[k], v[k], torque, outer)
        np.testing.assert_allclose(gained, a[k], atol=0.01)


def leaning(human: wb.Figure) -> tuple[wb.Clip, wb.Scene]:
    """Somebody who leans forward by 0.3 rad about the ankles, with both hands just above a box."""
    q = human.posture("arms_forward").copy()
    heel = human.placement(q, "left_heel").translation.copy()
    turn = pin.SE3(pin.utils.rotate("y", 0.3), np.zeros(3))
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(np.eye(3), heel) * turn * pin.SE3(np.eye(3), -heel) * pin.XYZQUATToSE3(q[:7]))
    for side in ("left", "right"):
        q = human.with_joints(
            q,
            {
                f"{side}_ankle_dorsiflexion": q[human.model.joints[human.joint_id(f"{side}_ankle_dorsiflexion")].idx_q]
                + 0.2
            },
        )
    state = wb.Scene(human).state(q)
    low = min(
        support(piece.geometry, state.data.oMi[piece.parentJoint] * piece.placement, np.array([0.0, 0.0, -1.0])) * -1.0
        for piece in human.geometry.geometryObjects
        if piece.name.startswith("left_hand") or "left_palm" in piece.name
    )
    scene = wb.Scene(human).add(wb.Box((0.6, 1.2, 0.1)), name="box", at=(0.9, 0.0, low - 0.051))
    return wb.Clip(human, np.tile(q, (3, 1)), 0.1, "leaning"), scene


def test_hands_on_a_box_bear_a_part_and_the_feet_the_rest(human: wb.Figure) -> None:
    clip, scene = leaning(human)
    alone, found = torques(clip), torques(clip, scene)
    assert alone.feet == ("left_foot", "right_foot") == found.feet[:2]
    hands = [k for k, name in enumerate(found.feet) if k > 1]
    assert hands
    assert found.stands[1, hands].any()
    weight = GRAVITY * pin.computeTotalMass(human.model)
    assert alone.outside[1] > 0.02  # the centre of mass is before the toes
    assert np.linalg.norm(alone.missing[1]) > 20.0
    np.testing.assert_allclose(found.force[1].sum(axis=0), [0.0, 0.0, weight], atol=0.02 * weight)
    assert np.linalg.norm(found.missing[1]) < 0.02 * weight
    assert found.outside[1] < 1e-3
    assert found.force[1, hands, 2].sum() > 0.05 * weight
    # at rest under torques, weight and these forces: forward dynamics gives no acceleration
    data, none = human.model.createData(), np.zeros(human.model.nv)
    pin.forwardKinematics(human.model, data, clip.q[1])
    outer = pin.StdVec_Force([pin.Force.Zero() for _ in human.model.joints])
    for number, name in enumerate(found.feet):
        force, at = found.force[1, number], found.pressure[1, number]
        joint = human.model.frames[human.frame_id(name)].parentJoint
        outer[joint] += data.oMi[joint].actInv(pin.Force(force, found.moment[1, number] + np.cross(at, force)))
    torque = found.torque[1].copy()
    torque[:6] -= data.oMi[1].actInv(pin.Force(np.zeros(6))).vector
    np.testing.assert_allclose(pin.aba(human.model, data, clip.q[1], none, torque, outer), 0.0, atol=1e-6)


def test_what_hands_bear_counts_where_a_clip_is_freed_within_strength(human: wb.Figure) -> None:
    clip, scene = leaning(human)
    loads = wb.avoid(clip, scene, dynamics=True).report.loads
    assert loads is not None
    found = torques(clip, scene)
    assert loads.before.feet == found.feet != ("left_foot", "right_foot")
    np.testing.assert_array_equal(loads.before.torque, found.torque)
    assert loads.after.outside.max() < 1e-3  # on feet alone the person would fall
    assert not loads.missed


def test_a_hand_at_a_wall_is_pushed_out_of_it(human: wb.Figure) -> None:
    """Two points that bear: the ground below, and a wall before it, which pushes back along its normal."""
    points, ways = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    found = ground_forces(np.array([-50.0, 0.0, 600.0, 0.0, 0.0, 0.0]), np.array([0.2, 0.0, 0.9]), points, 0.5, ways)
    normal = np.einsum("ij,ij->i", found.forces, ways)
    across = np.linalg.norm(found.forces - normal[:, None] * ways, axis=1)
    assert (normal >= 0.0).all()
    assert normal[1] > 10.0
    assert (across <= 0.5 * normal + 1e-9).all()


def test_nothing_pushes_somebody_who_flies(human: wb.Figure) -> None:
    t = np.arange(20) / 100.0
    q = np.tile(human.posture("standing"), (20, 1))
    q[:, 2] += 1.0 + 2.0 * t - 0.5 * GRAVITY * t**2
    q[:, 0] += 3.0 * t
    found = torques(wb.Clip(human, q, 0.01), cutoff=None)
    assert not found.supported.any()
    assert np.abs(found.missing).max() < 1e-6
    assert np.abs(found.torque).max() < 1e-6
    assert not found.force.any()


def test_what_the_ground_cannot_give_is_said(human: wb.Figure) -> None:
    q = np.tile(human.posture("standing"), (60, 1))
    q[20:40, 2] += 0.3  # hovers
    found = torques(wb.Clip(human, q, 0.01), cutoff=None)
    assert found.supported[[5, 30, 55]].tolist() == [True, False, True]
    assert found.missing[30, 2] == pytest.approx(GRAVITY * pin.computeTotalMass(human.model), rel=1e-6)
    assert "the ground cannot give" in str(found)


PENDULUM = """<robot name="pendulum"><link name="base"/>
<link name="one"><inertial><origin xyz="0 0 -0.3"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="two"><inertial><origin xyz="0 0.05 -0.2"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="b" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0 0 -0.6"/><axis xyz="0.6 0.8 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>"""


def test_a_pendulum_that_swings_freely_needs_no_torque(tmp_path: Path) -> None:
    (tmp_path / "pendulum.urdf").write_text(PENDULUM)
    arm = wb.load(tmp_path / "pendulum.urdf")
    model = arm.model
    q, v = np.array([0.8, -0.3]), np.zeros(2)
    frames, dt = [], 1e-3
    data = model.createData()
    for _ in range(300):
        frames.append(q)
        v = v + dt * pin.aba(model, data, q, v, np.zeros(2))  # symplectic Euler: its second differences are exact
        q = q + dt * v
    found = torques(wb.Clip(arm, np.array(frames), dt), cutoff=None)
    weight = np.abs(pin.computeGeneralizedGravity(model, data, frames[0])).max()
    assert np.abs(found.torque[2:-2]).max() < 0.01 * weight
    assert found.feet == ()
    assert not found.missing.any()


def test_the_ground_pushes_within_its_friction_and_does_not_pull() -> None:
    rng = np.random.default_rng(0)
    points = np.array([[0.1, 0.1, 0], [0.1, -0.1, 0], [-0.1, 0.1, 0], [-0.1, -0.1, 0]])
    for _ in range(50):
        wrench = rng.normal(size=6) * [300, 300, 900, 60, 60, 20]
        found = ground_forces(wrench, np.array([0.0, 0.0, 1.0]), points, 0.6)
        assert (found.forces[:, 2] >= 0.0).all()
        assert (np.linalg.norm(found.forces[:, :2], axis=1) <= 0.6 * found.forces[:, 2] + 1e-9).all()
        total = np.concatenate([found.forces.sum(axis=0), np.cross(points - [0.0, 0.0, 1.0], found.forces).sum(axis=0)])
        np.testing.assert_allclose(total + found.missing, wrench, atol=1e-6)


def test_noise_of_recordings_is_filtered_and_slow_motion_is_not(human: wb.Figure) -> None:
    clip = swaying(human, 240, 1 / 120)
    noise = np.random.default_rng(1).normal(scale=0.002, size=clip.q.shape)
    noise[:, 3:7] = 0.0
    noisy = clip.with_q(clip.q + noise)
    clean, wild = smoothed(noisy), noisy
    inside = slice(30, -30)
    assert np.abs(clean.q - clip.q)[inside].max() < 0.005
    true, kept = clip.accelerations()[inside], clean.accelerations()[inside]
    assert np.abs(kept - true).max() < 0.05 * np.abs(wild.accelerations()[inside] - true).max()
    assert smoothed(clip, None) is clip


@pytest.mark.parametrize(
    ("sex", "flexion", "extension"),
    [("male", (58, 100, 157), (84, 168, 318)), ("female", (22, 62, 104), (52, 106, 219))],
)
def test_strength_is_the_table_at_its_percentiles_and_grows_between(
    human: wb.Figure, sex: str, flexion: tuple[float, ...], extension: tuple[float, ...]
) -> None:
    """Knees, N m, of Stobbe (1982)."""
    knee = human.model.joints[human.joint_id("left_knee_flexion")].idx_v
    before = 0.0
    for percentile in (5, 20, 50, 80, 95):
        lower, upper = Strength(percentile, sex).limits(human)
        assert upper[knee] > before
        before = upper[knee]
        if percentile in (5, 50, 95):
            place = (5, 50, 95).index(percentile)
            assert upper[knee] == pytest.approx(flexion[place])
            assert -lower[knee] == pytest.approx(extension[place])
    wrist = human.model.joints[human.joint_id("left_wrist_flexion")].idx_v
    assert np.isinf(Strength(50, sex).limits(human)[1][wrist])


def test_a_deep_squat_needs_more_of_the_knees_than_standing(human: wb.Figure) -> None:
    straight = torques(wb.Clip(human, np.tile(human.posture("standing"), (3, 1)), 0.1))
    q = human.posture("standing").copy()
    for side in ("left", "right"):
        for name, angle in (("hip_flexion", 1.2), ("knee_flexion", 1.5), ("ankle_dorsiflexion", 0.5)):
            q[human.model.joints[human.joint_id(f"{side}_{name}")].idx_q] = angle
    bent = torques(wb.Clip(human, np.tile(q, (3, 1)), 0.1))
    assert bent.largest()["left_knee_flexion"] > straight.largest()["left_knee_flexion"] + 20.0
    knee = human.model.joints[human.joint_id("left_knee_flexion")].idx_v
    assert bent.torque[1, knee] < 0.0  # the extensors work


@pytest.mark.parametrize(("speed", "height", "bears"), [(0.3, 0.004, True), (1.5, 0.004, False), (0.3, 0.06, False)])
def test_a_foot_bears_while_it_comes_down_and_leaves(speed: float, height: float, bears: bool) -> None:
    """It stands, and for half a second goes on with its feet as near to the ground as in a double support."""
    figure = wb.load("human")
    still = np.tile(figure.posture("standing"), (60, 1))
    along = np.clip(np.arange(60) - 25, 0, 15)
    still[:, 0] += speed / 30.0 * along
    still[26:40, 2] += height
    needed = wb.motion.torques(wb.Clip(figure, still, 1.0 / 30.0), cutoff=None)
    assert needed.supported[28:38].all() == bears
    assert needed.supported[28:38].any() == bears
