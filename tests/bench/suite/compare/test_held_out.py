"""Held-out distributions beside the sets that constants were tuned on."""

from __future__ import annotations

from math import nan
from pathlib import Path
from typing import get_type_hints

import pytest

from wholebody.bench.statistics import NOTHING, Interval, wilson
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.compare.held_out import beside, report, settings
from wholebody.bench.suite.compare.summary import Summary
from wholebody.cli import main


def row(family: str, method: str, solved: int, cases: int, refused: int = 0) -> Summary:
    low, high = wilson(solved, cases)
    values = {
        name: {str: "", int: 0, float: nan, Interval: NOTHING}[kind] for name, kind in get_type_hints(Summary).items()
    }
    values |= {"set": family, "method": method, "cases": cases, "refused": refused}
    values |= {"success": Interval(solved / cases, low, high)}
    return Summary(**values)


def test_each_stands_beside_its_own_set() -> None:
    rows = [row("other_people", "qp", 40, 40), row("clutter", "qp", 39, 40), row("other_clutter", "qp", 38, 40)]
    found = beside(rows)
    assert list(found) == ["other_people", "other_clutter"]
    (one,) = found["other_people"]
    assert one.held_out is rows[0]
    assert one.tuned_on is rows[1]


def test_where_there_are_no_robots_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WHOLEBODY_ROBOTS", raising=False)
    asked, left_out = settings(adapters(["qp"]), 3, 0, 1.0)
    assert "robots" not in {family.name for family in asked.sets}
    assert "WHOLEBODY_ROBOTS" in left_out
    text = report([row("other_people", "qp", 3, 3), row("clutter", "qp", 3, 3, refused=3)], asked, left_out, {})
    assert "The robots are left out" in text
    assert "| other people | qp | 100.0 % [44, 100] of 3 |" in text
    assert "refused" in text


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WHOLEBODY_ROBOTS", raising=False)
    words = [
        "bench",
        "compare",
        "--held-out",
        "--cases",
        "1",
        "--methods",
        "qp",
        "--minutes",
        "2",
        "--out",
        str(tmp_path),
    ]
    assert main(words) == 0
    text = (tmp_path / "held-out.md").read_text()
    for title in ("uniform witnesses", "other people", "other clutter"):
        assert f"| {title} | qp |" in text
    assert main([*words[:4], "0"]) == 2
