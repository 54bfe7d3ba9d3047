"""What the measurement of every day's work counts."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from wholebody.bench import daily
from wholebody.bench.daily import DailyRow, drag, maps, processor_seconds, reach, report
from wholebody.cli.main import main


def test_the_processor_seconds_of_children_count() -> None:
    before = processor_seconds()
    busy = "import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True)\ninput()"
    with subprocess.Popen([sys.executable, "-c", busy], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert processor_seconds() - before >= 0.27  # the clock has ticks of 10 ms
        child.communicate(b"\n")


def test_a_small_map_has_every_place_once() -> None:
    row = reach((3, 2, 2))
    assert row.count == 12
    assert sum(int(part.split()[0]) for part in row.told.split(", ")) >= 12
    assert row.cpu > 0.0


def test_a_drag_stays_out_of_the_boxes() -> None:
    pytest.importorskip("viser")
    row = drag(10)
    assert 0.0 < row.cpu <= row.p95
    assert float(row.told.split()[2]) <= 0.1


def test_two_processes_find_what_one_does() -> None:
    one, two = maps([(3, 2, 2)])
    assert (one.processes, two.processes) == (1, 2)
    assert two.told.split("; ")[1] == one.told
    assert min(one.clock, two.clock) > 0.0


def test_the_table_has_a_line_for_each_row() -> None:
    rows = [
        DailyRow("reach map", 10_000, 2, 12.5, 0.0, 7.0, 90.0, "9,000 reached"),
        DailyRow("frame", 3, 1, 0.002, 0.004, 0.0021, 0.0, ""),
    ]
    text = report(rows, {"processor": "X", "cores": "2", "load": "0.1 in the minute before"})
    assert "| reach map | 10,000 | 2 | 12,500.0 |  | 7,000.0 | 90,000.0 | 9,000 reached |" in text
    assert "| frame | 3 | 1 | 2.0 | 4.0 | 2.1 |  |  |" in text


def test_a_part_is_measured_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(daily, "GRIDS", ((3, 2, 2),))
    assert main(["bench", "daily", "--quick", "--parts", "maps", "--out", str(tmp_path)]) == 0
    assert "reach map, 12, processes 2" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"daily-maps.csv", "daily-maps.md"}
