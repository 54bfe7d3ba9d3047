"""Curves of speed against accuracy: one point a budget, with what lies between the quartiles and up to 95 %."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.bench.adapters.base import Budget
from wholebody.bench.compare.results import Quantity, Results, middle


class Point(NamedTuple):
    """One method at one budget.

    Attributes:
        level: the budget.
        cases: how many it stands for.
        seconds, seconds_p95: median, and 95 %, of the call [s].
        value: median; infinite where more than half of the answers are none.
        low, high: quartiles.
    """

    level: Budget
    cases: int
    seconds: float
    seconds_p95: float
    value: float
    low: float
    high: float


def curve(results: Results, family: str, adapter: str, quantity: Quantity) -> list[Point]:
    """Points of a method in a set, from the fastest budget to the slowest."""
    cases = results.swept(family, adapter)
    points = []
    for level in results.levels(family, adapter):
        seconds, values = results.values(family, adapter, level, quantity, cases)
        spent = seconds[np.isfinite(seconds)]
        if not len(spent):
            continue
        quartiles = [middle(values, share) for share in (0.5, 0.25, 0.75)]
        points.append(Point(level, len(cases), middle(spent), middle(spent, 0.95), *quartiles))
    return points


def profile(results: Results, family: str, adapter: str, tolerance: float) -> tuple[list[float], int]:
    """Times of the cases that a method solved at its default budget, sorted, and how many it took."""
    mine = results.taken(family, adapter)
    return sorted(record.seconds for record in mine if record.success(tolerance)), len(mine)
