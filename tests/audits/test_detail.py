"""Levels of modelling are judged in the finest model."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from tests.audits.detail import LEVELS, detail_summary, levels, of_figure
from wholebody.bench.measure.scaling import TIP, chain, task
from wholebody.bench.rows import Row
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.figures.state import State

ERRORS = {"clearance missed mm": 0.0, "goal missed mm": 0.0}
SIZES = {"pairs": 700, "judgement ms": 2.0, "leaving out ms": 0.0}


def test_errors_count_where_a_model_calls_its_answer_solved() -> None:
    def row(status: str, deepest: float, above: float, spent: float) -> Row:
        figures = {"status": status, "deepest mm": deepest, "effort above %": above, "a solve ms": spent}
        return Row("clutter", "hulls, all", {**figures, **SIZES, **ERRORS})

    rows = [row("solved", 0.0, 0.0, 10.0), row("unreachable", 5.0, 900.0, 10.0), row("solved", 0.3, 20.0, 30.0)]
    (one,) = detail_summary(rows)
    assert (one["solved"], one["inside"], one["a solve ms"]) == ("2 of 3", 1, 10.0)
    assert (one["worst deepest mm"], one["worst effort above %"]) == (0.3, 20.0)


def test_levels_are_judged_in_the_finest_model() -> None:
    scene, target = task(chain(5, 1), 30, 3)
    problem = wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=0.002)
    found = list(levels("arm", {"own": problem}))
    assert [row.tool for row in found] == [f"own, {level}" for level in LEVELS]
    assert found[0]["effort above %"] == 0.0
    for row in found:
        assert row["status"] == "solved"
        assert row["deepest mm"] < 1e-3
        assert row["clearance missed mm"] < 0.1
    assert found[1]["pairs"] < found[0]["pairs"]


def test_a_person_is_asked_the_same_in_another_detail() -> None:
    given = SETS["clutter"].make(0, 0).problem
    figure = wb.load("human", detail="hulls")
    made = of_figure(figure, given)
    assert made.scene.figure is figure
    assert np.array_equal(made.start, given.start)
    assert made.clearance == given.clearance
    assert list(made.scene.objects) == list(given.scene.objects)
    here, there = State(figure.model).update(made.start), State(given.scene.model).update(given.start)
    for one, other in zip([*made.goals, *made.measures], [*given.goals, *given.measures], strict=True):
        assert type(one) is type(other)
    np.testing.assert_allclose(made.goals[0].error(here), given.goals[0].error(there), atol=1e-9)
