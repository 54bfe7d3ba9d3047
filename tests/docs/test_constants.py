"""The page on the QP method has the constants of its code."""

from __future__ import annotations

import runpy
from pathlib import Path


def test_the_tables_of_constants_are_those_of_the_code(root: Path) -> None:
    command = runpy.run_path(str(root / "docs/hooks/constants.py"))
    page = command["PAGE"].read_text(encoding="utf-8")
    assert command["refreshed"](page) == page, "run: python docs/hooks/constants.py"


def test_a_changed_value_and_a_row_that_is_gone_are_written_anew(root: Path) -> None:
    command = runpy.run_path(str(root / "docs/hooks/constants.py"))
    page = command["PAGE"].read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| `first_radius` |"))
    stale = row.replace("0.3", "0.4") + "\n| `gone` | 1 | nothing |"
    assert command["refreshed"](page.replace(row, stale)) == page
