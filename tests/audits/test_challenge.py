"""`python -m tests.audits challenge`, as short as it can be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.audits.__main__ import main
from tests.audits.challenge import ChallengeRow
from wholebody.bench.measure.drag import DragFrameRow, drag_chart
from wholebody.bench.plot_style import method_style
from wholebody.bench.tables import read_rows


def test_both_methods_sit_down(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "results.md").write_text("<!-- bench:challenge -->\n<!-- /bench:challenge -->\n")
    command = ["challenge", "--quick", "--out", str(tmp_path / "out")]
    assert main([*command, "--update-docs", str(tmp_path)]) == 0
    facts, rows = read_rows(tmp_path / "out" / "challenge.csv", ChallengeRow)
    assert "processor" in facts
    assert [row.method.partition("/")[0] for row in rows] == ["newton", "qp"]
    for row in rows:
        assert row.status == "solved"
        assert 0.0 <= row.seat_mm < 1.0
        assert row.depth_mm < 0.1
        assert row.between_mm <= 1.0
        assert row.feet_mm < 2.0
        assert row.end_error_mm < 0.011
    _, frames = read_rows(tmp_path / "out" / "challenge-frames.csv", DragFrameRow)
    assert len(frames) == 120
    page = (tmp_path / "results.md").read_text()
    assert "| newton" in page
    assert "assets/bench/challenge.svg" in page
    assert (tmp_path / "assets" / "bench" / "challenge.svg").is_file()
    assert "over the seat" in capsys.readouterr().out


def test_a_method_has_the_colour_that_it_has_in_other_charts(tmp_path: Path) -> None:
    """Newton must not stand there in placo's colour."""
    frame = DragFrameRow("sit_on_chair", "newton", 0, 2.0, 1.0, 3, 1.0, 0.0, 0.0)
    drawn = drag_chart({"newton": [frame], "ccd": [replace(frame, method="ccd")]}, tmp_path / "chart.svg")[
        0
    ].read_text()
    assert method_style("newton").color == method_style("newton/slack").color
    assert all(method_style(name).color in drawn for name in ("newton/slack", "ccd"))
    assert all(method_style(name).color not in drawn for name in ("placo", "mink"))
