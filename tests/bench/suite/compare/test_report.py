"""What a run leaves: charts, a report that needs no network and says what was left out, and the page of results."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from types import ModuleType

import pytest

from tests.csv_rows import csv_rows
from wholebody.bench import plot_style
from wholebody.bench.suite.compare import report as publishing
from wholebody.bench.suite.compare.results import ANSWERED, OVERTIME, REFUSED, Chunk, Record, Store
from wholebody.bench.suite.compare.run import Settings

FACTS = {"wholebody": "0", "processor": "a fast one", "date": "2030-01-02"}
REFUSAL = "it cannot take <goals[0]>, Point"
FETCHED = re.compile(
    r"""(?:src|href|action)\s*=\s*["']?\s*(?:https?:)?//|url\(\s*["']?(?:https?:)?//|@import|fetch\("""
)


def record(adapter: str, number: int, tolerance: float, seconds: float, error: float) -> Record:
    return Record(
        "arm", number, adapter, tolerance, 0, ANSWERED, "solved", "", seconds, seconds, goal_error=error,
        goal_angle=0.0, penetration=0.0, clearance_violation=0.0, limit_violation=0.0, constraint_violation=0.0,
        measure=1.0, optimality=0.0, best=1.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def asked(fakes: ModuleType) -> Settings:
    return Settings((fakes.SET,), tuple(fakes.adapter(name) for name in ("solves", "lies", "refuses", "hangs")), 9, 2)


@pytest.fixture(scope="module")
def folder(asked: Settings, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run of two cases whose records are made by hand, with its report."""
    place = tmp_path_factory.mktemp("report")
    store = Store(place / "out", asked.described())
    for number in range(2):
        records = [record("solves", number, 10.0**-k, 0.01 * k, 10.0**-k / 2) for k in (2, 4, 6)]
        records += [record("lies", number, 10.0**-k, 0.001 * k, 0.4) for k in (2, 4, 6)]
        records.append(Record("arm", number, "refuses", 1e-4, 0, REFUSED, said=REFUSAL))
        records.append(Record("arm", number, "hangs", 1e-4, 0, OVERTIME, said="ended after 20 s"))
        store.add(f"arm {number}", Chunk("arm", number, tuple(records)))
    missing = {"mink": "pip install 'wholebody[compare]'"}
    publishing.publish(asked, store, place / "out", FACTS, missing)
    return place


def test_every_solve_is_in_the_table(folder: Path) -> None:
    path = folder / "out" / "solves.csv"
    assert "# processor: a fast one\n" in path.read_text()
    rows = csv_rows(path)
    assert len(rows) == 16
    assert [row["goal_error"] for row in rows if row["method"] == "refuses"] == ["inf", "inf"]


def test_charts_are_there_in_both_kinds(folder: Path) -> None:
    for name, label in (
        ("compare-arm", "time of a solve [ms]"),
        ("compare-overview", "solved [%]"),
    ):
        assert (folder / "out" / "charts" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert label in (folder / "out" / "charts" / f"{name}.svg").read_text()


def test_the_report_has_intervals_and_says_how_methods_were_set_up(folder: Path) -> None:
    page = (folder / "out" / publishing.PAGE).read_text()
    assert "100.0 % [34, 100]" in page  # two of two, by Wilson
    assert "a fake that lies; it lies; wb.Fake() is code." in page


def test_the_report_asks_the_network_for_nothing(folder: Path) -> None:
    page = (folder / "out" / publishing.PAGE).read_text()
    assert not FETCHED.search(page)
    assert page.count("<svg") == 2


def test_names_within_the_charts_do_not_meet(folder: Path) -> None:
    page = (folder / "out" / publishing.PAGE).read_text()
    names = re.findall(r'\sid="([^"]+)"', page)
    assert len(names) == len(set(names))
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', page))
    assert used <= set(names)


def test_the_report_says_what_was_left_out_and_why(folder: Path) -> None:
    page = (folder / "out" / publishing.PAGE).read_text()
    assert "it cannot take &lt;goals[0]&gt;, Point" in page
    assert "ended after 20 s" in page
    assert "2 of 9" in page  # problems that there was time for
    assert "pip install" in page
    assert "If in doubt, take <code>solves</code>" in page


def test_the_charts_of_the_report_are_there(folder: Path) -> None:
    names = re.findall(r"\]\((charts/[^)]+)\)", (folder / "out" / "compare.md").read_text())
    assert any("overview" in name for name in names)
    assert all((folder / "out" / name).is_file() for name in names)


@pytest.mark.parametrize("span", [(2.0, 30.0), (1.0, 900.0), (0.01, 20000.0)])
def test_labels_of_a_logarithmic_axis_do_not_overlap(span: tuple[float, float]) -> None:
    """In the narrowest panels of the charts: two in a row of eleven inches."""
    chart, axes = plot_style.figure(1, 2, (11.0, 4.0))
    axes[0][0].plot(span, (0.0, 1.0))
    plot_style.plain_log(axes[0][0])
    chart.draw_without_rendering()
    low, high = axes[0][0].get_xlim()
    boxes = [
        label.get_window_extent()
        for label in axes[0][0].get_xticklabels()
        if label.get_text() and low <= label.get_position()[0] <= high
    ]
    assert len(boxes) >= 3
    assert all(one.x1 + 2.0 < other.x0 for one, other in itertools.pairwise(boxes))
