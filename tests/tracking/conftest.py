"""What the tests of this room share: a small scene."""

from __future__ import annotations

import pytest

import wholebody as wb


@pytest.fixture(scope="session")
def hand() -> wb.Figure:
    return wb.load("hand")


@pytest.fixture
def scene(hand: wb.Figure) -> wb.Scene:
    """A hand above a thick table whose top is z = 0."""
    return wb.Scene(hand).add(wb.Box((2.0, 2.0, 0.3)), name="table", at=(0.0, 0.0, -0.15))
