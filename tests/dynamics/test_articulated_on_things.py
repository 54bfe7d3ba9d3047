"""A figure that yields, on things that move by themselves: it falls as on things that stand, and adds no energy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import wholebody as wb

DT = 1.0 / 60.0


def test_a_rod_topples_on_a_loose_box_as_one_about_a_fixed_edge(tmp_path: Path) -> None:
    path = tmp_path / "rod.urdf"
    path.write_text(
        """<robot name="rod"><link name="rod"><inertial><mass value="20"/>
        <inertia ixx="2.4" iyy="2.4" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><box size="0.2 0.2 1.2"/></geometry></collision></link></robot>"""
    )
    rod = wb.load(path, root="free")
    scene = wb.Scene(rod).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.3, 0.3, 0.3)), name="box", at=(0.0, 0.0, 0.1501), body=wb.Body(mass=10.0))
    lean, length = 0.25, np.hypot(0.6, 0.1)
    height = 0.6 * np.cos(lean) + 0.1 * np.sin(lean)  # of the centre of mass above the edge
    start = np.array([0.0, 0.0, 0.3003 + height, *pin.Quaternion(pin.utils.rotate("y", lean)).coeffs()])
    world = wb.World(scene, start, spring=wb.Actuated(rod, stiffness=0.0, damping=0.0))
    energies, heights = [world.energy], []
    for _ in range(42):
        heights.append(world.step().q[2])
        energies.append(world.energy)
    turn = 20.0 * 9.81 * length / (2.4 + 20.0 * length**2)
    end = solve_ivp(
        lambda _, state: (state[1], turn * np.sin(state[0])), (0.0, 42 * DT), (lean - np.arctan(0.1 / 0.6), 0.0),
        rtol=1e-9, t_eval=DT * np.arange(1, 43),
    )  # fmt: skip
    assert np.diff(energies).max() < 1e-6
    assert np.array(heights) - 0.3 == pytest.approx(length * np.cos(end.y[0]), abs=0.015)  # it fell by 0.08


def test_a_limp_person_who_falls_on_loose_boxes_adds_no_energy_and_rests() -> None:
    figure = wb.load("avatar")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    for k, (x, y) in enumerate(((-0.3, 0.0), (0.35, 0.05))):
        scene.add(wb.Box((0.25, 0.3, 0.15)), name=f"box {k}", at=(x, y, 0.0751), body=wb.Body(mass=5.0))
    start = figure.posture("standing").copy()
    start[2], start[3:7] = 0.45, (0.0, np.sin(-0.75), 0.0, np.cos(0.75))  # on its back, in the air
    world = wb.World(scene, start, spring=wb.Actuated(figure, stiffness=0.0, damping=0.0))
    energies = [world.energy]
    for _ in range(80):  # it gained 4 mJ in a frame as it came to rest, after 60 frames
        assert world.step().deepest < 1e-3
        energies.append(world.energy)
    assert np.diff(energies).max() < 1e-5  # boxes rise to their gaps, by 0.1 um a frame
    assert energies[-21] - energies[-1] < 0.5  # J
    assert energies[0] - energies[-1] > 100.0


def test_limp_rods_bear_others_that_weigh_a_thousand_times_as_much(tmp_path: Path) -> None:
    rods = {}
    for k, mass in enumerate((1.0, 1.0, 1.0, 1.0, 1000.0, 1000.0)):
        across, path = mass / 12.0, tmp_path / f"rod{k}.urdf"
        path.write_text(
            f"""<robot name="rod"><link name="rod"><inertial><mass value="{mass}"/>
            <inertia ixx="{across / 50}" iyy="{across}" izz="{across}" ixy="0" ixz="0" iyz="0"/></inertial>
            <collision><geometry><box size="1 0.05 0.05"/></geometry></collision></link></robot>"""
        )
        rods[f"rod{k}"] = wb.load(path, root="free")
    scene = wb.Scene(rods)
    scene.add(wb.HalfSpace(), name="floor")
    start = scene.figure.neutral.copy()
    for k in range(6):  # two on the floor, two across them, two across those
        layer, off = k // 2, (-0.3, 0.3)[k % 2]
        turn = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)) if layer % 2 else (0.0, 0.0, 0.0, 1.0)
        start[7 * k : 7 * k + 7] = *((off, 0.0) if layer % 2 else (0.0, off)), 0.0252 + 0.0504 * layer, *turn
    world = wb.World(scene, start, spring=wb.Actuated(scene.figure, stiffness=0.0, damping=0.0))
    energies = [world.energy]
    for _ in range(14):
        assert world.step().deepest < 1e-5  # 1.3 mm where sweeps alone solved the program
        energies.append(world.energy)
    assert np.diff(energies).max() < 1e-6  # 3.9 J in the twelfth frame
