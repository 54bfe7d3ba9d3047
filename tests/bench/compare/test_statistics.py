"""Intervals and rankings, against scipy, against the textbook, and by drawing samples whose truth is known."""

from __future__ import annotations

from math import inf, isnan

import numpy as np
import pytest
from scipy import stats

from wholebody.bench.compare import statistics


@pytest.mark.parametrize(("count", "of"), [(0, 7), (199, 200), (200, 200), (3, 20), (1, 1)])
def test_intervals_of_shares_are_wilsons(count: int, of: int) -> None:
    expected = stats.binomtest(count, of).proportion_ci(method="wilson")
    assert statistics.wilson(count, of) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert statistics.wilson(0, 0) == (0.0, 1.0)


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
