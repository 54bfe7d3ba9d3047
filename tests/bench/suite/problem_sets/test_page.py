"""The page of the sets shows each of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from wholebody.bench.suite.problem_sets.registry import SETS

DOCS = Path(__file__).parents[4] / "docs"


@pytest.mark.parametrize("name", SETS)
def test_a_set_has_a_section_and_a_picture(name: str) -> None:
    page = (DOCS / "problem-sets.md").read_text(encoding="utf-8")
    made = SETS[name]
    assert f"## {made.title[0].upper()}{made.title[1:]}\n\n`{name}`." in page
    assert f"(assets/bench/set-{name}.png)" in page
    assert (DOCS / f"assets/bench/set-{name}.png").is_file()
