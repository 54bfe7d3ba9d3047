"""`wholebody bench solve --parts detail`: rows held against the finest model, and the command end to end."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.measure import detail
from wholebody.bench.measure.chains import TIP, chain, task
from wholebody.bench.measure.detail import LEVELS, DetailRow
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.tables import read_rows
from wholebody.cli.bench import add_to
from wholebody.figures.state import State

ROW = DetailRow("clutter", 0, "hulls", "all", 55, 700, "solved", 10.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def test_errors_count_where_a_model_calls_its_answer_solved() -> None:
    wrong = replace(ROW, case=1, status="unreachable", penetration_mm=5.0, above=float("nan"))
    deep = replace(ROW, case=2, penetration_mm=0.3, above=0.2, solve_ms=30.0)
    (one,) = detail.summaries([ROW, wrong, deep])
    assert (one.cases, one.solved, one.inside) == (3, 2, 1)
    assert one.worst_penetration_mm == 0.3
    assert one.solve_ms == 10.0
    assert one.above == pytest.approx(0.1)
    assert one.worst_above == pytest.approx(0.2)
    assert "| 2 of 3 |" in detail.report([ROW, wrong, deep], ["spheres: not asked"], {"wholebody": "1"})


def test_levels_are_judged_in_the_finest_model() -> None:
    figure = chain(5, 1)
    scene, target = task(figure, 30, 3)
    problem = wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=0.002)
    found = list(detail._levels("arm", 0, {"own": problem}, "own"))
    assert [row.level for row in found] == list(LEVELS)
    assert found[0].above == 0.0
    for row in found:
        assert row.status == "solved"
        assert row.penetration_mm < 1e-3
        assert row.clearance_violation_mm < 0.1
        assert row.freedoms == 5
    assert found[2].pairs == found[3].pairs < found[0].pairs == found[1].pairs


def test_a_person_is_asked_the_same_in_another_detail() -> None:
    given = SETS["clutter"].make(0, 0).problem
    figure = wb.load("human", detail="hulls")
    made = detail._with(figure, given)
    assert made.scene.figure is figure
    assert np.array_equal(made.start, given.start)
    assert made.clearance == given.clearance
    assert list(made.scene.objects) == list(given.scene.objects)
    here, there = State(figure.model).update(made.start), State(given.scene.model).update(given.start)
    for one, other in zip([*made.goals, *made.measures], [*given.goals, *given.measures], strict=True):
        assert type(one) is type(other)
    np.testing.assert_allclose(made.goals[0].error(here), given.goals[0].error(there), atol=1e-9)


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = [
        replace(ROW, task=name, detail=kind, level=level, solve_ms=5.0 + len(level))
        for name, kinds in (("clutter", detail.DETAILS), ("arm", ("own",)))
        for kind in kinds
        for level in LEVELS
    ]
    monkeypatch.setattr(detail, "rows", lambda cases, seed: iter([*made, "whole body, spheres: not asked"]))
    (tmp_path / "results.md").write_text("<!-- bench:detail -->\n<!-- /bench:detail -->")
    parser = argparse.ArgumentParser()
    add_to(parser.add_subparsers())
    words = [
        "bench",
        "solve",
        "--parts",
        "detail",
        "--count",
        "1",
        "--out",
        str(tmp_path / "out"),
        "--update-docs",
        str(tmp_path),
    ]
    arguments = parser.parse_args(words)
    assert arguments.run(arguments) == 0
    _, found = read_rows(tmp_path / "out" / "detail.csv", DetailRow)
    assert found == made
    assert "assets/bench/detail.svg" in (tmp_path / "results.md").read_text()
    assert "whole body, spheres: not asked" in (tmp_path / "results.md").read_text()
