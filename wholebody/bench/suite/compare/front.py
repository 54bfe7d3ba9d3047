"""Whether a method is on the front of speed and accuracy, and by how much it is not.

The time of a method to an accuracy a is

    t(a) = min over its budgets of the median over the cases of (seconds where the error is at most a, else infinite),

so that a failure is infinitely slow, and a method that fails in more than half of the cases is nowhere. A method is on
the front of a chart where no other has a smaller t(a) at any accuracy a from 1e-3 down to 1e-8: nobody is both faster
and as accurate. Two methods are compared on the cases that both were given at all their budgets. Where a method must
not fail, nine in ten say more than the median: t(a) is then the time in which so many of the cases are solved.

A ratio of such times has the bootstrap's interval, cases drawn with replacement and the same for both. Where it holds 1
nobody is told apart. It is of the accuracy at which ours does worst, picked by looking, so it errs against ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench.statistics import Interval, budget_ratio
from wholebody.bench.suite.compare.results import Quantity, Results

ACCURACIES = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8)
"""From where an accuracy is worth the name to where coal's distances end."""

OURS = "qp"
"""Our default method, with all its budgets: with least measures as `wb.QP()` has it, and the first that fits."""

HALF, MOST = 0.5, 0.9
"""Shares of the cases that the time to an accuracy is of: the median, and nine in ten."""

OUR_VARIANTS = "qp/"
"""The same method with other settings for its programs, which is not another method."""


@dataclass(frozen=True)
class Rival:
    """The worst that another method does to ours in one chart.

    Attributes:
        set, quantity: which chart.
        method: which other method; empty where no other gets to any accuracy.
        accuracy: at which the ratio is greatest.
        ratio: our time over the other's there; up to 1 we are on the front. Infinite where we do not get there.
        ours, other: seconds.
    """

    set: str
    quantity: str
    method: str
    accuracy: float
    ratio: Interval
    ours: float
    other: float

    @property
    def on_front(self) -> bool:
        """Whether no other method is faster at any accuracy."""
        return self.ratio.value <= 1.0

    @property
    def verdict(self) -> Literal["yes", "no", "not told apart"]:
        """Whether we are on the front, where the interval leaves no doubt."""
        if not self.method:
            return "yes" if self.on_front else "no"
        return "yes" if self.ratio.high <= 1.0 else "no" if self.ratio.low > 1.0 else "not told apart"


def times_to(
    results: Results, family: str, adapter: str, quantity: Quantity, accuracy: float, cases: frozenset[int]
) -> Array:
    """Seconds (budgets, cases) of a method, infinite where it does not get to an accuracy."""
    rows = [
        np.where(values <= accuracy, seconds, inf)
        for level in results.levels(family, adapter)
        for seconds, values in [results.values(family, adapter, level, quantity, cases)]
    ]
    return np.array(rows or [np.full(len(cases), inf)])


def time_to(
    results: Results,
    family: str,
    adapter: str,
    quantity: Quantity,
    accuracy: float,
    cases: frozenset[int],
    share: float = HALF,
) -> float:
    """Seconds of a method to an accuracy; infinite where it gets there in less than that share of the cases."""
    return _least(times_to(results, family, adapter, quantity, accuracy, cases), share)


def _least(times: Array, share: float) -> float:
    """The least over the budgets of a quantile, which is one of the times, of times (budgets, cases)."""
    return float(np.quantile(times, share, axis=1, method="inverted_cdf").min()) if times.shape[1] else inf


def front(results: Results, family: str, quantity: Quantity, share: float = HALF) -> Rival | None:
    """The method that comes nearest to ours in a chart, or beats it most; None where ours did not take part."""
    own = results.swept(family, OURS)
    if not own:
        return None
    worst: tuple[Rival, Array, Array] | None = None
    for other in results.adapters:
        if other == OURS or other.startswith(OUR_VARIANTS):
            continue
        cases = own & results.swept(family, other)
        if not cases:
            continue
        for accuracy in ACCURACIES:
            if accuracy < quantity.floor:
                continue
            theirs = times_to(results, family, other, quantity, accuracy, cases)
            there = _least(theirs, share)
            if there == inf:
                continue
            ours = times_to(results, family, OURS, quantity, accuracy, cases)
            here = _least(ours, share)
            ratio = Interval(here / there, 0.0, inf, len(cases))
            rival = Rival(family, quantity.name, other, accuracy, ratio, here, there)
            if worst is None or ratio.value > worst[0].ratio.value:
                worst = rival, ours, theirs
    if worst is None:
        here = time_to(results, family, OURS, quantity, ACCURACIES[0], own, share)
        value = 0.0 if here < inf else inf
        ratio = Interval(value, value, value, len(own))
        return Rival(family, quantity.name, "", ACCURACIES[0], ratio, here, inf)
    return replace(worst[0], ratio=budget_ratio(*worst[1:], share))


def fronts(results: Results, share: float = HALF) -> list[Rival]:
    """One row for every chart in which our method took part."""
    found = [
        front(results, family, quantity, share) for family in results.sets for quantity in results.quantities(family)
    ]
    return [rival for rival in found if rival is not None]
