"""Intervals of 95 % and tests that comparisons rest on.

Shares have Wilson's interval (1927, "Probable inference, the law of succession, and statistical inference"); medians
and ratios the bootstrap's percentiles (Efron 1979), ratios paired by problem or by step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp, inf, log, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values

RESAMPLES = 2000  # of a bootstrap: the ends of its intervals then vary by about 3 % of their width
LEVEL = 0.95
BLOCK = 10  # steps that are drawn together: as many as slow steps follow each other
LEAST = 5  # problems below which nothing is said of a ratio


class Interval(NamedTuple):
    """A figure with its interval of 95 %: NaN and infinite ends where there is nothing; `cases` it rests on."""

    value: float
    low: float
    high: float
    cases: int = 0

    def scaled(self, factor: float) -> Interval:
        """The figure and its ends in another unit."""
        return Interval(factor * self.value, factor * self.low, factor * self.high, self.cases)


NOTHING = Interval(nan, -inf, inf, 0)


def wilson(count: int, of: int) -> tuple[float, float]:
    """Interval of a share `count / of`; from 0 to 1 where there is nothing."""
    from scipy.stats import binomtest

    if of == 0:
        return 0.0, 1.0
    found = binomtest(count, of).proportion_ci(LEVEL, method="wilson")
    return float(found.low), float(found.high)


def share(flags: Sequence[bool]) -> Interval:
    """Share of what is true, with its interval."""
    if not len(flags):
        return NOTHING
    count = sum(bool(flag) for flag in flags)
    return Interval(count / len(flags), *wilson(count, len(flags)), len(flags))


def median(values: Sequence[float]) -> Interval:
    """Median of values, infinite ones too, with its interval."""
    return quantile(values, 0.5)


def quantile(values: Sequence[float], part: float) -> Interval:
    """A quantile of values, infinite ones too, with its interval."""
    known = np.asarray(values, dtype=float)
    if not len(known):
        return NOTHING
    drawn = _quantile(known[_draws(len(known))], part)
    return Interval(float(_quantile(known[None], part)[0]), *_ends(drawn), len(known))


def shifted_geometric_mean(values: Sequence[float], shift: float = 1e-3) -> Interval:
    """`exp(mean(log(values + shift))) - shift` of times [s] with its interval; failures belong among them."""
    known = np.asarray(values, dtype=float)
    if not len(known):
        return NOTHING
    logs = np.log(known + shift)
    drawn = np.exp(logs[_draws(len(known))].mean(axis=1)) - shift
    return Interval(exp(float(logs.mean())) - shift, *_ends(drawn), len(known))


def ratio(one: Mapping[tuple[str, int], float], other: Mapping[tuple[str, int], float]) -> Interval:
    """Geometric mean of positive figures of one method over those of another, on the problems that both have."""
    logs = np.array([log(one[key] / other[key]) for key in one if key in other])
    if len(logs) < LEAST:
        return with_values(NOTHING, low=0.0, cases=len(logs))
    drawn = np.exp(logs[_draws(len(logs))].mean(axis=1))
    return Interval(exp(float(logs.mean())), *_ends(drawn), len(logs))


def paired_difference(one: Mapping[int, bool], other: Mapping[int, bool]) -> float:
    """p-value that two methods solve as many of the problems that both were given: McNemar's test (1947), exact."""
    from scipy.stats import binomtest

    both = one.keys() & other.keys()
    more = sum(one[key] and not other[key] for key in both)
    fewer = sum(other[key] and not one[key] for key in both)
    return float(binomtest(more, more + fewer).pvalue) if more + fewer else 1.0


def quantile_ratio(one: Array, other: Array, part: float) -> Interval:
    """Median of the runs of a quantile of one tool's steps (runs, steps) over that of another's beside it."""
    # Runs are drawn with replacement, steps in blocks, as neighbours are alike (Politis & Romano 1992).
    runs, steps = one.shape
    random, block = np.random.default_rng(0), min(BLOCK, steps)
    chosen = random.integers(0, runs, (RESAMPLES, runs, 1))
    begins = random.integers(0, steps, (RESAMPLES, 1, -(-steps // block), 1))
    places = ((begins + np.arange(block)) % steps).reshape(RESAMPLES, 1, -1)[:, :, :steps]
    drawn = _run_ratio(one[chosen, places], other[chosen, places], part)
    return Interval(float(_run_ratio(one, other, part)), *_ends(drawn), runs * steps)


def _run_ratio(one: Array, other: Array, part: float) -> Array:
    """Median over the runs of what a quantile is to the other's (..., runs, steps)."""
    return np.asarray(np.median(np.quantile(one, part, axis=-1) / np.quantile(other, part, axis=-1), axis=-1))


def _draws(count: int) -> NDArray[np.int64]:
    return np.random.default_rng(0).integers(0, count, (RESAMPLES, count))


def _quantile(values: Array, part: float) -> Array:
    """A quantile (n,) of each row of values (n, m), which is one of them: infinite ones are not averaged."""
    return np.asarray(np.quantile(values, part, axis=1, method="inverted_cdf"))


def _ends(drawn: Array) -> tuple[float, float]:
    low, high = np.quantile(drawn, (0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL), method="inverted_cdf")
    return float(low), float(high)
