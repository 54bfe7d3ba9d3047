"""`wholebody bench stability` from end to end: what is printed, and the files."""

from __future__ import annotations

import re
from functools import partial
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.bench.bench_command import bench
from tests.csv_rows import csv_rows
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.stability.asking import Cell, ask, judge
from wholebody.bench.suite.stability.catalogue import cases
from wholebody.bench.suite.stability.verdict import Result, report, result

CASES = ("out-by-1-mm", "edge-on-edge", "not-a-number")
METHODS = ("qp", "ccd")
run = partial(bench, "stability")


def test_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--methods", *METHODS, "--cases", *CASES, "--jobs", "2", "--out", str(tmp_path)) == 0
    rows = csv_rows(tmp_path / "stability.csv")
    assert [(row["case"], row["tool"]) for row in rows] == [(case, method) for case in CASES for method in METHODS]
    assert rows[0]["verdict"] == "honest"
    assert float(rows[0]["best known"]) == 1e-3
    assert rows[-1]["verdict"] == "refusal"
    assert "finite" in rows[-1]["sentence"]
    texts = " ".join(ElementTree.parse(tmp_path / "stability.svg").getroot().itertext())
    assert all(word in texts for word in ("Out of reach by 1 mm", "Edge on edge", "qp", "ccd", "●", "–"))
    assert "| `qp` | 0 | 2 | 1 | 0 | 3 |" in capsys.readouterr().out
    assert "- **Out of reach by 1 mm.**" in (tmp_path / "stability.md").read_text()


def test_without_names_those_methods_of_the_page_are_asked_that_are_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wholebody.cli.bench.hard_cases.installed", METHODS.__contains__)
    assert run("--cases", "not-a-number", "--out", str(tmp_path)) == 0
    rows = csv_rows(tmp_path / "stability.csv")
    assert {row["tool"] for row in rows} == {*METHODS}


@pytest.fixture(scope="module")
def found() -> Result:
    chosen, cells = cases(CASES[:2]), list[Cell]()
    for case, adapter in product(chosen, adapters(METHODS)):
        answer = ask(case, adapter)
        cells.append(Cell(case, adapter.name, answer, judge(case, answer)))
    return result(chosen, METHODS, cells)


def test_the_report_tells_every_case_with_its_verdicts(found: Result) -> None:
    text = report(found, {"wholebody": "1"})
    by_one, edges = found.cases
    assert f"- **{edges.title}.** {edges.why} {edges.acceptable}\n" in text
    (said,) = re.findall(rf"^- \*\*{by_one.title}\.\*\* .*{re.escape(by_one.acceptable)}(.*)$", text, re.MULTILINE)
    assert re.fullmatch(r"( ○ \+[\d.]+ [mµ]+: `ccd`\.)?", said)
    assert "| `qp` | 0 | 2 | 0 | 0 | 2 |" in text
