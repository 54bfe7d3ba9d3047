"""Methods beside each other on a task of one's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.csv_rows import csv_rows
from wholebody.base.errors import UnknownNameError
from wholebody.bench.rows import Row
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.compare.own_task import compared, report
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
FIGURES = ("warm ms", "least ms", "most ms", "cold ms", "set-up ms", "goals mm", "goals mrad", "overlap mm",
           "clearance missed mm", "limits and constraints 1e-3", "effort")  # fmt: skip
ROW = Row("task", "qp", {"outcome": "solved", "said": "", **dict.fromkeys(FIGURES, 1.0), "worst": 1e-5})
REFUSED = Row("task", "dls", {"outcome": "refused", "said": "Balance cannot be taken"})


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
    best, refused = csv_rows(out / "task.csv")
    assert (best["tool"], best["outcome"]) == ("qp", "solved")
    assert float(best["goals mm"]) <= 0.2
    assert float(best["overlap mm"]) < 0.01
    assert float(best["least ms"]) <= float(best["warm ms"]) <= float(best["most ms"])
    assert float(best["cold ms"]) > float(best["least ms"])
    assert best["peak MB"] == "" or 50.0 < float(best["peak MB"]) < 4000.0  # an interpreter with Pinocchio
    assert (refused["tool"], refused["outcome"], refused["warm ms"]) == ("dls", "refused", "")
    assert "A hand in front" in (out / "task.md").read_text()
    assert (out / "task.svg").stat().st_size > 1000


def test_what_takes_too_long_is_ended_and_shown(task: Path) -> None:
    (row,) = compared(task, adapters(["qp"]), cap=1e-4)
    assert row["outcome"] == "overtime"
    assert "worst" not in row.figures


def test_a_wrong_answer_is_not_called_solved_and_refusals_have_no_figures() -> None:
    off = Row("task", "ccd", {**ROW.figures, "outcome": "not solved", "worst": 0.5})
    text = report([ROW, off, REFUSED], "three", {})
    assert text.count("| three | qp | solved |") == text.count("| three | ccd | not solved |") == 1
    assert "| dls |" not in text
    assert "`dls`, refused: Balance cannot be taken" in text


def test_nothing_is_solved_where_the_question_is_none(
    task: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "compare", "--task", str(task), "--sets", "clutter"]) == 2
    assert "--sets does not go with --task; leave one out" in capsys.readouterr().err
    with pytest.raises(UnknownNameError, match=r"none\.toml"):
        compared(tmp_path / "none.toml", adapters(["qp"]))
