"""The page on the QP method has the constants of its code."""

from __future__ import annotations

import runpy
from pathlib import Path


def test_the_tables_of_constants_are_those_of_the_code(root: Path) -> None:
    command = runpy.run_path(str(root / "docs/hooks/constants.py"))
    page = command["PAGE"].read_text(encoding="utf-8")
    assert command["refreshed"](page) == page, "run: python docs/hooks/constants.py"


def test_a_changed_value_is_written_and_what_it_trades_is_kept(root: Path) -> None:
    command = runpy.run_path(str(root / "docs/hooks/constants.py"))
    page = command["PAGE"].read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| `BAND` |"))
    stale = row.replace("0.02", "0.03") + "\n| `GONE` | 1 | nothing |"
    assert command["refreshed"](page.replace(row, stale)) == page
