"""Intervals, against scipy, against the textbook, and by drawing samples whose truth is known."""

from __future__ import annotations

from math import inf, isnan

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from wholebody.bench import statistics
from wholebody.bench.statistics import NOTHING, Interval
from wholebody.bench.tables import spanned


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_intervals_of_shares_are_the_published_ones(count: int, of: int, low: float, high: float) -> None:
    """Newcombe 1998, "Two-sided confidence intervals for the single proportion", table I, method 3."""
    assert statistics.wilson(count, of) == pytest.approx((low, high), abs=5e-5)
    assert statistics.wilson(0, 0) == (0.0, 1.0)


def test_the_bootstrap_is_scipys_up_to_its_own_chance() -> None:
    """Ends of the interval agree to a twentieth of its width: 2,000 draws leave about 3 % of it to chance."""
    values = np.exp(np.random.default_rng(5).normal(-3.0, 1.0, 60))

    def mean(drawn: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
        return np.exp(np.log(drawn + 1e-3).mean(axis=axis)) - 1e-3

    for found, statistic in (
        (statistics.shifted_geometric_mean(values.tolist()), mean),
        (statistics.median(values.tolist()), np.median),
    ):
        expected = scipy.stats.bootstrap(
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
    low, high = scipy.stats.t.interval(0.95, 79, logs.mean(), logs.std(ddof=1) / np.sqrt(80))
    assert found.value == pytest.approx(np.exp(logs.mean()))
    assert (np.log(found.low), np.log(found.high)) == pytest.approx((low, high), abs=0.1 * (high - low))


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
    assert isnan(statistics.ratio(slower, dict(list(base.items())[:4])).value)


@pytest.mark.parametrize(("more", "fewer", "expected"), [(0, 0, 1.0), (6, 0, 1 / 32), (0, 5, 1 / 16), (3, 1, 0.625)])
def test_what_two_methods_solve_is_compared_by_the_problems_that_only_one_solves(
    more: int, fewer: int, expected: float
) -> None:
    """By coin tosses: twice the probability of as few heads."""
    one = {number: number < 10 + more for number in range(40)}
    other = {number: number < 10 or 20 <= number < 20 + fewer for number in range(45)}
    assert statistics.paired_difference(one, other) == pytest.approx(expected)


def test_figures_are_written_with_their_intervals() -> None:
    assert spanned(Interval(0.985, 0.93, 0.99), ".1f", 100.0, " %", ".0f") == "98.5 % [93, 99]"
    assert spanned(Interval(2.0, 1.0, inf), ".2g") == "2 [1, ∞]"
    assert spanned(NOTHING, ".2g") == ""
    assert Interval(2.0, 1.0, 3.0, 7).scaled(10.0) == (20.0, 10.0, 30.0, 7)
