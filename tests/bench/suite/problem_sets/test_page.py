"""The page on comparisons shows each set of problems."""

from __future__ import annotations

from pathlib import Path

import pytest

from wholebody.bench.suite.problem_sets.registry import SETS

DOCS = Path(__file__).parents[4] / "docs"


@pytest.mark.parametrize("name", SETS)
def test_a_set_has_a_row_and_a_picture(name: str) -> None:
    page = (DOCS / "comparison.md").read_text(encoding="utf-8")
    assert f"(assets/bench/set-{name}.png) `{name}` | " in page
    assert (DOCS / f"assets/bench/set-{name}.png").is_file()
