"""Frozen joints and bounded steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from wholebody import InputError, Posture, Problem, Scene
from wholebody.base.errors import UnknownNameError
from wholebody.figures.state import State
from wholebody.methods import QP
from wholebody.tasks import Freeze, StepLimit


def test_freeze_bounds_what_it_names_and_nothing_else(humanoid: Any) -> None:
    lower, upper = (
        Freeze("left_arm", "root").resolve(humanoid, humanoid.figure.neutral).bounds(State(humanoid.model), None)
    )
    frozen = np.zeros(humanoid.model.nv, dtype=bool)
    frozen[humanoid.figure.dofs(["left_arm", "root"])] = True
    np.testing.assert_array_equal(lower[frozen], 0.0)
    np.testing.assert_array_equal(upper[frozen], 0.0)
    assert np.isneginf(lower[~frozen]).all()
    assert np.isposinf(upper[~frozen]).all()


@pytest.mark.parametrize("dt", [1.0, 0.1, 1 / 60, 1e-3])
def test_a_step_is_velocity_times_its_time(dt: float, humanoid: Any) -> None:
    limit = StepLimit(2.0, joints={"left_arm": 0.5, "larm_elbow_joint": 4.0}, root_velocity=1.5, root_turn=3.0)
    lower, upper = limit.resolve(humanoid, humanoid.figure.neutral).bounds(State(humanoid.model), dt)
    expected = np.full(humanoid.model.nv, 2.0)
    expected[:3], expected[3:6] = 1.5, 3.0
    expected[humanoid.figure.dofs(["left_arm"])] = 0.5
    expected[humanoid.figure.dofs(["larm_elbow_joint"])] = 4.0
    np.testing.assert_allclose(upper, expected * dt)
    np.testing.assert_array_equal(lower, -upper)


def test_without_time_or_velocity_nothing_is_bounded(humanoid: Any) -> None:
    state = State(humanoid.model)
    for limit, dt in ((StepLimit(2.0), None), (StepLimit(), 0.1)):
        lower, upper = limit.resolve(humanoid, humanoid.figure.neutral).bounds(state, dt)
        assert np.isneginf(lower).all()
        assert np.isposinf(upper).all()
    assert np.isposinf(StepLimit(2.0).resolve(humanoid, humanoid.figure.neutral).bounds(state, 0.1)[1][:6]).all()


@pytest.mark.parametrize(("named", "share"), [("turn1", np.exp(-0.02 / 0.05)), ("turn0", 0.0)])
def test_only_joints_of_bounded_velocity_brake_before_their_limits(named: str, share: float, planar_arm: Any) -> None:
    """A joint is asked to its limit: no step leaves less of the way than e^(-dt / 0.05 s), and it ends there."""
    scene = Scene(planar_arm((0.5, 0.4)))
    limit = float(scene.figure.limits.upper[1])
    start = np.array([0.0, limit - 0.02])
    goal = Posture(np.array([0.0, limit]))
    tracker = QP().tracker(Problem(scene, start, goals=[goal], constraints=[StepLimit(joints={named: 3.0})]), 0.02)
    left, q = [0.02], start
    for _ in range(30):
        q = tracker.step(q).q
        left.append(limit - q[1])
        assert left[-1] > share * left[-2] - 1e-12
    assert left[1] == pytest.approx(share * left[0], abs=1e-5)
    assert 0.0 <= left[-1] < 1e-6


def test_mistakes_are_named(humanoid: Any) -> None:
    with pytest.raises(InputError, match="write Freeze"):
        Freeze()
    with pytest.raises(InputError, match="write Freeze"):
        Freeze(["left_arm"])  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match=r"Freeze: no .*'left_arn'; did you mean"):
        Freeze("left_arn").resolve(humanoid, humanoid.figure.neutral)
    with pytest.raises(InputError, match="joints\\['left_arm'\\] is -1"):
        StepLimit(joints={"left_arm": -1.0})
    with pytest.raises(InputError, match="velocity is nan"):
        StepLimit(float("nan"))
    humanoid.figure.roots = {}
    with pytest.raises(InputError, match="leave root_velocity and root_turn out"):
        StepLimit(root_velocity=1.0).resolve(humanoid, humanoid.figure.neutral)
