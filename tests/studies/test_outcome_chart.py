"""The chart of a study: as many cells of each colour as there are cases of each outcome."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import wholebody as wb
from wholebody.studies.records import COLORS, MOST


def record(person: str, target: str, outcome: str, error: float = 0.0) -> wb.studies.SolveRecord:
    factors = {"person": person, "target": target}
    return wb.studies.SolveRecord(f"{person}, {target}", outcome, goal_error=error, factors=factors)


def pixels(path: Path, outcome: str) -> int:
    """How many pixels of a picture have exactly the colour of an outcome."""
    color = [int(COLORS[outcome][k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.asarray(Image.open(path).convert("RGB")) == color).all(axis=2).sum())


def test_colours_have_the_shares_of_the_outcomes(tmp_path: Path) -> None:
    people = ["small woman", "median man", "tall man"]
    cases = [record(person, target, "solved") for person in people for target in ("low", "middle", "high")]
    cases[2] = record("small woman", "high", "unreachable", 0.102)
    path = wb.studies.Records(cases).chart(tmp_path / "study.png")
    drawn = pixels(path, "solved") / pixels(path, "unreachable")
    assert 6.0 < drawn < 11.0  # 8 cells beside 1 with letters, and a patch of each in the legend
    assert pixels(path, "stalled") == 0


def test_cases_without_factors_are_rows(tmp_path: Path) -> None:
    cases = [wb.studies.SolveRecord(str(k), "solved" if k else "stalled") for k in range(5)]
    path = wb.studies.Records(cases).chart(tmp_path / "many.png")
    assert 3.0 < pixels(path, "solved") / pixels(path, "stalled") < 4.5
    assert path.read_bytes() == wb.studies.Records(cases).chart(tmp_path / "again.png").read_bytes()


@pytest.mark.parametrize("count", [0, MOST + 1])
def test_what_cannot_be_read_is_refused(count: int, tmp_path: Path) -> None:
    cases = [wb.studies.SolveRecord(str(k), "solved") for k in range(count)]
    with pytest.raises(wb.InputError, match=f"chart: {count} rows"):
        wb.studies.Records(cases).chart(tmp_path / "none.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("cases", "said"),
    [
        ([("x", "stalled"), ("x", "solved")], "chart: 2 records are called 'x'; give records of one run"),
        ([("x", "late")], "chart: no outcome is called 'late'; outcomes are solved"),
    ],
)
def test_no_record_hides_another(cases: list[tuple[str, str]], said: str, tmp_path: Path) -> None:
    with pytest.raises(wb.InputError, match=said):
        wb.studies.Records([wb.studies.SolveRecord(*case) for case in cases]).chart(tmp_path / "none.png")
    assert not list(tmp_path.iterdir())


def test_names_are_no_formulas(tmp_path: Path) -> None:
    assert (
        pixels(wb.studies.Records([wb.studies.SolveRecord("p$^^$", "solved")]).chart(tmp_path / "one.png"), "solved")
        > 0
    )
