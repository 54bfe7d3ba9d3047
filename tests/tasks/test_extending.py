"""The page on extending does what it says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wholebody.figures.state import State


@pytest.fixture(scope="module")
def page() -> dict[str, Any]:
    """Run every block of the page, in order, and return what it leaves behind."""
    path = Path(__file__).resolve().parents[2] / "docs" / "extending.md"
    text = path.read_text(encoding="utf-8")
    names: dict[str, Any] = {"__name__": "extending"}
    for block in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        line = text[: block.start(1)].count("\n")
        exec(compile("\n" * line + block.group(1), str(path), "exec", dont_inherit=True), names)
    return names


def test_the_goal_of_the_page_is_reached(page: dict[str, Any]) -> None:
    solution, figure = page["solution"], page["scene"].figure
    assert solution.status == "solved"
    height = State(figure.model).update(solution.q).frame(figure.frame_id("gaze")).translation[2]
    np.testing.assert_allclose(height, 1.45, atol=2e-5)


def test_the_measure_of_the_page_moves_the_other_arm(page: dict[str, Any]) -> None:
    figure, both = page["scene"].figure, page["both"]
    assert both.status == "solved"
    values, standing = (figure.joint_values(q) for q in (both.q, figure.posture("standing")))
    moved = max(abs(values[name] - standing[name]) for name in figure.groups["left_arm"])
    apart = max(
        abs(values[left] - values[right])
        for left, right in zip(figure.groups["left_arm"], figure.groups["right_arm"], strict=True)
    )
    assert moved > 0.2
    assert apart < 0.5 * moved


def test_the_constraint_of_the_page_holds_the_trunk(page: dict[str, Any]) -> None:
    figure = page["scene"].figure
    trunk = State(figure.model).update(page["both"].q).frame(figure.frame_id("thorax")).rotation
    np.testing.assert_allclose(np.arccos(trunk[2, 2]), 0.15, atol=1e-4)
