"""Intervals and tests that comparisons rest on. Every interval is of 95 %.

Shares have Wilson's interval (1927, "Probable inference, the law of succession, and statistical inference"); medians
and ratios the bootstrap's percentiles (Efron 1979), problems drawn with replacement, and ratios paired by problem or by
step.
Rankings are Friedman's (1937), with Nemenyi's critical difference (Demsar 2006, "Statistical comparisons of
classifiers over multiple data sets").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp, inf, log, nan, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.records import with_values

RESAMPLES = 2000  # of a bootstrap: the ends of its intervals then vary by about 3 % of their width
LEVEL = 0.95
SEED = 0  # of the bootstrap: the same figures have the same interval
SHIFT = 1e-3  # s: added to times before their geometric mean, so that the shortest do not rule it
BLOCK = 10  # steps that are drawn together: as many as slow steps follow each other
LEAST = 5  # problems below which nothing is said of a ratio


class Interval(NamedTuple):
    """A figure with its interval of 95 %.

    Attributes:
        value, low, high: NaN, minus infinity and infinity where there is nothing to compute it from.
        cases: how many problems it rests on; 0 where that is not told.
    """

    value: float
    low: float
    high: float
    cases: int = 0

    def scaled(self, factor: float) -> Interval:
        """The figure and its ends in another unit."""
        return Interval(factor * self.value, factor * self.low, factor * self.high, self.cases)

    def apart_from(self, value: float) -> bool:
        """Whether the interval excludes a value."""
        return self.low > value or self.high < value


def against(found: Interval, asked: float, *, at_least: bool) -> str:
    """Whether a figure is at least, or at most, what is asked, and whether its interval leaves that open; in words."""
    ends = found.low, found.high
    sure, ruled_out = (ends[0] >= asked, ends[1] < asked) if at_least else (ends[1] <= asked, ends[0] > asked)
    if sure or ruled_out:
        return "reached" if sure else "missed"
    good = found.value >= asked if at_least else found.value <= asked
    return f"{'reached' if good else 'missed'}, with an interval that goes {'lower' if good == at_least else 'higher'}"


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


def shifted_geometric_mean(values: Sequence[float], shift: float = SHIFT) -> Interval:
    """`exp(mean(log(values + shift))) - shift` of times in seconds, with its interval.

    Failures belong among the values, with the time after which a solve is ended.
    """
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
    """p-value that two methods solve as many of the problems that both were given: McNemar's test (1947), exact.

    Only problems that one of the two solves and the other does not tell anything.
    """
    from scipy.stats import binomtest

    both = one.keys() & other.keys()
    more = sum(one[key] and not other[key] for key in both)
    fewer = sum(other[key] and not one[key] for key in both)
    return float(binomtest(more, more + fewer).pvalue) if more + fewer else 1.0


def quantile_ratio(one: Array, other: Array, part: float) -> Interval:
    """A quantile of one tool's steps over that of another's in the same run: the median of the runs.

    Runs are drawn with replacement, and steps in blocks, since neighbours are alike: the circular block bootstrap
    (Politis & Romano 1992). Both tools have the same draws.

    Args:
        one: (runs, steps) times.
        other: (runs, steps) times of the same steps, in runs beside these.
        part: of the quantile.
    """
    runs, steps = one.shape
    random, block = np.random.default_rng(SEED), min(BLOCK, steps)
    chosen = random.integers(0, runs, (RESAMPLES, runs, 1))
    begins = random.integers(0, steps, (RESAMPLES, 1, -(-steps // block), 1))
    places = ((begins + np.arange(block)) % steps).reshape(RESAMPLES, 1, -1)[:, :, :steps]
    drawn = _run_ratio(one[chosen, places], other[chosen, places], part)
    return Interval(float(_run_ratio(one, other, part)), *_ends(drawn), runs * steps)


def budget_ratio(one: Array, other: Array, part: float) -> Interval:
    """A method's time over that of another, each the least over its budgets of a quantile over the problems.

    Problems are drawn with replacement, the same for both. Where neither gets there, nobody is ahead: the ratio is 1.

    Args:
        one: (budgets, problems) times, infinite where a problem was not solved well enough.
        other: (its budgets, problems) times for the same problems.
        part: of the quantile.
    """
    count = one.shape[1]
    value = float(_least_ratio(one[:, None], other[:, None], part)[0])
    if count < LEAST:
        return Interval(value, 0.0, inf, count)
    draws = _draws(count)
    return Interval(value, *_ends(_least_ratio(one[:, draws], other[:, draws], part)), count)


def _least_ratio(one: Array, other: Array, part: float) -> Array:
    """Ratios (draws,) of the least quantiles of times (budgets, draws, problems)."""
    place = int(np.quantile(np.arange(one.shape[-1]), part, method="inverted_cdf"))
    here, there = (np.partition(times, place, axis=-1)[..., place].min(axis=0) for times in (one, other))
    nobody = np.isinf(here) & np.isinf(there)
    return np.asarray(np.where(nobody, 1.0, here / np.where(nobody, 1.0, there)))


def _run_ratio(one: Array, other: Array, part: float) -> Array:
    """Median over the runs of what a quantile is to the other's (..., runs, steps)."""
    return np.asarray(np.median(np.quantile(one, part, axis=-1) / np.quantile(other, part, axis=-1), axis=-1))


def _draws(count: int) -> NDArray[np.int64]:
    return np.random.default_rng(SEED).integers(0, count, (RESAMPLES, count))


def _quantile(values: Array, part: float) -> Array:
    """A quantile (n,) of each row of values (n, m), which is one of them: infinite ones are not averaged."""
    return np.asarray(np.quantile(values, part, axis=1, method="inverted_cdf"))


def _ends(drawn: Array) -> tuple[float, float]:
    low, high = np.quantile(drawn, (0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL), method="inverted_cdf")
    return float(low), float(high)


class Ranking(NamedTuple):
    """Methods ranked over the problems that all of them were given, the best first.

    Attributes:
        methods: names, by mean rank.
        ranks: mean rank of each; 1 is best.
        p_value: of Friedman's test that all are alike.
        critical_difference: Nemenyi's: mean ranks that differ by less are not told apart; 0 where the test finds no
            difference at all, so that nobody is.
        cases: problems.
        alike: runs of neighbours in `methods` that are not told apart, as (first, last).
    """

    methods: tuple[str, ...]
    ranks: tuple[float, ...]
    p_value: float
    critical_difference: float
    cases: int
    alike: tuple[tuple[int, int], ...]


def ranking(found: Mapping[str, Sequence[float]]) -> Ranking | None:
    """Rank methods by a cost for each problem, smaller being better; None below three methods or `LEAST` problems.

    Args:
        found: for each method its costs, in the same order of problems; infinite for a failure. Equal costs share the
            mean of their ranks.
    """
    from scipy.stats import friedmanchisquare, rankdata, studentized_range

    names = list(found)
    costs = np.array([found[name] for name in names], dtype=float).T
    count, methods = costs.shape if costs.ndim == 2 else (0, 0)
    if methods < 3 or count < LEAST:
        return None
    ranks = np.apply_along_axis(rankdata, 1, costs)
    means = ranks.mean(axis=0)
    tied = bool((ranks == ranks[:, :1]).all())
    p_value = 1.0 if tied else float(friedmanchisquare(*costs.T).pvalue)
    width = float(studentized_range.ppf(LEVEL, methods, 1e6)) / sqrt(2.0)
    difference = width * sqrt(methods * (methods + 1) / (6.0 * count))
    order = np.argsort(means, kind="stable")
    sorted_means = means[order]
    different = p_value < 1.0 - LEVEL
    alike = _runs(sorted_means, difference) if different else [(0, methods - 1)]
    return Ranking(
        tuple(names[k] for k in order), tuple(float(mean) for mean in sorted_means), p_value, difference, count,
        tuple(alike),
    )  # fmt: skip


def _runs(means: Array, difference: float) -> list[tuple[int, int]]:
    """Longest runs of neighbours that differ by less than a difference, those within others left out."""
    runs: list[tuple[int, int]] = []
    for first in range(len(means)):
        last = int(np.flatnonzero(means - means[first] < difference)[-1])
        if last > first and not (runs and runs[-1][1] >= last):
            runs.append((first, last))
    return runs


def same_share(counts: Sequence[tuple[int, int]]) -> float:
    """p-value that some groups (successes, tries) have one share: Fisher's exact test by Monte Carlo of the margin.

    One where all succeed, all fail, or there is one group.
    """
    done = np.array([count for count, _ in counts], dtype=float)
    tries = np.array([of for _, of in counts])
    known = tries > 0
    done, tries = done[known], tries[known]
    total, wins = int(tries.sum()), round(float(done.sum()))
    if len(tries) < 2 or wins in (0, total):
        return 1.0
    expected = tries * wins / total

    def statistic(found: Array) -> Array:
        return np.asarray(((found - expected) ** 2 / (expected * (1.0 - wins / total))).sum(axis=-1))

    drawn = np.random.default_rng(SEED).multivariate_hypergeometric(tries, wins, RESAMPLES).astype(float)
    return float((1 + np.count_nonzero(statistic(drawn) >= statistic(done.astype(float)) - 1e-9)) / (RESAMPLES + 1))
