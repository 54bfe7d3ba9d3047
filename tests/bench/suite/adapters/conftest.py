from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import wholebody as wb


@pytest.fixture(scope="session")
def standing_before() -> Callable[..., wb.Problem]:
    """Return a function: name, size and place of a box, and a goal -> a person whose feet are held, and the goal.

    Tools cannot be told of what a person keeps by default.
    """

    def build(name: str, size: tuple[float, ...], at: tuple[float, ...], goal: Any) -> wb.Problem:
        scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
        scene.add(wb.Box(size), name=name, at=at)
        holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
        return wb.Problem(scene, goals=[goal], constraints=holds, clearance=0.003, range_of_motion=False, balance=False)

    return build
