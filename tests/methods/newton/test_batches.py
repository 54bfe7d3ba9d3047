"""Every equation's derivatives against finite differences."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import Angle, Batch, Coincide, Slide, Turn, Unit, with_world
from wholebody.methods.newton.figure_bodies import DisplacementRows, FigureBodies

K, N, H = 5, 6, 1e-6


def _bodies(rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=(N + 1, 7))
    x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1)[:, None]
    return x


def _pairs(rng: np.random.Generator) -> np.ndarray:
    return np.array([rng.permutation(N + 1)[:2] for _ in range(K)])


def _forms(rng: np.random.Generator) -> np.ndarray:
    directions = rng.normal(size=(2, K, 3))
    directions /= np.linalg.norm(directions, axis=2)[..., None]
    return quat.relative_forms(quat.axes_with_z(directions[0]), quat.axes_with_z(directions[1]))


NAMES = [""] * K
EYES = np.broadcast_to(np.eye(3), (K, 3, 3))
MAKERS: dict[str, Callable[[np.random.Generator], Batch]] = {
    "unit": lambda g: Unit(NAMES),
    "spherical": lambda g: Coincide(
        _pairs(g), NAMES, g.normal(size=(K, 3)), g.normal(size=(K, 3)), EYES, np.zeros((K, 3))
    ),
    "gap": lambda g: Coincide(
        _pairs(g), NAMES, g.normal(size=(K, 3)), g.normal(size=(K, 3)), g.normal(size=(K, 1, 3)), g.normal(size=(K, 1))
    ),
    "revolute": lambda g: Turn(_pairs(g), NAMES, _forms(g)[:, :2]),
    "fixed": lambda g: Turn(_pairs(g), NAMES, _forms(g)[:, :3]),
    "slide": lambda g: Slide(_pairs(g), NAMES, g.normal(size=(K, 2, 3)), g.normal(size=(K, 3)), g.normal(size=(K, 2))),
    "angle": lambda g: Angle(_pairs(g), NAMES, _forms(g)[:, 2:], np.zeros(K), np.zeros(K), np.sign(g.normal(size=K))),
}


@pytest.mark.parametrize("name", MAKERS)
def test_derivatives_are_those_of_differences(name: str) -> None:
    rng = np.random.default_rng(3)
    batch, x = MAKERS[name](rng), _bodies(rng)
    jacobian = batch.jacobian(x)
    assert (jacobian[:, ~batch.pattern] == 0.0).all()
    for i, bodies in enumerate(batch.bodies):
        for column in range(jacobian.shape[2]):
            plus, minus = x.copy(), x.copy()
            plus[bodies[column // 7], column % 7] += H
            minus[bodies[column // 7], column % 7] -= H
            slope = (batch.residual(plus) - batch.residual(minus))[i] / (2 * H)
            assert jacobian[i, :, column] == pytest.approx(slope, abs=1e-7)


def test_rotations_are_pinocchios() -> None:
    rng = np.random.default_rng(0)
    e, c = _bodies(rng)[:, 3:], rng.normal(size=(N + 1, 3))
    there = [pin.Quaternion(q).toRotationMatrix() @ v for q, v in zip(e, c, strict=True)]
    assert quat.rotate(e, c) == pytest.approx(np.array(there), abs=1e-12)
    product = [(pin.Quaternion(a) * pin.Quaternion(b)).coeffs() for a, b in zip(e, e[::-1], strict=True)]
    assert quat.product(e, e[::-1]) == pytest.approx(np.array(product), abs=1e-12)


def test_an_angle_is_the_angle_of_the_joint() -> None:
    wanted = np.linspace(-3.0, 3.0, K)
    x = np.zeros((N + 1, 7))
    x[:, 6] = 1.0
    for body, angle in enumerate(wanted):
        x[body + 1, 3:] = pin.Quaternion(pin.AngleAxis(angle, np.array((0.0, 0.0, 1.0)))).coeffs()
    pairs = np.array([(0, body + 1) for body in range(K)])
    identity = np.tile((0.0, 0.0, 0.0, 1.0), (K, 1))
    batch = Angle(pairs, NAMES, quat.relative_forms(identity, identity)[:, 2:], np.zeros(K), np.zeros(K), np.ones(K))
    assert batch.angle(x) == pytest.approx(wanted, abs=1e-12)


def test_degrees_of_freedom_of_every_kind_follow_their_bodies_as_pinocchio_differentiates_them() -> None:
    model, rng = pin.Model(), np.random.default_rng(5)
    kinds = (
        pin.JointModelFreeFlyer(), pin.JointModelSpherical(), pin.JointModelPY(), pin.JointModelRUBZ(),
        pin.JointModelRevoluteUnaligned(np.array((0.6, 0.0, 0.8))), pin.JointModelPrismaticUnaligned(0.0, 0.6, 0.8),
    )  # fmt: skip
    for number, kind in enumerate(kinds):
        model.addJoint(number, kind, pin.SE3.Random(), f"joint {number}")
    model.lowerPositionLimit, model.upperPositionLimit = np.full(model.nq, -4.0), np.full(model.nq, 4.0)
    limits = SimpleNamespace(idx_q=np.arange(model.nq), lower=model.lowerPositionLimit, upper=model.upperPositionLimit)
    figure: Any = SimpleNamespace(model=model, limits=limits, roots={"": 1})
    bodies, q = FigureBodies(figure), pin.randomConfiguration(model)
    x, step = bodies.variables(q), 1e-6 * rng.normal(size=model.nv)
    moved = bodies.variables(pin.integrate(model, q, step)) - bodies.variables(pin.integrate(model, q, -step))
    here, chart = with_world(x), bodies.chart
    rows = chart.rows(here)
    np.testing.assert_allclose(rows @ moved, 2.0 * step, atol=1e-11)
    assert (rows[~chart.pattern] == 0.0).all()
    assert chart.pattern[-2].sum() == 8  # a joint that turns reads no positions
    displaced = DisplacementRows(model, chart, lambda _: q)
    displaced.anchor(pin.integrate(model, q, step), np.zeros(model.nv))
    np.testing.assert_allclose(displaced.residual(here)[0], -step, atol=1e-11)
