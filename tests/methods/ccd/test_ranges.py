"""Joints that have left a range of motion are brought back; whole answers keep to the ranges."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.methods.ccd.guards import Kept


def _left(scene: wb.Scene, q: Any) -> float:
    """How far joints are out of their ranges of motion, radians, by the constraint itself."""
    term = wb.tasks.RangeOfMotion().resolve(scene, scene.figure.neutral)
    return max(0.0, -float(term.value(scene.state(q)).min()))


@pytest.mark.parametrize(
    ("chain", "moving"),
    [("right_arm", None), ("left_leg", None), ("neck", None), ("left_leg", ("left_hip_flexion", "left_hip_abduction"))],
)
def test_what_left_its_range_is_brought_back(
    chain: str, moving: Any, human: wb.Figure, brought_back: Callable[..., int]
) -> None:
    """The last case: joints that stay, a knee, decide with those that move where the range ends."""
    scene, kept = wb.Scene(human), Kept(ranges=tuple(human.ranges))
    names = human.chains[chain].joints if moving is None else moving
    assert brought_back(names, kept, lambda q: _left(scene, q), 30, np.random.default_rng(5)) > 2


@pytest.mark.parametrize("stated", [False, True])
def test_answers_keep_to_the_ranges(stated: bool, human: wb.Figure) -> None:
    """Places behind the trunk, most of which an arm meets soonest with more inward rotation than a person has."""
    scene = wb.Scene(human).add(wb.Box((0.3, 0.3, 0.3)), name="box", at=(-0.45, -0.25, 1.0))
    options: dict[str, Any] = {
        "constraints": [wb.tasks.RangeOfMotion(), wb.tasks.ReachCones()],
        "range_of_motion": False,
    }
    for x, y, z in ((-0.1, -0.4, 0.83), (-0.28, -0.28, 1.4), (0.0, -0.03, 1.3), (-0.15, -0.1, 1.1)):
        goals = [wb.Point("right_index_tip", (x, y, z))]
        problem = wb.Problem(scene, goals=goals, balance=False, **(options if stated else {}))
        assert _left(scene, wb.methods.CCD(restarts=1).solve(problem).q) <= 1e-6


def test_a_drag_keeps_to_the_ranges() -> None:
    """A hand that hangs is raised to the height of the head; then it goes forwards and down."""
    figure = wb.load("human", sex="male", stature=1.511, detail="spheres")
    scene = wb.Scene(figure)
    height = figure.placement(figure.neutral, "right_hand").translation
    drag = wb.tracking.Drag(wb.Problem(scene, goals=[wb.Point("right_hand", height)]), method="ccd", dt=0.1)
    corners = np.array([height, (0.22, -0.13, 1.40), (0.44, -0.12, 1.24)])
    for first, last in pairwise(corners):
        for share in np.linspace(0.0, 1.0, 12):
            drag.to(first + share * (last - first))
            assert _left(scene, drag.q) <= 1e-4
