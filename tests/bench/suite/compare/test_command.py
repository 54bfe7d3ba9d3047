"""`wholebody bench compare` from end to end, as short as it can be."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import pytest

from tests.bench.bench_command import bench
from tests.csv_rows import csv_rows
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.bench.suite.compare import report
from wholebody.bench.suite.compare.lock import read_lock

run = partial(bench, "compare")


def test_two_methods_on_one_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--quick", "--cases", "1", "--sets", "robot_arm", "--methods", "qp/osqp", "dls", "--out", str(tmp_path))
    assert run(*words) == 0
    assert "report.html" in capsys.readouterr().out
    assert "# cases beside each other: 1 on this machine\n" in (tmp_path / "solves.csv").read_text()
    assert {row["method"] for row in csv_rows(tmp_path / "solves.csv")} == {"qp/osqp", "dls"}
    assert "Robot arm" in (tmp_path / "report.html").read_text()
    with pytest.raises(InputError, match=r"holds a run with seeds = \[0, 1, 2\], and \[3, 4, 5\] is asked for"):
        run(*words, "--seed", "3")
    drawn = {chart.stem: (chart, chart) for chart in (tmp_path / "charts").glob("*.svg")}
    monkeypatch.setattr(report, "draw_all", lambda *_: drawn)  # to draw is most of the time
    assert run("--again", str(tmp_path / "lock.json"), "--out", str(tmp_path / "again")) == 0
    assert re.search(r"\d+ figures compared; ", capsys.readouterr().out)
    first, again = (read_lock(folder / "lock.json") for folder in (tmp_path, tmp_path / "again"))
    assert again.amounts == first.amounts
    assert {one for one in again.figures if one[2] == "solved"} == {
        ("robot_arm", name, "solved") for name in ("qp/osqp", "dls")
    }


def test_what_cannot_be_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean clutter"):
        run("--sets", "cluter", "--out", str(tmp_path / "a"))
    with pytest.raises(UnknownNameError, match="did you mean"):
        run("--methods", "qp/ospq", "--out", str(tmp_path / "b"))
    for option in ("--jobs", "--cases"):
        with pytest.raises(InputError, match="give 1 or more"):
            run(option, "0", "--out", str(tmp_path / "c"))
    assert not list(tmp_path.iterdir())
