"""A figure that yields, beside MuJoCo: it swings, is driven and is hit in three dimensions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.rigid_bodies import RigidBodies

mujoco = pytest.importorskip("mujoco")

DT = 1.0 / 60.0
BALL = (0.55, 0.02, 1.12)  # m, above the second link
ARM = """<mujoco><compiler angle="radian"/>
<option timestep="{step}" integrator="implicit" gravity="0 0 {weight}"/>
<default><joint range="-3 3" stiffness="{stiffness}" damping="{damping}"/>
<geom condim="1" solref="-20000000 0" solimp="0.999 0.999 0.001"/></default>
<worldbody><body name="upper" gravcomp="{borne}" pos="0 0 1">
<joint name="swing" axis="0 1 0" springref="0.5"/><joint name="lift" axis="1 0 0" springref="-0.3"/>
<geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass="1.2"/>
<body name="fore" gravcomp="{borne}" pos=".4 0 0"><joint name="bend" axis="0 1 0" springref="0.8"/>
<geom type="capsule" size=".025" fromto="0 0 0 .3 0 .05" mass=".8"/></body></body>{ball}</worldbody>
<contact><exclude body1="upper" body2="fore"/></contact></mujoco>"""
FREE = '<body name="ball" pos="{} {} {}"><freejoint/><geom type="sphere" size=".04" mass=".5"/></body>'.format(*BALL)


def arm_of(folder: Path, stiffness: float, damping: float, weight: float, step: float) -> tuple[wb.Figure, str]:
    """The arm that is read from MuJoCo's file, and the file's text with a place for a ball."""
    borne = int(stiffness > 0.0)
    text = ARM.format(step=step, weight=weight, stiffness=stiffness, damping=damping, borne=borne, ball="{ball}")
    path = folder / "arm.xml"
    path.write_text(text.replace("{ball}", ""))
    return wb.load(path), text


@pytest.mark.parametrize(("stiffness", "damping"), [(0.0, 0.0), (20.0, 1.0)])
def test_an_arm_swings_and_is_driven_as_in_mujoco(tmp_path: Path, stiffness: float, damping: float) -> None:
    figure, text = arm_of(tmp_path, stiffness, damping, -9.81, DT / 200)
    model = mujoco.MjModel.from_xml_string(text.replace("{ball}", "").replace("implicit", "RK4"))
    data = mujoco.MjData(model)
    aim = np.array([0.5, -0.3, 0.8])
    actuated = wb.Actuated(figure, stiffness=stiffness, damping=damping)
    errors = []
    for parts in (4, 16):
        mujoco.mj_resetData(model, data)
        moving = Articulated(wb.Scene(figure), np.zeros(3), actuated, None)
        moving.advance(aim, 1e-9, {}, {})  # the tracker is there from the first moment
        moving.velocity, moving.q = np.zeros(3), np.zeros(3)
        worst = 0.0
        for _ in range(30):
            mujoco.mj_step(model, data, nstep=200)
            for _ in range(parts):
                moving.advance(aim, DT / parts, {}, {})
            worst = max(worst, np.abs(moving.q - data.qpos).max())
        errors.append(worst)
    assert np.abs(data.qpos).max() > 0.4
    assert errors[0] < 0.03  # rad
    assert errors[1] < (0.4 if stiffness + damping else 0.1) * errors[0]  # of the first order, freely of the second


def test_an_elastic_blow_gives_the_joints_and_the_ball_the_velocities_of_mujoco(tmp_path: Path) -> None:
    figure, text = arm_of(tmp_path, 0.0, 0.0, 0.0, DT / 2000)
    model = mujoco.MjModel.from_xml_string(text.replace("{ball}", FREE))
    data = mujoco.MjData(model)
    speed = (0.3, 0.0, -2.0)
    data.qvel[3:6] = speed
    scene = wb.Scene(figure)
    material = wb.dynamics.Material("elastic", {"human": (1.0, 0.0)})
    scene.add(wb.Sphere(0.04), name="ball", at=BALL, body=wb.Body(mass=0.5, material=material, velocity=speed))
    engine = RigidBodies(scene, (0.0, 0.0, 0.0), np.zeros(3))
    moving = Articulated(scene, np.zeros(3), wb.Actuated(figure, stiffness=0.0, damping=0.0), engine)
    segments = {name: scene.frame_id(name) for name in figure.segments}
    while not moving.impulses:
        moving.advance(moving.q, 1e-3, {}, segments)
    met = False
    while not met or data.ncon:
        mujoco.mj_step(model, data)
        met |= data.ncon > 0
    assert np.abs(data.qvel[:3]).max() > 1.0  # rad/s
    assert moving.velocity == pytest.approx(data.qvel[:3], abs=0.1)  # a contact of MuJoCo takes 0.3 ms
    assert engine.twist("ball")[:3] == pytest.approx(data.qvel[3:6], abs=0.03)


def test_a_swinging_beam_gives_an_arm_the_impulse_that_it_gives_in_mujoco(tmp_path: Path) -> None:
    figure, text = arm_of(tmp_path, 0.0, 0.0, 0.0, DT / 4000)
    swing = """<body name="beam" pos=".75 .01 1.14">
    <joint name="hinge" pos=".25 0 0" axis="0 1 0" stiffness="0" damping="0"/>
    <geom type="box" size=".25 .04 .02" mass="3"/></body>"""
    model = mujoco.MjModel.from_xml_string(text.replace("{ball}", swing))
    data, speed, met = mujoco.MjData(model), -6.0, False
    data.qvel[3] = speed
    while not met or data.ncon:
        mujoco.mj_step(model, data)
        met |= data.ncon > 0
    material = wb.dynamics.Material("elastic", {"human": (1.0, 0.0)})
    hinge = wb.dynamics.Hinge((0.25, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    turning, velocity = (0.0, speed, 0.0), (0.0, 0.0, 0.25 * speed)
    beam = wb.Body(mass=3.0, material=material, velocity=velocity, angular_velocity=turning, joints=[hinge])
    scene = wb.Scene(figure).add(wb.Box((0.5, 0.08, 0.04)), name="beam", at=(0.75, 0.01, 1.14), body=beam)
    engine = RigidBodies(scene, (0.0, 0.0, 0.0), np.zeros(3))
    moving = Articulated(scene, np.zeros(3), wb.Actuated(figure, stiffness=0.0, damping=0.0), engine)
    segments, began = {name: scene.frame_id(name) for name in figure.segments}, engine.energy()
    while not moving.impulses:
        moving.advance(moving.q, 2.5e-4, {}, segments)
    assert engine.twist("beam")[4] == pytest.approx(data.qvel[3], abs=1e-5)  # rad/s
    assert moving.velocity == pytest.approx(data.qvel[:3], abs=0.01)
    assert engine.energy() + moving.energy() == pytest.approx(began, rel=1e-9)
