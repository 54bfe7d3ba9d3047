"""What is asked of the default method and what was found: by hand-made figures, so that every verdict occurs."""

from __future__ import annotations

from dataclasses import fields
from math import nan
from typing import Any

import pytest

from wholebody.bench.statistics import Interval
from wholebody.bench.suite.compare.advice import targets
from wholebody.bench.suite.compare.front import Rival
from wholebody.bench.suite.compare.record import ANSWERED, OVERTIME, Record
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.summary import Summary, summaries

BLANK: dict[str, Any] = {**{field.name: nan for field in fields(Summary)}, "said": "", "programs": ""}


def row(family: str, success: float, low: float, high: float, method: str = "qp", refused: int = 0) -> Summary:
    found: dict[str, Any] = {"set": family, "method": method, "cases": 100, "refused": refused}
    shares = {"success": Interval(success, low, high)}
    return Summary(**{**BLANK, **found, **shares})


def rival(method: str, ratio: float) -> Rival:
    return Rival("one", "worst", method, 1e-3, Interval(ratio, 0.9 * ratio, 1.1 * ratio, 40), 0.01, 0.02)


def test_a_share_is_reached_or_missed_by_its_interval() -> None:
    rows = [
        row("sure_one", 1.0, 0.981, 1.0),
        row("good_one", 0.985, 0.96, 0.995),
        row("near_one", 0.97, 0.93, 0.985),
        row("bad_one", 0.90, 0.86, 0.94),
        row("refused_one", nan, nan, nan, refused=100),
        row("bad_one", 1.0, 0.99, 1.0, method="placo"),
    ]
    (said,) = targets(rows, [], [])
    verdicts = [
        "Reached: sure one 100.0 % [98.1, 100.0] of 100",
        "reached, with an interval that goes lower: good one 98.5 % [96.0, 99.5] of 100",
        "missed, with an interval that goes higher: near one 97.0 % [93.0, 98.5] of 100",
        "missed: bad one 90.0 % [86.0, 94.0] of 100",
    ]
    assert said == f"`qp` solves at least 98 % of every set. {'; '.join(verdicts)}."


def test_who_is_ahead_in_a_chart_is_named_once() -> None:
    wall = [rival("dls", 1.4), rival("dls", 2.0), rival("", 0.0), rival("placo", 0.5)]
    _, said = targets([row("sure_one", 1.0, 0.981, 1.0)], wall, [rival("placo", 0.5)])
    assert "the front of 2 of 4 charts, and of 1 of 1 by the time" in said
    assert said.endswith("ahead of it in a chart: `dls`, in 2 charts by more than the interval of the ratio.")
    _, all_on = targets([row("sure_one", 1.0, 0.981, 1.0)], wall[2:], wall[3:])
    assert "ahead" not in all_on


def test_nothing_is_asked_of_other_methods() -> None:
    assert targets([row("sure_one", 1.0, 0.981, 1.0, method="placo")], [rival("placo", 0.5)], []) == []


@pytest.mark.parametrize(("frames", "longest"), [(0, 20.0), (100, 0.2), (400, 0.1)])
def test_a_failure_counts_as_long_as_a_solve_or_a_frame_may_take(frames: int, longest: float) -> None:
    """A method that fails in every drag has no mean of 20 s beside frames of milliseconds."""
    one = Record("drag", 0, "qp", 1e-4, 0, ANSWERED, seconds=0.01, cpu_seconds=0.01, frames=frames)
    other = Record("drag", 0, "mink", 1e-4, 0, OVERTIME)
    rows = summaries(Results([one, other], ["drag"], ["qp", "mink"]))
    assert rows[1].mean_ms.value == pytest.approx(1e3 * longest)
