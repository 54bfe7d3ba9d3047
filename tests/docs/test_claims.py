"""Figures of the first page are those of the tables, and their intervals exclude the opposite of what is said."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SPAN = r"([\d.]+) \[([\d.]+), ([\d.]+)\]"


@pytest.fixture(scope="module")
def readme() -> str:
    return " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def measured() -> dict[str, tuple[float, ...]]:
    """Return our step over placo's in the median by reach, with its interval."""
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8").partition("<!-- bench:step -->")[2]
    heads, row = (re.search(rf"^\|{start}.*$", text, re.MULTILINE) for start in ("", " wholebody"))
    assert heads
    assert row
    columns = zip(heads[0].split("|"), row[0].split("|"), strict=True)
    ratios = {name.strip(): cell for name, cell in columns if name.endswith(", median × placo ")}
    spans = {name.partition(",")[0]: re.fullmatch(rf" {SPAN} ", cell) for name, cell in ratios.items()}
    return {reach: tuple(map(float, found.groups())) for reach, found in spans.items() if found}


def test_the_step_is_as_fast_as_the_first_page_says(readme: str, measured: dict[str, tuple[float, ...]]) -> None:
    said = re.search(
        rf"step among 20 objects takes {SPAN} of placo's time \(median, 95 % interval\), in contact {SPAN}", readme
    )
    assert said is not None
    figures = [float(figure) for figure in said.groups()]
    assert figures == [round(figure, 2) for reach in ("free", "contact") for figure in measured[reach]]


def test_about_a_tenth_is_what_was_measured(readme: str, measured: dict[str, tuple[float, ...]]) -> None:
    assert "about a tenth of the time of placo for a person among 20 objects" in readme
    said = re.search(rf"with a new `Point` each step {SPAN}", readme)
    row = re.search(
        rf"\| wholebody/retarget \| [\d.]+ \| {SPAN}",
        (ROOT / "docs" / "assets" / "bench" / "step.txt").read_text("utf-8"),
    )
    assert said is not None
    assert row is not None
    assert [float(figure) for figure in said.groups()] == [round(float(figure), 2) for figure in row.groups()]
    assert all(round(share, 1) == 0.1 for share in (measured["free"][0], measured["contact"][0], float(said[1])))
