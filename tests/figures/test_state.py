"""One kinematic pass against Pinocchio's own functions and finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State, Wrench, joint_support


def random_posture(figure, seed):
    rng = np.random.default_rng(seed)
    return figure.clamp(pin.integrate(figure.model, figure.neutral, 0.5 * rng.normal(size=figure.model.nv)))


def test_frames_are_pinocchios(human):
    state, data = State(human.model), human.model.createData()
    for seed in range(3):
        q = random_posture(human, seed)
        pin.framesForwardKinematics(human.model, data, q)
        state.update(q)
        for name in human.frames:
            index = human.frame_id(name)
            assert state.frame(index).homogeneous == pytest.approx(data.oMf[index].homogeneous, abs=1e-14)


def test_wrench_rows_are_derivatives_of_a_point(human):
    """Force n through the point p of a frame: n . dp, with the other frame standing still or moving."""
    rng = np.random.default_rng(4)
    state, q = State(human.model), random_posture(human, 5)
    model = human.model
    tip, base = human.frame_id("right_index_tip"), human.frame_id("thorax")
    normal = rng.normal(size=(3,))

    def height(q, relative):
        state.update(q)
        point = state.frame(tip).translation
        return normal @ (state.frame(base).actInv(point) if relative else point)

    joints = model.frames[tip].parentJoint, model.frames[base].parentJoint
    state.update(q)
    point, turn = state.frame(tip).translation.copy(), state.frame(base).rotation.copy()
    for relative in (False, True):
        force = turn @ normal if relative else normal
        wrench = Wrench(np.concatenate([force, np.cross(point, force)])[None], joints[0], joints[1] * relative)
        state.update(q)
        row = state.wrench_jacobian(wrench)[0]
        several = state.rows(
            wrench.rows, np.array([wrench.joint], dtype=np.intp), np.array([wrench.against], dtype=np.intp)
        )
        assert np.array_equal(several[0], row)
        for k, direction in enumerate(np.eye(model.nv)):
            ahead = height(pin.integrate(model, q, 1e-6 * direction), relative)
            behind = height(pin.integrate(model, q, -1e-6 * direction), relative)
            assert row[k] == pytest.approx((ahead - behind) / 2e-6, abs=1e-8)


def test_center_of_mass_and_its_derivative(human):
    state, q = State(human.model), random_posture(human, 6)
    weights = np.array([inertia.mass for inertia in human.model.inertias])
    data = human.model.createData()

    def center(q):
        pin.forwardKinematics(human.model, data, q)
        levers = [data.oMi[k].act(inertia.lever) for k, inertia in enumerate(human.model.inertias)]
        return weights @ np.array(levers) / weights.sum()

    state.update(q)
    jacobian = state.jacobian.copy()
    assert state.center_of_mass() == pytest.approx(center(q), abs=1e-12)
    derivative = state.center_of_mass_jacobian()
    for k, direction in enumerate(np.eye(human.model.nv)):
        change = center(pin.integrate(human.model, q, 1e-6 * direction)) - center(
            pin.integrate(human.model, q, -1e-6 * direction)
        )
        assert derivative[:, k] == pytest.approx(change / 2e-6, abs=1e-8)
    assert np.array_equal(state.jacobian, jacobian)


def test_the_center_of_mass_needs_no_second_data(human, monkeypatch):
    """Data of a person with fingers has 27 MB of second derivatives, which take 15 ms to make."""
    state = State(human.model).update(random_posture(human, 3))
    monkeypatch.setattr(pin.Model, "createData", lambda model: pytest.fail("data are made"))
    joints, jacobian = state.joints.copy(), state.jacobian.copy()
    assert state.center_of_mass_jacobian().shape == (3, human.model.nv)
    assert np.array_equal(state.joints, joints)
    assert np.array_equal(state.jacobian, jacobian)


def test_an_update_forgets_the_posture_before(human):
    state = State(human.model)
    one, two = random_posture(human, 7), random_posture(human, 8)
    index = human.frame_id("gaze")
    state.update(one)
    first, center = state.frame(index).translation.copy(), state.center_of_mass().copy()
    state.update(two)
    assert np.abs(state.frame(index).translation - first).max() > 1e-3
    assert np.abs(state.center_of_mass() - center).max() > 1e-3
    state.update(one)
    assert np.array_equal(state.frame(index).translation, first)
    assert np.array_equal(state.center_of_mass(), center)


def test_support_says_what_moves_what(human):
    """A joint is moved by a degree of freedom where its place changes with it."""
    model, support = human.model, joint_support(human.model)
    assert not support[0].any()
    for joint in range(1, model.njoints):
        expected = np.zeros(model.nv)
        for above in model.supports[joint]:
            expected[model.joints[above].idx_v : model.joints[above].idx_v + model.joints[above].nv] = above > 0
        assert np.array_equal(support[joint], expected)


@pytest.mark.parametrize("q", [np.zeros(3), np.zeros((56, 1)), 3.0])
def test_wrong_shapes_are_refused(human, q):
    with pytest.raises(wb.InputError, match=r"a posture has shape .*; give \(56,\)"):
        State(human.model).update(q)


def test_what_is_not_finite_is_refused_and_changes_nothing(human):
    state = State(human.model).update(human.neutral)
    before = state.frame(human.frame_id("gaze")).translation.copy()
    bad = human.neutral
    bad[10] = np.nan
    with pytest.raises(wb.InputError, match="entry 10 is not finite"):
        state.update(bad)
    assert np.array_equal(state.frame(human.frame_id("gaze")).translation, before)
