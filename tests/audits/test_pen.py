"""What moves by itself for seconds stays in its pen and out of each other."""

from __future__ import annotations

from pathlib import Path

from tests.audits.__main__ import main
from tests.csv_rows import csv_rows


def test_the_command_writes_a_row(tmp_path: Path) -> None:
    assert main(["pen", "--quick", "--out", str(tmp_path)]) == 0
    (row,) = csv_rows(tmp_path / "pen.csv")
    assert row["outside"] == "0"
    assert float(row["deepest mm"]) <= 0.1
