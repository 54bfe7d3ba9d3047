"""Records, their table and their report."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest

from wholebody.bench.rows import Row, report, shares, shown, table
from wholebody.bench.statistics import NOTHING, Interval

ROWS = [Row("a", "qp", {"ms": 1.25, "status": "solved"}), Row("b", "ccd", {"ms": Interval(2.0, 1.0, inf), "count": 3})]


def test_a_table_has_a_column_for_every_figure_of_a_row() -> None:
    assert table(ROWS).splitlines() == [
        "| case | tool | ms | status | count |",
        "| --- | --- | ---: | ---: | ---: |",
        "| a | qp | 1.25 | solved |  |",
        "| b | ccd | 2 [1, ∞] |  | 3 |",
    ]


@pytest.mark.parametrize(
    ("figure", "text"), [(0.012345, "0.0123"), (12345.6, "12346"), (7, "7"), (nan, ""), (inf, ""), (NOTHING, "")]
)
def test_figures_have_three_digits_and_nothing_is_written_for_what_is_not_finite(figure: float, text: str) -> None:
    assert shown(figure) == text


def test_a_report_has_every_table_under_its_title_and_the_machine() -> None:
    text = report("About.", {"First": ROWS, "Second": ROWS[:1]}, {"cores": "2"}, ["a note"])
    assert text.startswith("About.\n\n### First\n\n| case |")
    assert text.endswith("### Second\n\n" + table(ROWS[:1]) + "\n\n- a note\n\nMeasured with cores 2.")


def test_shares_are_of_all_that_were_asked() -> None:
    x, y = shares("solved", "ms", {"qp": [3.0, 1.0]}, {"qp": 4}).lines["qp"]
    assert np.array_equal(x, [1.0, 3.0])
    assert np.array_equal(y, [25.0, 50.0])
