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


def test_a_limp_person_who_falls_on_loose_boxes_adds_no_energy() -> None:
    human = wb.load("human")
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    for x in (-0.1, 0.25):
        for y in (-0.2, 0.15):
            body = wb.Body(mass=10.0)
            scene.add(wb.Box((0.3, 0.3, 0.3)), name=f"box at {x}, {y}", at=(x, y, 0.16), body=body)
    start = human.posture("standing").copy()
    start[2] += 0.31
    world = wb.World(scene, start, spring=wb.Actuated(human, stiffness=0.0, damping=0.0))
    energies = [world.energy]
    for _ in range(12):
        assert world.step().deepest < 1e-3
        energies.append(world.energy)
    assert np.diff(energies).max() < 1e-6
