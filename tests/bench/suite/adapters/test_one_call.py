"""What tools of one call keep from one solve to the next, on a tool whose calls are counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.base import OneCall


class Still(OneCall[Any]):
    """Answers with the start, or with nothing."""

    name = "still"
    kinds = (wb.Effort, wb.Frame, wb.Point)
    way = "by standing still"
    failure = "it found nothing"

    def __init__(self, tolerance: float, answers: bool = True) -> None:
        super().__init__(tolerance)
        self.answers, self.models = answers, []

    def depends_on(self, problem: wb.Problem) -> tuple[Any, ...]:
        return (problem.scene.model, problem.start.tobytes())

    def build(self, problem: wb.Problem) -> Any:
        self.models.append(problem.scene.model)
        return problem.scene.model

    def found(self, built: Any, problem: wb.Problem) -> tuple[Any, bool]:
        assert built is problem.scene.model
        return (problem.start, True) if self.answers else (None, False)


def _problem(start: float = 0.1) -> wb.Problem:
    figure = wb.load("hand")
    q = figure.neutral.copy()
    q[-1] = start
    tip = figure.placement(q, figure.frames[-1]).translation
    return wb.Problem(wb.Scene(figure), q, goals=[wb.Point(figure.frames[-1], tip)])


def test_what_it_made_is_used_again_until_what_it_was_made_from_changes() -> None:
    problem, tool = _problem(), Still(1e-3)
    assert tool.solve(problem).solved
    tool.solve(problem)
    assert len(tool.models) == 1
    tool.solve(_problem())  # an equal figure is another model
    assert len(tool.models) == 2
    moved = wb.Problem(problem.scene, _problem(0.2).start, goals=problem.goals)
    tool.solve(moved)
    tool.solve(moved)
    assert len(tool.models) == 3


def test_an_answer_that_is_missing_is_the_start_with_its_reason() -> None:
    problem = _problem()
    problem.retarget([wb.Point(problem.scene.figure.frames[-1], (0.0, 0.0, 5.0))])
    solution = Still(1e-3, answers=False).solve(problem)
    assert not solution.solved
    assert solution.message.startswith("it found nothing")
    assert np.array_equal(solution.q, problem.start)


def test_a_tolerance_out_of_range_and_what_it_cannot_express_are_refused() -> None:
    with pytest.raises(InputError, match=r"tolerance is 0\.5"):
        Still(0.5)
    problem = _problem()
    held = wb.Problem(
        problem.scene,
        problem.start,
        goals=problem.goals,
        constraints=[wb.Plane(problem.scene.figure.frames[-1], normal=(0, 0, 1))],
    )
    tool = Still(1e-3)
    assert "still" in str(tool.accepts(held))
    with pytest.raises(InputError, match="still"):
        tool.solve(held)
