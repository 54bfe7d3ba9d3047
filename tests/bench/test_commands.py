"""`wholebody bench` from end to end, as short as it can be: files, tables, charts, page."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from wholebody.bench import plot_style
from wholebody.bench.measure.reaches import ReachRow
from wholebody.bench.measure.solve import MemoryRow, SolveRow
from wholebody.bench.measure.step import StepRow, StepTime
from wholebody.bench.measure.track import VARIANTS
from wholebody.bench.suite.adapters.registry import STEPPING
from wholebody.bench.tables import read_rows
from wholebody.cli.bench import add_to

MARKERS = "\n".join(f"<!-- bench:{name} -->\n<!-- /bench:{name} -->" for name in ("step", "reaches", "solve"))


def bench(*words: str) -> int:
    parser = argparse.ArgumentParser()
    add_to(parser.add_subparsers())
    arguments = parser.parse_args(["bench", *words])
    return int(arguments.run(arguments))


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    folder = tmp_path / "docs"
    folder.mkdir()
    (folder / "results.md").write_text(MARKERS)
    return folder


def test_step(tmp_path: Path, docs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    reaches = VARIANTS[1:]
    monkeypatch.setattr("wholebody.bench.measure.track.VARIANTS", reaches)
    pytest.importorskip("placo", reason="placo is not installed, with which steps are compared")
    words = ("--repeats", "2", "--steps", "6", "--tools", "wholebody/daqp", "placo", "--out", str(tmp_path / "out"))
    assert bench("step", *words, "--update-docs", str(docs)) == 0
    facts, rows = read_rows(tmp_path / "out" / "step.csv", StepRow)
    assert facts["steps"] == "6"
    assert [(row.reach, row.tool) for row in rows] == [
        (reach, tool) for reach in reaches for tool in ("wholebody/daqp", "placo")
    ]
    for row in rows:
        assert 0.0 < row.median_us <= row.p95_us
        assert (row.pairs >= 700) == (row.reach != "alone")
        assert row.limit_violation < 1e-9
        assert row.tool != "placo" or row.ratio.value == row.ratio_p95.value == 1.0
    _, times = read_rows(tmp_path / "out" / "step-times.csv", StepTime)
    assert len(times) == len(reaches) * 2 * 2 * 6
    page = (docs / "results.md").read_text()
    assert "| placo |" in page
    assert "assets/bench/step-times.svg" in page
    assert (docs / "assets" / "bench" / "step-times.svg").read_text().startswith("<?xml")
    assert (tmp_path / "out" / "step-distances.png").read_bytes().startswith(b"\x89PNG")
    assert "1342 pairs" in capsys.readouterr().out


def test_reaches(tmp_path: Path, docs: Path) -> None:
    words = ("--count", "2", "--first", "5", "--methods", "qp/daqp", "--out", str(tmp_path / "out"))
    assert bench("solve", "--parts", "reaches", *words, "--update-docs", str(docs)) == 0
    _, rows = read_rows(tmp_path / "out" / "reaches.csv", ReachRow)
    assert [row.seed for row in rows] == [5, 6]
    assert "seeds 5 to 6" in (docs / "results.md").read_text()


def test_a_chart_that_fails_loses_no_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables and report are written before anything is drawn."""

    def fails(*_: object) -> None:
        raise RuntimeError("no chart")

    monkeypatch.setattr(plot_style, "save", fails)
    out = tmp_path / "out"
    with pytest.raises(RuntimeError, match="no chart"):
        bench("solve", "--parts", "reaches", "--count", "1", "--first", "5", "--methods", "qp/daqp", "--out", str(out))
    _, rows = read_rows(out / "reaches.csv", ReachRow)
    assert [row.seed for row in rows] == [5]
    assert (out / "reaches.md").is_file()


SHELF = """title = "Shelf"
figure.name = "urdf"
figure.path = "{}"

[[goal]]
type = "point"
frame = "tool"
target = [0.3, 0.1, 0.5]
"""


def test_solve(tmp_path: Path, docs: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shelf is here a task of an arm, and there is no Chromium for its picture."""
    task = tmp_path / "shelf.toml"
    task.write_text(SHELF.format(root / "tests/data/arm/arm.urdf"))
    monkeypatch.setattr("wholebody.cli.demo.packaged_tasks", lambda: {"shelf": task})
    monkeypatch.setenv("WHOLEBODY_CHROMIUM", str(tmp_path / "none"))
    words = ("--count", "1", "--methods", "qp/daqp", "--out", str(tmp_path / "out"), "--update-docs", str(docs))
    assert bench("solve", "--parts", "task", *words) == 0
    _, rows = read_rows(tmp_path / "out" / "solve.csv", SolveRow)
    assert [row.way for row in rows] == ["cold", "warm"]
    assert all(row.median_ms > 0.0 and row.pairs > 0 for row in rows)
    _, (memory,) = read_rows(tmp_path / "out" / "memory.csv", MemoryRow)
    assert 50.0 < memory.peak_mb < 2000.0  # an interpreter with Pinocchio, not a machine full
    assert "shelf" in (docs / "results.md").read_text()


def test_charts_are_the_same_for_the_same_numbers(tmp_path: Path) -> None:
    from wholebody.bench.measure import step as steps

    times = [
        StepTime(reach, tool, 1, step, 100.0 + 13.0 * step, 90.0, 20.0 - step)
        for reach in VARIANTS
        for tool in ("placo", "wholebody")
        for step in range(1, 30)
    ]
    for draw in (steps.step_times, steps.least_distances):
        once, again = (draw(times, tmp_path / name) for name in ("a", "b"))
        assert [path.read_bytes() for path in once] == [path.read_bytes() for path in again]


def test_a_tool_that_does_not_take_a_figure_is_named_in_the_chart(tmp_path: Path) -> None:
    from wholebody.bench.measure import step as steps

    times = [StepTime(reach, "wholebody", 1, 1, 100.0, 90.0, 20.0) for reach in ("arm, free", "robot, free")]
    times += [StepTime("arm, free", "mink", 1, 1, 300.0, 290.0, 20.0)]
    svg, _ = steps.step_times(times, tmp_path / "times")
    assert svg.is_file()


def test_every_tool_has_a_colour_of_its_own() -> None:
    assert set(STEPPING) <= set(plot_style.COLORS)
    assert plot_style.method_style("qp").color == plot_style.COLORS["wholebody"]  # the same method in another chart
    assert len(set(plot_style.COLORS.values())) == len(plot_style.COLORS)


@pytest.mark.parametrize("words", [("step", "--repeats", "0"), ("solve", "--jobs", "0"), ("solve", "--count", "-1")])
def test_counts_below_one_are_refused(words: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="give 1 or more"):
        bench(*words)
