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


def test_a_long_way_into_a_cage_is_searched_on() -> None:
    """Trees lead to ends that are reached by three turns of the arm, too; 2.4 rad is the shortest of thirty plans."""
    asked = SCENES["cage"](1)
    found = wb.plan(asked.scene, asked.start, asked.goal, seed=21)
    assert found.solved, found.message
    assert found.length < 1.3 * 2.4
