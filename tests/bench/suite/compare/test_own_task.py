"""Methods beside each other on a task of one's own."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan, nan
from pathlib import Path

import pytest

from wholebody.base.errors import UnknownNameError
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.compare.own_task import TaskRow, chart, compared, report
from wholebody.bench.tables import read_rows
from wholebody.cli import main

TASK = """
title = "A hand in front"
figure.name = "human"
constraint = [{ type = "balance" }, { type = "hold", frame = "left_foot" }, { type = "hold", frame = "right_foot" }]

[[goal]]
type = "point"
frame = "right_index_tip"
target = [0.45, -0.2, 1.1]
"""
ROW = TaskRow("qp", "solved", "", 50.0, 5.0, 4.0, 6.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0, 1.0, 1e-5)
REFUSED = replace(
    ROW, method="dls", outcome="refused", said="Balance cannot be taken", warm_ms=nan, cold_ms=nan, worst=inf
)


@pytest.fixture
def task(tmp_path: Path) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(TASK)
    return path


def test_the_command_solves_judges_and_shows_refusals(task: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = task.parent / "out"
    assert main(["bench", "compare", "--task", str(task), "--methods", "dls", "qp", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Balance" in said  # in the words of the method that refuses it
    _, (best, refused) = read_rows(out / "task.csv", TaskRow)
    assert (best.method, best.outcome) == ("qp", "solved")
    assert best.goal_mm <= 0.2
    assert best.overlap_mm < 0.01
    assert best.least_ms <= best.warm_ms <= best.most_ms
    assert best.cold_ms > best.least_ms
    assert (refused.method, refused.outcome, isnan(refused.warm_ms)) == ("dls", "refused", True)
    assert "A hand in front" in (out / "task.md").read_text()
    assert (out / "task.svg").stat().st_size > 1000


def test_what_takes_too_long_is_ended_and_shown(task: Path) -> None:
    (row,) = compared(task, adapters(["qp"]), cap=1e-4)
    assert (row.outcome, row.worst) == ("overtime", inf)


def test_a_wrong_answer_is_not_called_solved_and_refusals_have_no_figures(tmp_path: Path) -> None:
    off = replace(ROW, method="ccd", outcome="not solved", worst=0.5)
    assert not off.solved
    text = report([ROW, off, REFUSED], "three", {})
    assert text.count("| qp |") == text.count("| ccd |") == 1
    assert "| dls |" not in text
    assert "`dls`, refused: Balance cannot be taken" in text
    svg, png = chart([ROW, off, REFUSED], "three", tmp_path / "task")
    assert "refused" in svg.read_text()
    assert png.is_file()


def test_nothing_is_solved_where_the_question_is_none(
    task: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "compare", "--task", str(task), "--sets", "clutter"]) == 2
    assert "--sets does not go with --task; leave one out" in capsys.readouterr().err
    with pytest.raises(UnknownNameError, match=r"none\.toml"):
        compared(tmp_path / "none.toml", adapters(["qp"]))
