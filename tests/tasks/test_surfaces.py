"""Nearest points, slid pieces and wrenches: against coal's own queries and vector products, wherever pieces are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.figures.state import State
from wholebody.tasks import grips
from wholebody.tasks.contact_parts import through
from wholebody.tasks.surfaces import nearest


def test_wrenches_are_forces_and_their_moments() -> None:
    point, *forces = np.random.default_rng(4).normal(size=(6, 3))
    expected = np.hstack([forces, np.cross(point, forces)])
    np.testing.assert_allclose(through(point, np.array(forces)), expected, atol=1e-15)
    assert through(point, np.zeros((0, 3))).shape == (0, 6)


def test_what_a_posture_keeps_is_not_that_of_a_thing_moved_since() -> None:
    """Distances, and rows and planes of a grip, of a state that has seen the thing elsewhere and of a new one."""
    figure = wb.load("human", hands="fingers")
    scene = wb.Scene(figure).add(wb.Sphere(0.04), name="thing", at=(0.4, -0.2, 1.1))
    q = figure.with_joints(figure.posture("standing"), {"right_elbow_flexion": np.radians(80.0)})
    palm = figure.placement(q, "right_palm")
    term = wb.Grasp("right", "thing", kind="power").resolve(scene, q)
    opposing = next(part for part in term.parts if isinstance(part, grips.Opposing))
    opposing = opposing._replace(far=0.2, most=-3.0)  # counts wherever the thing is near
    old, (piece,) = State(scene.model).update(q), opposing.thing.pieces
    for at in ((0.02, 0.0, 0.06), (-0.02, 0.01, 0.07)):
        scene.geometry.geometryObjects[piece].placement = pin.SE3(np.eye(3), palm.act(np.array(at)))
        new = State(scene.model).update(q)
        again, anew = nearest(opposing.first, opposing.thing, old), nearest(opposing.first, opposing.thing, new)
        assert again.distance == anew.distance
        assert opposing.rows(new)[1].any()
        np.testing.assert_array_equal(opposing.rows(old)[1], opposing.rows(new)[1])
        np.testing.assert_array_equal(opposing.planes(old).jacobian, opposing.planes(new).jacobian)
