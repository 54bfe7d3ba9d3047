"""Pulling with every method."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

import wholebody as wb


@pytest.fixture
def problem(planar_arm: Callable[..., wb.Figure]) -> wb.Problem:
    """Three links of 1.2 m together, bent below the x axis; the tip is the goal."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    return wb.Problem(scene, np.array([-0.9, 0.7, 0.7]), goals=[wb.Point("tip", (0.7, -0.2, 0.0))])


@pytest.mark.parametrize("method", ["newton", "qp", "ccd"])
def test_a_pull_stops_where_the_arm_ends(problem: wb.Problem, method: str) -> None:
    solutions = wb.tracking.follow_path(problem, [(0.6, -0.4, 0.0), (2.0, -0.4, 0.0)], method, spacing=0.1)
    assert [solution.solved for solution in solutions] == [True] * 6 + [False]  # 1.131 m along the path is its length
    assert all(solution.assessment.goal_error < 1.1e-5 for solution in solutions[:-1])


@pytest.mark.parametrize(("method", "spacing", "most"), [("newton", 0.05, 6), ("qp", 0.4, 2), ("ccd", 0.4, 2)])
def test_a_pull_stops_before_a_plate(problem: wb.Problem, method: str, spacing: float, most: int) -> None:
    """The plate is 0.1 m wide: other postures reach what is behind it, and a long step goes there at once."""
    scene = problem.scene.add(wb.Box((0.1, 0.006, 0.3)), name="plate", at=(0.7, 0.0, 0.0))
    problem = wb.Problem(scene, problem.start, goals=problem.goals)
    behind = wb.Problem(scene, np.array([0.9, -0.7, -0.7]), goals=[wb.Point("tip", (0.7, 0.2, 0.0))])
    assert wb.solve(behind).solved
    solutions = wb.tracking.follow_path(problem, [(0.7, -0.2, 0.0), (0.7, 0.2, 0.0)], method, spacing=spacing)
    assert [solution.solved for solution in solutions[:-1]] == [True] * (len(solutions) - 1)
    assert not solutions[-1].solved
    assert 2 * most // 3 <= len(solutions) <= most
    for solution in solutions:
        assert solution.assessment.penetration < 1e-4
    for before, after in itertools.pairwise(solutions):
        assert scene.sweep(before.q, after.q, 2e-3) is None


def test_what_is_no_path_is_named(problem: wb.Problem) -> None:
    with pytest.raises(wb.InputError, match="shape"):
        wb.tracking.follow_path(problem, [1.0, 2.0, 3.0])
    with pytest.raises(wb.InputError, match="spacing"):
        wb.tracking.follow_path(problem, [(0, 0, 0), (1, 0, 0)], spacing=0.0)
    with pytest.raises(wb.InputError, match="finite"):
        wb.tracking.follow_path(problem, [(0, 0, 0), (float("nan"), 0, 0)])
