"""Flesh beside its limb in contacts of a figure that yields, and in the engine: against finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.geometry.flesh import flesh_of


@pytest.mark.parametrize("side", ["left", "right"])
def test_flesh_comes_nearer_as_its_contact_rows_say(side: str) -> None:
    """A thigh on the floor sank by 1 mm in 30 ms: the rows took its flesh to be rigid."""
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    model, workspace, q = figure.model, scene.workspace(), figure.posture("standing").copy()
    q[model.joints[figure.joint_id(f"{side}_hip_flexion")].idx_q] = 0.75  # rad: between straight and bent
    lying = pin.utils.rotate("x", 1.5 if side == "right" else -1.5)
    q[3:7] = pin.Quaternion(lying @ pin.utils.rotate("y", 0.1)).coeffs()
    flesh = next(one.piece for one in flesh_of(scene.geometry) if workspace.owners[one.piece] == f"{side}_thigh")
    number = np.flatnonzero((workspace.table.pairs == flesh).any(axis=1))[0]

    def gap(posture: np.ndarray) -> float:
        near = workspace.near(posture, 3.0)
        return float(near.distance[near.number == number][0])

    q[2] -= gap(q) - 0.01  # m
    figure_moving = Articulated(scene, q, wb.Actuated(figure, stiffness=0.0, damping=0.0), None)
    figure_moving.velocity[:3] = 4.0  # m/s: the thigh can meet the floor
    points = figure_moving._touching.points(q, figure_moving.velocity, 1.0 / 60.0, {})
    step = 1e-4 * np.eye(model.nv)
    rates = [(gap(pin.integrate(model, q, e)) - gap(pin.integrate(model, q, -e))) / 2e-4 for e in step]
    row = points.figure[3 * np.flatnonzero(points.pair == 2 * model.nv + number)[0]]
    assert row == pytest.approx(np.array(rates), abs=1e-3)  # m/rad; 0.019 without


@pytest.mark.parametrize("angle", [0.1, 0.75, 1.4])
def test_the_engine_meets_flesh_where_the_figure_has_it(angle: float) -> None:
    """To the engine every hip was bent: a box before the straight thigh of a limp person took hundreds of blows."""
    figure = wb.load("human")
    q = figure.posture("standing").copy()
    q[figure.model.joints[figure.joint_id("left_hip_flexion")].idx_q] = angle
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(0.0, 0.0, 3.0), body=wb.Body(mass=1.0))
    engine = RigidBodies(scene, start=q)
    engine.advance(1e-3)
    assert flesh_of(scene.geometry)
    assert engine._near.placements[:-1] == pytest.approx(scene.workspace().placements(q)[:-1], abs=1e-12)
