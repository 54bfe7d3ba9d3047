"""`python -m tests.audits loads`, as short as it can be."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.audits.__main__ import main
from tests.audits.loads import WAYS, LoadRow
from wholebody.bench.tables import read_rows


def test_loads_of_a_freed_clip_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["loads", "--only", "squat", "--longest", "0.4", "--out", str(tmp_path)]
    assert main(words) == 0
    assert "avoided with dynamics" in capsys.readouterr().out
    rows = read_rows(tmp_path / "loads.csv", LoadRow)[1]
    assert [row.way for row in rows] == list(WAYS)
    assert rows[0].beyond == rows[0].farther_mm == 0.0
    assert all(row.frames == 13 for row in rows)
