from __future__ import annotations

import re
from pathlib import Path

import wholebody as wb
from tests.audits.taskfile import INTRODUCTION, page


def test_the_page_in_the_documentation_is_the_one_the_tables_say(root: Path) -> None:
    assert (root / "docs" / "taskfile.md").read_text() == page(), "run: python -m tests.audits.taskfile"


def test_the_example_on_the_page_is_solved(tmp_path: Path) -> None:
    example = re.search(r"```toml\n(.*?)```", INTRODUCTION, re.DOTALL)
    assert example
    (tmp_path / "example.toml").write_text(example[1])
    task = wb.read_task(tmp_path / "example.toml")
    assert wb.solve(task.problem, task.method).solved
