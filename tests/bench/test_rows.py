"""Records, their table and their report."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest

from tests.audits.throws import throw_summary
from wholebody.bench.rows import Row, across, only, shares, shown, table
from wholebody.bench.statistics import NOTHING, Interval

ROWS = [Row("a", "qp", {"ms": 1.25, "status": "solved"}), Row("b", "ccd", {"ms": Interval(2.0, 1.0, inf), "count": 3})]


def test_one_figure_of_all_rows_stands_in_a_table_of_two_ways() -> None:
    rows = [Row(case, tool, {"ms": ms}) for case, tool, ms in (("a", "qp", 1), ("b", "qp", 2), ("b", "ccd", 3))]
    assert across(rows, "ms") == [Row("qp", "", {"a": 1, "b": 2}), Row("ccd", "", {"b": 3})]
    assert across(rows, "ms", columns="tool") == [Row("a", "", {"qp": 1}), Row("b", "", {"qp": 2, "ccd": 3})]
    assert across(rows[:1], "ms", "ms²") == [Row("qp", "", {"a, ms": 1})]
    assert table(across(rows, "ms")).splitlines()[-1] == "| ccd |  | 3 |"
    assert only(ROWS, "count", "ms") == [
        Row("a", "qp", {"ms": 1.25}),
        Row("b", "ccd", {"count": 3, "ms": ROWS[1]["ms"]}),
    ]


def test_throws_of_one_speed_are_one_row() -> None:
    figures = {"limits": "swift", "m/s": 5.0, "frames": 27, "deep": 1, "named": 2, "silent": 0}
    rows = [
        Row("rod", "who walks", {**figures, "deepest mm": deep, "CPU median ms": 8.0 + deep}) for deep in (0.5, 0.2)
    ]
    (row,) = throw_summary(rows)
    expected = {"frames": 54, "deepest mm": 0.5, "deep": 2, "named": 4, "silent": 0, "CPU median ms, most": 8.5}
    assert row == Row("swift limits", "5 m/s", expected)


@pytest.mark.parametrize(
    ("figure", "text"), [(0.012345, "0.0123"), (12345.6, "12346"), (7, "7"), (nan, ""), (inf, ""), (NOTHING, "")]
)
def test_figures_have_three_digits_and_nothing_is_written_for_what_is_not_finite(figure: float, text: str) -> None:
    assert shown(figure) == text


def test_shares_are_of_all_that_were_asked() -> None:
    x, y = shares("solved", "ms", {"qp": [3.0, 1.0]}, {"qp": 4}).lines["qp"]
    assert np.array_equal(x, [1.0, 3.0])
    assert np.array_equal(y, [25.0, 50.0])
