"""Intervals and rankings, against scipy, against the textbook, and by drawing samples whose truth is known."""

from __future__ import annotations

from math import inf, isnan

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from wholebody.bench import statistics
from wholebody.bench.report import spanned
from wholebody.bench.statistics import NOTHING, Interval


@pytest.mark.parametrize(("count", "of"), [(0, 7), (199, 200), (200, 200), (3, 20), (1, 1)])
def test_intervals_of_shares_are_wilsons(count: int, of: int) -> None:
    expected = stats.binomtest(count, of).proportion_ci(method="wilson")
    assert statistics.wilson(count, of) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert statistics.wilson(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_intervals_of_shares_are_the_published_ones(count: int, of: int, low: float, high: float) -> None:
    """Newcombe 1998, "Two-sided confidence intervals for the single proportion", table I, method 3."""
    assert statistics.wilson(count, of) == pytest.approx((low, high), abs=5e-5)


def test_200_of_200_is_no_more_than_98_percent_for_sure() -> None:
    assert statistics.share([True] * 200).low == pytest.approx(0.981, abs=5e-4)


def test_nine_in_ten_intervals_of_medians_and_means_hold_the_truth() -> None:
    rng = np.random.default_rng(1)
    medians, means = 0, 0
    for _ in range(200):
        values = np.exp(rng.normal(0.0, 1.0, 40))
        found, mean = statistics.median(values), statistics.shifted_geometric_mean(values, shift=0.0)
        medians += found.low <= 1.0 <= found.high
        means += mean.low <= 1.0 <= mean.high
    assert 180 <= medians <= 200
    assert 178 <= means <= 199


def test_the_bootstrap_is_scipys_up_to_its_own_chance() -> None:
    """Ends of the interval agree to a twentieth of its width: 2,000 draws leave about 3 % of it to chance."""
    values = np.exp(np.random.default_rng(5).normal(-3.0, 1.0, 60))

    def mean(drawn: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
        return np.exp(np.log(drawn + 1e-3).mean(axis=axis)) - 1e-3

    for found, statistic in (
        (statistics.shifted_geometric_mean(values.tolist()), mean),
        (statistics.median(values.tolist()), np.median),
    ):
        expected = stats.bootstrap(
            (values,), statistic, n_resamples=20_000, method="percentile", vectorized=True,
            random_state=np.random.default_rng(6),
        ).confidence_interval  # fmt: skip
        width = expected.high - expected.low
        assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=0.1 * width)


def test_nine_in_ten_intervals_of_a_quantiles_ratio_hold_the_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps are slow or quick in runs of seven, alike in all repeats and for both tools; the ratio is 0.25."""
    monkeypatch.setattr(statistics, "RESAMPLES", 400)  # a fifth of the draws, and of the time
    rng, held = np.random.default_rng(3), {0.5: 0, 0.95: 0}
    for _ in range(20):
        course = np.repeat(np.exp(rng.normal(0.0, 0.5, 30)), 7)
        one, other = (course * scale * np.exp(rng.normal(0.0, 0.2, (5, 210))) for scale in (0.25, 1.0))
        for part in held:
            found = statistics.quantile_ratio(one, other, part)
            assert found.low <= found.value <= found.high
            held[part] += found.low <= 0.25 <= found.high
    assert min(held.values()) >= 18


def test_both_tools_of_a_quantiles_ratio_have_the_same_draws() -> None:
    times = np.random.default_rng(4).exponential(size=(3, 50))
    assert statistics.quantile_ratio(0.5 * times, times, 0.95)[:3] == pytest.approx((0.5, 0.5, 0.5))


def test_the_interval_of_a_ratio_is_students_where_logarithms_are_normal() -> None:
    logs = np.random.default_rng(7).normal(0.3, 0.5, 80)
    ones = {("a", k): 1.0 for k in range(80)}
    found = statistics.ratio({("a", k): float(np.exp(value)) for k, value in enumerate(logs)}, ones)
    low, high = stats.t.interval(0.95, 79, logs.mean(), logs.std(ddof=1) / np.sqrt(80))
    assert found.value == pytest.approx(np.exp(logs.mean()))
    assert (np.log(found.low), np.log(found.high)) == pytest.approx((low, high), abs=0.1 * (high - low))


def test_a_median_over_failures_is_infinite() -> None:
    found = statistics.median([1.0, inf, inf, 2.0, inf])
    assert (found.value, found.high, found.cases) == (inf, inf, 5)
    assert isnan(statistics.median([]).value)


def test_the_shifted_geometric_mean_is_that_of_the_shifted_values() -> None:
    assert statistics.shifted_geometric_mean([1.0, 3.0, 9.0], shift=0.0).value == pytest.approx(3.0)
    assert statistics.shifted_geometric_mean([0.0, 0.003], shift=1e-3).value == pytest.approx(1e-3)


def test_ratios_are_paired_by_problem() -> None:
    """Problems differ a thousandfold, and the ratio is known to a hundredth nevertheless."""
    rng = np.random.default_rng(2)
    base = {("a", k): float(10.0 ** rng.uniform(-3.0, 0.0)) for k in range(50)}
    slower = {key: 1.3 * value * float(np.exp(rng.normal(0.0, 0.03))) for key, value in base.items()}
    found = statistics.ratio(slower, base)
    assert found.value == pytest.approx(1.3, rel=0.02)
    assert 1.28 < found.low < 1.3 < found.high < 1.32
    assert found.apart_from(1.0)
    assert isnan(statistics.ratio(slower, dict(list(base.items())[:4])).value)


def test_friedmans_test_is_scipys_and_the_critical_difference_the_textbooks() -> None:
    rng = np.random.default_rng(3)
    found = {name: (rng.normal(shift, 1.0, 30)).tolist() for name, shift in (("a", 0.0), ("b", 0.1), ("c", 2.0))}
    ranked = statistics.ranking(found)
    assert ranked is not None
    assert ranked.p_value == pytest.approx(stats.friedmanchisquare(*found.values()).pvalue, rel=1e-9)
    assert ranked.critical_difference == pytest.approx(2.343 * np.sqrt(3 * 4 / (6 * 30)), rel=1e-3)  # Demsar, table 5a
    assert ranked.methods[2] == "c"
    assert ranked.alike == ((0, 1),)


DEMSAR = {
    "C4.5": (4, 1, 4, 4, 4, 1, 3, 2.5, 4, 2.5, 4, 3, 4, 3),
    "C4.5+m": (3, 2, 1, 1, 2, 2.5, 2, 2.5, 3, 2.5, 2.5, 2, 1, 1),
    "C4.5+cf": (2, 3, 2, 3, 3, 4, 4, 4, 2, 2.5, 1, 4, 2, 4),
    "C4.5+m+cf": (1, 4, 3, 2, 1, 2.5, 1, 1, 1, 2.5, 2.5, 1, 3, 2),
}
"""Ranks of four methods on 14 data sets: Demsar 2006, table 6."""


def test_the_worked_example_of_the_paper() -> None:
    """Its mean ranks, and its verdict: Nemenyi's test is not powerful enough to tell any two of the four apart."""
    ranked = statistics.ranking(DEMSAR)
    assert ranked is not None
    assert ranked.methods == ("C4.5+m+cf", "C4.5+m", "C4.5+cf", "C4.5")
    assert ranked.ranks == pytest.approx((1.964, 2.000, 2.893, 3.143), abs=5e-4)
    assert ranked.critical_difference == pytest.approx(1.25, abs=5e-3)
    assert ranked.p_value < 0.05
    assert ranked.alike == ((0, 3),)


@pytest.mark.parametrize(
    ("methods", "critical"),
    [(3, 2.343), (4, 2.569), (5, 2.728), (6, 2.850), (7, 2.949), (8, 3.031), (9, 3.102), (10, 3.164)],
)
def test_critical_values_are_those_of_the_papers_table(methods: int, critical: float) -> None:
    ranked = statistics.ranking({str(k): [float(k)] * 24 for k in range(methods)})
    assert ranked is not None
    expected = critical * np.sqrt(methods * (methods + 1) / (6 * 24))
    assert ranked.critical_difference == pytest.approx(expected, rel=5e-4)


def test_nobody_is_ranked_where_all_are_alike() -> None:
    ranked = statistics.ranking({"a": [1.0] * 6, "b": [1.0] * 6, "c": [1.0] * 6})
    assert ranked is not None
    assert ranked.ranks == (2.0, 2.0, 2.0)
    assert ranked.alike == ((0, 2),)
    assert statistics.ranking({"a": [1.0] * 6, "b": [1.0] * 6}) is None


def test_failures_rank_last_and_share_their_rank() -> None:
    ranked = statistics.ranking({"a": [1.0] * 20, "b": [inf] * 20, "c": [inf] * 20})
    assert ranked is not None
    assert ranked.ranks == (1.0, 2.5, 2.5)
    assert ranked.alike == ((1, 2),)


def test_seeds_that_differ_are_noticed_and_others_are_not() -> None:
    assert statistics.same_share([(20, 20), (20, 20), (3, 20)]) < 0.01
    assert statistics.same_share([(18, 20), (19, 20), (17, 20)]) > 0.5
    assert statistics.same_share([(20, 20), (20, 20)]) == 1.0
    expected = stats.chi2_contingency([[40, 20], [25, 35]], correction=False).pvalue
    assert statistics.same_share([(40, 60), (25, 60)]) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(("more", "fewer", "expected"), [(0, 0, 1.0), (6, 0, 1 / 32), (0, 5, 1 / 16), (3, 1, 0.625)])
def test_what_two_methods_solve_is_compared_by_the_problems_that_only_one_solves(
    more: int, fewer: int, expected: float
) -> None:
    """By coin tosses: twice the probability of as few heads."""
    one = {number: number < 10 + more for number in range(40)}
    other = {number: number < 10 or 20 <= number < 20 + fewer for number in range(45)}
    assert statistics.paired_difference(one, other) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("figure", "asked", "said"),
    [
        ((0.07, 0.06, 0.08), 0.08, "reached"),
        ((0.07, 0.06, 0.09), 0.08, "reached, with an interval that goes higher"),
        ((0.09, 0.07, 0.10), 0.08, "missed, with an interval that goes lower"),
        ((0.10, 0.09, 0.12), 0.08, "missed"),
    ],
)
def test_a_target_within_an_interval_is_neither_reached_nor_missed_for_sure(
    figure: tuple[float, float, float], asked: float, said: str
) -> None:
    """What is asked to be at least something is the mirror image of what is asked to be at most that."""
    value, low, high = figure
    assert statistics.against(Interval(*figure), asked, at_least=False) == said
    turned = said.replace("higher", "x").replace("lower", "higher").replace("x", "lower")
    assert statistics.against(Interval(-value, -high, -low), -asked, at_least=True) == turned


def test_figures_are_written_with_their_intervals() -> None:
    assert spanned(Interval(0.985, 0.93, 0.99), ".1f", 100.0, " %", ".0f") == "98.5 % [93, 99]"
    assert spanned(Interval(2.0, 1.0, inf), ".2g") == "2 [1, ∞]"
    assert spanned(NOTHING, ".2g") == ""
    assert Interval(2.0, 1.0, 3.0, 7).scaled(10.0) == (20.0, 10.0, 30.0, 7)
