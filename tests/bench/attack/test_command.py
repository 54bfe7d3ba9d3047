"""`wholebody bench attack` from end to end, on a kind that takes no time."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path

import pytest

from tests.bench.bench_command import bench
from tests.csv_rows import csv_rows
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.bench.attack.judging import Case, Verdict

run = partial(bench, "attack")


def test_counts_and_failures_are_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    code = run("--cases", "12", "--kinds", "file", "--seed", "2", "--seconds", "900", "--out", str(out))
    rows = csv_rows(out / "attack.csv")
    wrong = [row for row in rows if row["outcome"] == "wrong"]
    assert len(rows) == 12
    assert {row["tool"] for row in rows} == {"file"}
    assert code == int(bool(wrong))
    for row in wrong:
        assert (out / row["case"] / "repeat.py").is_file()
    assert "mutated tasks" in (out / "attack.md").read_text()


def test_ctrl_c_leaves_what_ended_before_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def two(cases: Iterator[Case], *_: object) -> Iterator[tuple[Case, Verdict]]:
        for case in islice(cases, 2):
            yield case, Verdict("right", "nothing")
        raise KeyboardInterrupt

    monkeypatch.setattr("wholebody.bench.attack.running.attack", two)
    assert run("--out", str(tmp_path)) == 130
    rows = csv_rows(tmp_path / "attack.csv")
    assert [row["number"] for row in rows] == ["0", "1"]


def test_what_cannot_be_asked_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="solve"):
        run("--kinds", "solv")
    with pytest.raises(InputError, match="--seconds"):
        run("--seconds", "nan")
    with pytest.raises(InputError, match="--jobs"):
        run("--jobs", "0")
    with pytest.raises(InputError, match="--seed"):
        run("--seed", "-1")
