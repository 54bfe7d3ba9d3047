"""`wholebody bench attack` from end to end, on kinds that take no time."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from wholebody.bench.attack.report import Row
from wholebody.bench.tables import read_rows
from wholebody.cli.bench import add_to
from wholebody.errors import InputError, UnknownNameError


def bench(*words: str) -> int:
    parser = argparse.ArgumentParser()
    add_to(parser.add_subparsers())
    arguments = parser.parse_args(["bench", "attack", *words])
    return int(arguments.run(arguments))


def test_counts_failures_and_page_are_written(tmp_path: Path) -> None:
    docs, out = tmp_path / "docs", tmp_path / "out"
    docs.mkdir()
    (docs / "reliability.md").write_text("<!-- bench:attack -->\nold\n<!-- /bench:attack -->\n")
    words = ("--cases", "12", "--kinds", "file", "argument", "--seed", "2", "--out", str(out))
    code = bench(*words, "--update-docs", str(docs))
    _, rows = read_rows(out / "attack.csv", Row)
    wrong = [row for row in rows if row.outcome == "wrong"]
    assert len(rows) == 12
    assert {row.kind for row in rows} == {"file", "argument"}
    assert code == int(bool(wrong))
    for row in wrong:
        assert (out / f"{row.kind}-2-{row.number:06d}" / "repeat.py").is_file()
    page = (docs / "reliability.md").read_text()
    assert "\nold\n" not in page
    assert "calls with odd arguments" in page
    assert (out / "README.md").is_file()


def test_what_cannot_be_asked_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="solve"):
        bench("--kinds", "solv")
    with pytest.raises(InputError, match="--seconds"):
        bench("--seconds", "nan")
    with pytest.raises(InputError, match="--jobs"):
        bench("--jobs", "0")
    with pytest.raises(InputError, match="0 or more"):
        bench("--seed", "-1")
