"""Pulling with every method."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

import wholebody as wb


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def _reach(scene: wb.Scene) -> wb.Problem:
    legs = wb.Freeze("root", "left_leg", "right_leg")
    return wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", (0.4, -0.3, 1.1))], constraints=[legs])


@pytest.mark.parametrize("method", ["newton", "qp", "ccd"])
def test_a_pull_stops_where_the_arm_ends(scene: wb.Scene, method: str) -> None:
    solutions = wb.follow_path(_reach(scene), [(0.4, -0.3, 1.1), (2.4, -0.3, 1.1)], method, spacing=0.1)
    assert [solution.solved for solution in solutions[:-1]] == [True] * (len(solutions) - 1)
    assert all(solution.assessment.goal_error < 1.1e-5 for solution in solutions[:-1])
    assert not solutions[-1].solved
    assert 4 <= len(solutions) < 12  # the trunk bends: the hand reaches 0.8 to 1.4 m


@pytest.mark.parametrize("method", ["newton", "qp", "ccd"])
def test_a_pull_stops_before_a_plate(method: str, before_plate: Callable[..., wb.Problem]) -> None:
    problem = before_plate((1.6, 1.6), 0.95, 1.1)
    scene = problem.scene
    solutions = wb.follow_path(problem, [(0.4, -0.2, 1.2), (0.4, 0.2, 1.2)], method, spacing=0.05)
    assert [solution.solved for solution in solutions[:-1]] == [True] * (len(solutions) - 1)
    assert not solutions[-1].solved
    assert 4 <= len(solutions) <= 6
    for solution in solutions:
        assert solution.assessment.penetration < 1e-4
    for before, after in itertools.pairwise(solutions):
        assert scene.sweep(before.q, after.q, 2e-3) is None


def test_what_is_no_path_is_named(scene: wb.Scene) -> None:
    problem = _reach(scene)
    with pytest.raises(wb.InputError, match="shape"):
        wb.follow_path(problem, [1.0, 2.0, 3.0])
    with pytest.raises(wb.InputError, match="spacing"):
        wb.follow_path(problem, [(0, 0, 0), (1, 0, 0)], spacing=0.0)
    with pytest.raises(wb.InputError, match="finite"):
        wb.follow_path(problem, [(0, 0, 0), (float("nan"), 0, 0)])
