"""Scenes to plan motions in: their ends are allowed, and the straight motion between those of hard ones is not."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from tests.audits.plan_scenes import SCENES


@pytest.mark.parametrize("name", ["person at a gap", "hand into a box", "G1 at a gap"])
def test_both_ends_are_free_and_the_straight_motion_between_them_is_not(name: str) -> None:
    try:
        asked = SCENES[name](0)
    except LookupError as missing:
        pytest.skip(str(missing))
    problem = wb.Problem(asked.scene, asked.start)
    assert all(wb.assess(problem, np.asarray(q)).holds(1e-6) for q in (asked.start, asked.goal))
    assert asked.scene.sweep(asked.start, asked.goal) is not None


def test_an_arm_gets_into_furniture() -> None:
    asked = SCENES["kitchen"](3)
    found = wb.plan(asked.scene, asked.start, asked.goal)
    assert found.solved, found.message
