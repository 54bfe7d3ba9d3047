"""`wholebody bench` from end to end, as short as it can be: files, tables, charts, page."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.bench_command import bench
from tests.csv_rows import csv_rows
from wholebody.bench import plot_style
from wholebody.bench.measure.track import VARIANTS
from wholebody.bench.rows import Panel, chart, shares
from wholebody.bench.suite.adapters.registry import STEPPING, adapters


def test_step(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    reaches = VARIANTS[1:2]
    monkeypatch.setattr("wholebody.cli.bench.measurements.VARIANTS", reaches)
    pytest.importorskip("placo", reason="placo is not installed, with which steps are compared")
    words = ("--repeats", "1", "--steps", "6", "--tools", "wholebody/retarget", "placo", "--out", str(tmp_path / "out"))
    assert bench("step", *words) == 0
    rows = csv_rows(tmp_path / "out" / "step-time.csv")
    each = [(reach, tool) for reach in reaches for tool in ("wholebody/retarget", "placo", "Pinocchio and coal")]
    assert [(row["case"], row["tool"]) for row in rows] == each
    for row in rows:
        assert 0.0 < float(row["median µs"]) <= float(row["p95 µs"])
        ours = row["tool"] == "wholebody/retarget"
        assert not ours or float(row["median × Pinocchio and coal"].split()[0]) > 1.0
        assert row["tool"] != "placo" or float(row["median × placo"]) == float(row["p95 × placo"]) == 1.0
    for row in csv_rows(tmp_path / "out" / "step-result.csv"):
        assert int(row["pairs"]) >= 700
        assert float(row["beyond limits rad"]) < 1e-9
    report = (tmp_path / "out" / "step.md").read_text()
    assert "contact, median × placo" in report
    assert "| contact | placo |" in report
    assert report.endswith("least distance of any pair](step.svg)\n")
    assert (tmp_path / "out" / "step.svg").read_text().startswith("<?xml")
    assert (tmp_path / "out" / "step.png").read_bytes().startswith(b"\x89PNG")
    assert "pairs that can touch" in capsys.readouterr().out


def test_a_chart_that_fails_loses_no_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables and report are written before anything is drawn."""

    def fails(*_: object) -> None:
        raise RuntimeError("no chart")

    monkeypatch.setattr(plot_style, "save", fails)
    monkeypatch.setattr("wholebody.cli.bench.measurements.VARIANTS", VARIANTS[2:])
    out = tmp_path / "out"
    with pytest.raises(RuntimeError, match="no chart"):
        bench("step", "--repeats", "1", "--steps", "2", "--tools", "wholebody", "--out", str(out))
    assert {row["case"] for row in csv_rows(out / "step-time.csv")} == set(VARIANTS[2:])
    assert (out / "step.md").is_file()


def test_charts_are_the_same_for_the_same_numbers(tmp_path: Path) -> None:
    times = {tool: [100.0 + 13.0 * step for step in range(30)] for tool in ("placo", "wholebody")}
    distances = {tool: (range(30), [20.0 - step for step in range(30)]) for tool in times}
    panels = [shares("free", "time [µs]", times), Panel("free", "step", "mm", distances, levels=(0.0, 10.0))]
    once, again = (chart(panels, tmp_path / name) for name in ("a", "b"))
    assert [path.read_bytes() for path in once] == [path.read_bytes() for path in again]


def test_every_tool_has_a_colour_of_its_own() -> None:
    assert {name.replace("wholebody", "qp") for name in STEPPING} <= set(plot_style.STYLE["methods"])
    assert plot_style.method_style("qp") == plot_style.method_style("wholebody")  # the same method in another chart
    colors = [color for color, _ in plot_style.STYLE["methods"].values()]
    assert len(set(colors)) == len(colors)
    usual = {adapter.name for adapter in adapters(starts=True)}
    assert len({plot_style.method_style(name) for name in usual}) == len(usual)
