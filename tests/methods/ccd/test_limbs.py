"""Kinematics on floats against Pinocchio's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.reference.limbs import turned
from wholebody.methods.ccd.limbs import Limbs, floats, movable, moved, rotated, seen_from


@pytest.mark.parametrize("name", ["human", "avatar", "hand"])
def test_chains_are_where_pinocchio_has_them(name: str, random_joints: Callable[..., Any]) -> None:
    figure = wb.load(name)
    data, rng = figure.model.createData(), np.random.default_rng(3)
    for chain in figure.chains.values():
        limbs = Limbs(figure.model, map(figure.joint_id, chain.joints))
        for _ in range(5):
            q = random_joints(figure, figure.joints, rng)
            root = np.zeros(figure.model.nv)
            root[:6] = rng.normal(size=6)
            q = pin.integrate(figure.model, q, root)
            pin.forwardKinematics(figure.model, data, q)
            limbs.read(q, data)
            limbs.forward()
            for node, joint in enumerate(limbs.joints):
                assert limbs.frames[node] == pytest.approx(floats(data.oMi[joint]), abs=1e-12)


def _odd_model() -> Any:
    """Every kind of joint that can be a node, on placements that are no identity, with a joint between that cannot."""
    rng = np.random.default_rng(0)
    model, joint = pin.Model(), 0
    axis = np.array([0.6, 0.0, 0.8])
    for made in (
        pin.JointModelRX(),
        pin.JointModelRevoluteUnaligned(axis),
        pin.JointModelPZ(),
        pin.JointModelSpherical(),
        pin.JointModelRUBY(),
        pin.JointModelPrismaticUnaligned(axis),
        pin.JointModelRZ(),
    ):
        turn = pin.exp3(rng.normal(size=3))
        joint = model.addJoint(joint, made, pin.SE3(turn, rng.normal(size=3)), f"{made.shortname()}")
    return model


def test_every_kind_of_joint_and_what_lies_between() -> None:
    model = _odd_model()
    joints = [joint for joint in range(1, model.njoints) if movable(model, joint)]
    assert len(joints) == 6
    limbs, data, rng = Limbs(model, joints), model.createData(), np.random.default_rng(1)
    for _ in range(20):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        pin.forwardKinematics(model, data, q)
        limbs.read(q, data)
        written = q.copy()
        limbs.write(written)
        assert written == pytest.approx(q, abs=1e-12)
        limbs.forward()
        for node, joint in enumerate(limbs.joints):
            assert limbs.frames[node] == pytest.approx(floats(data.oMi[joint]), abs=1e-12)


def test_lines_are_the_axes_about_which_joints_turn() -> None:
    model = _odd_model()
    joints = [joint for joint in range(1, model.njoints) if movable(model, joint)]
    limbs, data = Limbs(model, joints), model.createData()
    q = pin.integrate(model, pin.neutral(model), np.random.default_rng(5).normal(size=model.nv))
    jacobian = pin.computeJointJacobians(model, data, q)
    limbs.read(q, data)
    limbs.forward()
    for node, joint in enumerate(limbs.joints):
        axis, origin = np.array(limbs.lines[node][:3]), np.array(limbs.lines[node][3:])
        column = jacobian[:, model.joints[joint].idx_v]
        if limbs.slides[node]:
            assert column == pytest.approx([*axis, 0.0, 0.0, 0.0], abs=1e-12)
        else:
            assert column == pytest.approx([*np.cross(origin, axis), *axis], abs=1e-12)


def test_vectors_of_frames() -> None:
    rng = np.random.default_rng(2)
    place, point = pin.SE3.Random(), rng.normal(size=3)
    assert moved(floats(place), *point) == pytest.approx(place.act(point))
    assert rotated(floats(place), *point) == pytest.approx(place.rotation @ point)
    assert seen_from(floats(place), *point) == pytest.approx(place.rotation.T @ point)
    axis = point / np.linalg.norm(point)
    arrow = rng.normal(size=3)
    assert turned(*axis, np.cos(0.7), np.sin(0.7), *arrow) == pytest.approx(pin.exp3(0.7 * axis) @ arrow)
