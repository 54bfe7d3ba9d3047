"""What the tests of this room share: a small scene."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import wholebody as wb


@pytest.fixture
def before_plate() -> Callable[..., wb.Problem]:
    """Return a function: size and place of a plate of 6 mm -> a person who stands, a fingertip before the plate."""

    def build(size: tuple[float, float], x: float, z: float) -> wb.Problem:
        scene = wb.Scene(wb.load("human"))
        scene.add(wb.Box((size[0], 0.006, size[1])), name="plate", at=(x, 0.0, z))
        holds = [wb.Freeze("root", "left_leg", "right_leg")]
        return wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", (0.4, -0.2, 1.2))], constraints=holds)

    return build


@pytest.fixture
def scene(hand: wb.Figure) -> wb.Scene:
    """A hand above a thick table whose top is z = 0."""
    return wb.Scene(hand).add(wb.Box((2.0, 2.0, 0.3)), name="table", at=(0.0, 0.0, -0.15))
