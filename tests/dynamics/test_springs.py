"""Springs and dampers of a figure that yields: closed forms, energy, and the work of what drives it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated

INERTIA, STIFFNESS = 0.4**2 / 3.0, 8.0  # kg m2 of a rod of 1 kg and 0.4 m about its end; N m/rad


def rod(folder: Path) -> wb.Figure:
    """A rod on a horizontal axis; a joint with a spring bears its weight."""
    path = folder / "rod.urdf"
    path.write_text(
        f"""<robot name="rod"><link name="base"/><link name="rod"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
        <inertia ixx="1e-3" iyy="{0.4**2 / 12}" izz="{0.4**2 / 12}" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
        </joint></robot>"""
    )
    return wb.load(path)


def turned(start: np.ndarray, model: pin.Model, angle: float) -> np.ndarray:
    return np.asarray(pin.integrate(model, start, np.full(model.nv, angle)))


@pytest.mark.parametrize("damping", [0.0, 0.2, 3.0])  # N m s/rad: free, damped, beyond critical (1.3)
def test_a_driven_rod_swings_about_its_aim_with_the_period_and_the_decay_of_its_closed_form(
    tmp_path: Path, damping: float
) -> None:
    figure = rod(tmp_path)
    aim, away, time = figure.neutral, 0.4, 0.45  # rad, s
    rate, square = damping / (2.0 * INERTIA), complex(STIFFNESS / INERTIA - (damping / (2.0 * INERTIA)) ** 2)
    pulse = np.sqrt(square)
    ended = away * np.exp(-rate * time) * (np.cos(pulse * time) + rate / pulse * np.sin(pulse * time)).real
    angles = []
    for steps in (80, 160):
        driven = wb.Actuated(figure, stiffness=STIFFNESS, damping=damping)
        moving = Articulated(wb.Scene(figure), aim, driven, None)
        moving.q = turned(aim, figure.model, away)
        for _ in range(steps):
            moving.advance(aim, time / steps, {}, {})
        angles.append(float(pin.difference(figure.model, aim, moving.q)[0]))
    assert angles[1] == pytest.approx(ended, abs=3e-4)  # 26 mrad off where all springs were implicit
    assert abs(angles[1] - ended) < 0.3 * abs(angles[0] - ended) + 1e-9


@pytest.mark.parametrize("damping", [0.0, 0.01])
def test_a_hand_on_springs_never_has_more_energy_than_before(damping: float) -> None:
    hand = wb.load("hand")
    model, rng = hand.model, np.random.default_rng(3)
    aim = hand.posture("relaxed")
    stiffness = {"root": 300.0, **dict.fromkeys(hand.joints, 2.0)}
    moving = Articulated(wb.Scene(hand), aim, wb.Actuated(hand, stiffness, damping), None)
    moving.q = np.asarray(pin.integrate(model, aim, np.concatenate([rng.normal(0.0, 0.1, 6), np.zeros(model.nv - 6)])))
    moving.velocity = rng.normal(0.0, 1.0, model.nv)
    data, energies = model.createData(), []
    for _ in range(60):
        away = pin.difference(model, moving.q, aim)
        kinetic = moving.energy() - pin.computePotentialEnergy(model, data, moving.q)
        energies.append(kinetic + 0.5 * away @ (moving.stiffness * away))  # springs bear the weight
        moving.advance(aim, 1.0 / 240.0, {}, {})
    assert np.diff(energies).max() < 1e-9
    assert energies[-1] < energies[0] - 1.0


def test_a_driven_arm_that_strikes_a_box_gains_no_more_than_its_drive_gives(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(
        """<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="0.25 0 0"/><mass value="2"/>
        <inertia ixx="1e-3" iyy="0.04" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry></collision></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.1"/>
        <axis xyz="0 0 1"/></joint></robot>"""
    )
    arm = wb.load(path)
    scene = wb.Scene(arm).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(0.4, 0.25, 0.1001), body=wb.Body(mass=3.0))
    stiffness, damping, dt = 60.0, 4.0, 1.0 / 240.0
    world = wb.World(scene, arm.neutral, dt=dt, spring=wb.Actuated(arm, stiffness, damping))
    given, energies, aim = [0.0], [world.energy], arm.neutral
    for k in range(120):
        before, last = world.q, aim
        aim = turned(arm.neutral, arm.model, min(1.2, 3.0 * k * dt))
        world.step(aim)
        way = pin.difference(arm.model, before, world.q)[0]
        apart = pin.difference(arm.model, world.q, aim)[0]
        speed = pin.difference(arm.model, last, aim)[0] / dt
        # the implicit spring and damper, with the velocity by which the step moved the joint
        given.append(given[-1] + way * (stiffness * apart + damping * (speed - way / dt)))
        energies.append(world.energy)
    assert world.scene.objects["box"].placement.translation[1] > 0.35  # m: it was pushed by 0.1 and more
    assert max(np.subtract(energies, energies[0]) - given) < 1e-6  # J, the vertical axis bears no weight
    assert given[-1] > 1.0
