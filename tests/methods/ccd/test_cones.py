"""Limbs that stay in their reach cones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.methods.ccd.guards import Guard, Kept
from wholebody.methods.ccd.limbs import Limbs


@pytest.mark.parametrize("chain", ["right_arm", "left_leg"])
def test_a_limb_that_left_its_cone_is_brought_back(
    chain: str, human: wb.Figure, random_joints: Callable[..., Any], outside: Callable[..., float]
) -> None:
    limbs = Limbs(human.model, map(human.joint_id, human.chains[chain].joints))
    guard = Guard(wb.Scene(human), limbs, Kept())
    data, rng, left = human.model.createData(), np.random.default_rng(7), 0
    for _ in range(150):
        start, q = human.neutral, random_joints(human, human.chains[chain].joints, rng)
        pin.forwardKinematics(human.model, data, start)
        limbs.read(start, data)
        limbs.forward()
        guard.read(start)
        pin.forwardKinematics(human.model, data, q)
        limbs.read(q, data)
        limbs.forward()
        left += outside(human, q) > 1e-9
        guard.keep()
        limbs.write(q)
        assert outside(human, q) <= 1e-9
        assert human.within_limits(q)
    assert left > 5
