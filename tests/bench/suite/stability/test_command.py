"""`wholebody bench stability` from end to end: what is printed, and the files."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from wholebody.base.errors import FileFormatError, InputError, MissingPackageError, UnknownNameError
from wholebody.bench.suite.adapters import registry
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.stability import page
from wholebody.bench.suite.stability.asking import Cell, ask
from wholebody.bench.suite.stability.catalogue import cases
from wholebody.bench.suite.stability.judging import judge
from wholebody.bench.suite.stability.verdict import Result, StabilityRow, result
from wholebody.bench.tables import read_rows, write_rows
from wholebody.cli.bench import stability

CASES = ("out-by-1-mm", "edge-on-edge", "not-a-number")
METHODS = ("qp", "ccd")


hard_cases = sys.modules["wholebody.cli.bench.hard_cases"]


def bench(*words: str) -> int:
    parser = argparse.ArgumentParser()
    stability.add_to(parser.add_subparsers())
    arguments = parser.parse_args(["stability", *words])
    return int(arguments.run(arguments))


def test_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench("--methods", *METHODS, "--cases", *CASES, "--jobs", "2", "--out", str(tmp_path)) == 0
    _, rows = read_rows(tmp_path / "stability.csv", StabilityRow)
    assert [(row.case, row.method) for row in rows] == [(case, method) for case in CASES for method in METHODS]
    assert rows[0].verdict == "honest"
    assert rows[0].best == 1e-3
    assert rows[-1].verdict == "refusal"
    assert "finite" in rows[-1].sentence
    texts = " ".join(ElementTree.parse(tmp_path / "stability.svg").getroot().itertext())
    assert all(word in texts for word in ("Out of reach by 1 mm", "Edge on edge", "qp", "ccd", "●", "–"))
    assert "3 of 3" in capsys.readouterr().out
    assert "| out-by-1-mm |" in (tmp_path / "stability.md").read_text()


def test_an_earlier_run_is_told_again_and_nothing_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The rows are written by hand; the verdicts of the file count, and its figures are shortened for the chart."""
    row = StabilityRow(
        "edge-on-edge", "qp", "honest", True, "best known", "unreachable", 0.05, 0.05, 0, 0, 0, 1, 60.0, ""
    )
    told = ("hangs: no answer in 20 s of the processor", "34 mm inside, says unreachable", "claims solved, 1 mm left")
    told += ("12 mm inside on the way: tip and plate, frame 3", "ValueError: nothing", "3.1 times too fast")
    methods = ("dls", "ccd", "newton/slack", "newton/kkt", "qp/daqp", "qp/osqp")
    rows = [
        replace(row, method=name, verdict="wrong", figure=told, acceptable=False)
        for name, told in zip(methods, told, strict=True)
    ]
    write_rows(tmp_path / "earlier.csv", {"processor": "another one"}, [row, *rows])
    monkeypatch.setattr("wholebody.bench.suite.stability.asking.run", None)
    words = ("--from", str(tmp_path / "earlier.csv"), "--cases", "edge-on-edge", "--out", str(tmp_path / "out"))
    assert bench("--methods", "qp", *methods, *words) == 0
    text = (tmp_path / "out" / "stability.md").read_text()
    assert (
        "| edge-on-edge | ● best known | ✗ hangs | ✗ 34 mm | ✗ claims 1 mm | ✗ 12 mm way | ✗ error | ✗ 3.1 × speed |"
        in text
    )
    assert "its answers took 7 minutes by the clock" in text
    assert "processor another one" in text
    with pytest.raises(InputError, match="no answer of mink to edge-on-edge"):
        bench("--methods", "mink", *words)


def earlier(path: Path, cells: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Write a run of cases by methods; return the options that tell it again."""
    rows = [
        StabilityRow(case, method, "solved", True, "", "solved", 0, 0, 0, 0, 0, 1, 1.0, "")
        for case, methods in cells.items()
        for method in methods
    ]
    write_rows(path / "earlier.csv", {"processor": "another one"}, rows)
    return "--from", str(path / "earlier.csv"), "--out", str(path / "out")


def test_an_earlier_run_is_told_with_the_cases_and_methods_that_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No package of a method needs to be there, as nothing is asked."""
    monkeypatch.setattr(registry, "find_spec", lambda module: None)
    methods = ("mink", "newton/kkt", "ccd", "newton/slack")
    words = earlier(tmp_path, dict.fromkeys(("edge-on-edge", "out-by-1-mm"), methods))
    table = tmp_path / "out" / "stability.md"
    assert bench(*words) == 0
    assert "| case | mink | newton/kkt | ccd | newton/slack |" in table.read_text()
    assert "Of 2 cases each" in table.read_text()
    assert bench("--cases", "edge-on-edge", "--methods", "newton", "mink", *words) == 0
    assert "| case | newton/kkt | newton/slack | mink |" in table.read_text()
    assert "Of 1 cases each" in table.read_text()
    assert bench("--methods", "all", *words) == 0
    assert "| case | mink | newton/kkt | ccd | newton/slack |" in table.read_text()
    with pytest.raises(UnknownNameError, match="no method is called 'mimk'; did you mean mink"):
        bench("--methods", "mimk", *words)


def test_an_earlier_run_that_lacks_what_is_asked_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no answer of ccd to out-by-1-mm"):
        bench(*earlier(tmp_path, {"edge-on-edge": ("qp", "ccd"), "out-by-1-mm": ("qp",)}))
    words = earlier(tmp_path, {"edge-on-edge": ("qp",)})
    with pytest.raises(InputError, match="no answer of newton to edge-on-edge"):
        bench("--methods", "newton", *words)
    (tmp_path / hard_cases.PAGE).touch()
    with pytest.raises(InputError, match="no answer of"):  # the page has all cases and the methods of the page
        bench(*words, "--update-docs", str(tmp_path))
    with pytest.raises(UnknownNameError, match=r"earlier\.csv: no case is called 'edge-in-edge'"):
        bench(*earlier(tmp_path, {"edge-in-edge": ("qp",)}))
    path = tmp_path / "earlier.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:2]))
    with pytest.raises(FileFormatError, match="has no answers"):
        bench(*words)
    assert not (tmp_path / "out").exists()


def test_the_page_of_an_earlier_run_needs_the_packages_of_its_methods(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pictures are of answers that are asked for again; it is told before anything is written."""
    monkeypatch.setattr(registry, "find_spec", lambda module: None)
    words = earlier(tmp_path, {case.name: page.METHODS for case in cases()})
    (tmp_path / hard_cases.PAGE).touch()
    with pytest.raises(MissingPackageError, match="placo is not installed"):
        bench(*words, "--update-docs", str(tmp_path))
    assert not (tmp_path / "out").exists()


def test_pictures_of_an_earlier_run_show_what_it_found(found: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawn answers alone are asked for, and one of which something else comes now is not drawn."""
    drawn: list[tuple[str, str]] = []
    rows = {key: replace(row, verdict="solved") if row.case == CASES[0] else row for key, row in found.rows.items()}
    monkeypatch.setattr(
        "wholebody.bench.suite.stability.pictures.draw", lambda result, cells, *rest: drawn.extend(cells)
    )
    hard_cases._drawn(Result(found.cases, found.methods, rows), adapters(METHODS), Path("nowhere"), 1)
    assert drawn == [(CASES[1], "qp")]


def test_without_names_those_methods_of_the_page_are_asked_that_are_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "installed", METHODS.__contains__)
    assert bench("--cases", "not-a-number", "--out", str(tmp_path)) == 0
    _, rows = read_rows(tmp_path / "stability.csv", StabilityRow)
    assert {row.method for row in rows} == {*METHODS}


def test_a_page_is_whole_or_not_begun(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="all cases"):
        bench("--cases", *CASES, "--update-docs", str(tmp_path))
    with pytest.raises(InputError, match="there is no such page"):
        bench("--update-docs", str(tmp_path))


@pytest.fixture(scope="module")
def found() -> Result:
    chosen, cells = cases(CASES[:2]), list[Cell]()
    for case, adapter in product(chosen, adapters(METHODS)):
        answer = ask(case, adapter)
        cells.append(Cell(case, adapter.name, answer, judge(case, answer)))
    return result(chosen, METHODS, cells)


def test_the_page_tells_every_case_with_its_picture_and_verdicts(found: Result) -> None:
    drawn = {"edge-on-edge": [(Path("x/edge-on-edge.jpg"), "The answer of qp; transparent, the start.")]}
    text = page.page(found, adapters(METHODS), {"wholebody": "1"}, drawn, "assets/stability")
    for case in found.cases:
        assert f"### {case.title}\n\n{case.why}\n\n*Acceptable.* {case.acceptable}" in text
    assert "(assets/stability/edge-on-edge.jpg)" in text
    assert "| ● honest best effort: best known | `qp` |" in text
    assert "| `qp` | 0 | 2 | 0 | 0 | 0 | 2 |" in text
    assert "No answer was wrong." in text
    assert "`ccd`: wb.methods.CCD()" in text


def test_pictures_of_a_case(found: Result, tmp_path: Path) -> None:
    from wholebody.bench.suite.stability.pictures import draw
    from wholebody.view.browser import find_chromium

    if find_chromium() is None:
        pytest.skip("there is no Chromium")
    image = pytest.importorskip("PIL.Image")
    drawn = draw(found, found.cells, tmp_path)
    assert [path.name for path, _ in drawn["edge-on-edge"]] == ["edge-on-edge.jpg"]
    with image.open(tmp_path / "edge-on-edge.jpg") as picture:
        assert picture.size == (560, 420)
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 1000  # more than a background
