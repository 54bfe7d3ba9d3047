"""Curves and the front on data made by hand, whose answer is plain."""

from __future__ import annotations

from math import inf, isinf

import numpy as np
import pytest

from wholebody.bench.suite.compare.advice import advice, choices, standings
from wholebody.bench.suite.compare.charts import curve, groups, performance
from wholebody.bench.suite.compare.front import OURS, front, fronts, time_to
from wholebody.bench.suite.compare.paired import best
from wholebody.bench.suite.compare.rankings import rankings, seeds_in_words, sensitivity
from wholebody.bench.suite.compare.record import ANSWERED, FAILED, REFUSED, Record
from wholebody.bench.suite.compare.results import QUANTITIES, Results
from wholebody.bench.suite.compare.summary import summaries

WORST, GOAL, PENETRATION, EFFORT = QUANTITIES
CASES = range(5)


def record(
    adapter: str, number: int, tolerance: float, seconds: float, error: float, *, family: str = "s",
    penetration: float = 0.0, outcome: str = ANSWERED, measure: float = 1.0, status: str = "solved",
) -> Record:  # fmt: skip
    return Record(
        family, number, adapter, tolerance, 0, outcome, status, "", seconds, seconds, goal_error=error, goal_angle=0.0,
        penetration=penetration, clearance_violation=penetration, limit_violation=0.0, constraint_violation=0.0,
        measure=measure, optimality=0.0, best=1.0,
    )  # fmt: skip


def curve_of(adapter: str, *points: tuple[float, float, float]) -> list[Record]:
    """Points of (tolerance, seconds, error); cases differ by a factor about the middle one, which is the median."""
    return [
        record(adapter, number, tolerance, seconds * 2.0 ** (number - 2), error * 2.0 ** (number - 2))
        for tolerance, seconds, error in points
        for number in CASES
    ]


def results(*records: list[Record]) -> Results:
    flat = [one for some in records for one in some]
    return Results(flat, ["s"], list(dict.fromkeys(one.method for one in flat)))


OURS_CURVE = curve_of(OURS, (1e-2, 0.010, 1e-2), (1e-4, 0.020, 2e-4), (1e-6, 0.030, 2e-6))


def test_a_slower_method_leaves_ours_on_the_front() -> None:
    found = front(results(OURS_CURVE, curve_of("other", (1e-4, 0.040, 2e-4), (1e-6, 0.090, 2e-6))), "s", WORST)
    assert found is not None
    assert found.on_front
    assert (found.method, found.ratio.value) == ("other", pytest.approx(0.5))


def test_a_faster_method_at_one_accuracy_takes_ours_off_the_front_there() -> None:
    found = front(results(OURS_CURVE, curve_of("other", (1e-4, 0.040, 2e-4), (1e-6, 0.012, 2e-6))), "s", WORST)
    assert found is not None
    assert not found.on_front
    assert found.ratio.value == pytest.approx(30.0 / 12.0)
    assert found.accuracy in (1e-4, 3e-5, 1e-5)
    assert (found.ours, found.other) == (pytest.approx(0.030), pytest.approx(0.012))


def test_a_method_that_is_fast_but_coarse_does_not_count() -> None:
    found = front(results(OURS_CURVE, curve_of("other", (1e-4, 0.001, 0.02), (1e-6, 0.001, 0.01))), "s", WORST)
    assert found is not None
    assert found.method == ""


def test_failures_are_infinitely_slow() -> None:
    fast = curve_of("other", (1e-4, 0.001, 1e-5))
    broken = [one if one.number < 2 else record("other", one.number, 1e-4, 0.001, inf, outcome=FAILED) for one in fast]
    assert isinf(time_to(results(broken), "s", "other", WORST, 1e-3, frozenset(CASES)))
    found = front(results(OURS_CURVE, broken), "s", WORST)
    assert found is not None
    assert found.method == ""


def test_nine_in_ten_count_where_a_method_must_not_fail() -> None:
    """The fast one solves three of five: it is ahead by the median, and nowhere by nine in ten."""
    fast = curve_of("other", (1e-4, 0.001, 1e-5))
    broken = [one if one.number < 3 else record("other", one.number, 1e-4, 0.001, inf, outcome=FAILED) for one in fast]
    both = results(OURS_CURVE, broken)
    assert time_to(both, "s", "other", WORST, 1e-3, frozenset(CASES)) == pytest.approx(0.001)
    assert isinf(time_to(both, "s", "other", WORST, 1e-3, frozenset(CASES), 0.9))
    assert time_to(both, "s", OURS, WORST, 1e-3, frozenset(CASES), 0.9) == pytest.approx(0.080)
    by_median, by_most = front(both, "s", WORST), front(both, "s", WORST, share=0.9)
    assert by_median is not None
    assert not by_median.on_front
    assert by_most is not None
    assert by_most.on_front


def test_where_nobody_gets_there_ours_is_on_no_front() -> None:
    """Four of five are solved by both: enough for the median, by nine in ten it is nowhere."""
    ours, other = (
        [one if one.number else record(name, 0, one.tolerance, 0.001, inf, outcome=FAILED) for one in curve]
        for name, curve in ((OURS, OURS_CURVE), ("other", curve_of("other", (1e-4, 0.1, 1e-5))))
    )
    both = results(ours, other)
    by_median, by_most = front(both, "s", WORST), front(both, "s", WORST, share=0.9)
    assert by_median is not None
    assert by_median.method == "other"
    assert by_most is not None
    assert (by_most.method, by_most.on_front) == ("", False)


def test_an_answer_inside_of_something_is_no_accurate_one() -> None:
    inside = [record("other", number, 1e-4, 0.001, 1e-6, penetration=0.05) for number in CASES]
    for quantity in (WORST, GOAL, EFFORT):
        found = front(results(OURS_CURVE, inside), "s", quantity)
        assert found is not None
        assert found.on_front
    (point,) = curve(results(inside), "s", "other", WORST)
    assert point.value == 0.05
    assert isinf(curve(results(inside), "s", "other", GOAL)[0].value)


def test_methods_are_compared_on_the_cases_of_both() -> None:
    theirs = [one for one in curve_of("other", (1e-4, 0.012, 2e-4)) if one.number >= 3]  # the slow ones
    found = front(results(OURS_CURVE, theirs), "s", WORST)
    assert found is not None
    assert found.ratio.cases == 2
    assert found.ratio.value == pytest.approx(20.0 / 12.0)


def test_the_same_method_with_another_solver_is_no_rival() -> None:
    found = front(results(OURS_CURVE, curve_of("qp/other", (1e-4, 0.001, 1e-8))), "s", WORST)
    assert found is not None
    assert found.method == ""
    assert fronts(results(curve_of("other", (1e-4, 0.1, 1e-5)))) == []


def many(adapter: str, seconds: np.ndarray, error: float = 1e-6) -> list[Record]:
    return [record(adapter, number, 1e-4, float(each), error) for number, each in enumerate(seconds)]


def test_a_ratio_has_the_interval_of_its_problems() -> None:
    """A method that takes half as long in every problem does so in every draw; one that does by chance is not apart."""
    rng = np.random.default_rng(0)
    base = 0.01 * np.exp(rng.normal(size=40))
    twice = front(results(many(OURS, 2.0 * base), many("other", base)), "s", WORST)
    assert twice is not None
    assert twice.ratio[:3] == (pytest.approx(2.0), pytest.approx(2.0), pytest.approx(2.0))
    assert (twice.on_front, twice.verdict) == (False, "no")
    half = front(results(many(OURS, base), many("other", 2.0 * base)), "s", WORST)
    assert half is not None
    assert (half.on_front, half.verdict) == (True, "yes")
    noisy_ones = (base * np.exp(0.3 * rng.normal(size=40)) for _ in range(2))
    alike = front(
        results(*(many(name, each) for name, each in zip((OURS, "other"), noisy_ones, strict=True))), "s", WORST
    )
    assert alike is not None
    assert alike.ratio.low < 1.0 < alike.ratio.high
    assert alike.verdict == "not told apart"


def test_where_so_few_solve_a_problem_the_interval_says_so() -> None:
    """Twelve of twenty: in many draws fewer than half get there, and the ratio is endless; four say nothing."""
    base = np.full(20, 0.01)
    ours = [*many(OURS, base)[:12], *(record(OURS, number, 1e-4, 0.01, 0.5) for number in range(12, 20))]
    found = front(results(ours, many("other", 2.0 * base)), "s", WORST)
    assert found is not None
    assert found.ratio.value == pytest.approx(0.5)
    assert isinf(found.ratio.high)
    assert found.verdict == "not told apart"
    few = front(results(many(OURS, base[:4]), many("other", 3.0 * base[:4])), "s", WORST)
    assert few is not None
    assert (few.ratio.low, few.ratio.high, few.verdict) == (0.0, inf, "not told apart")


def test_points_are_medians_with_their_spread() -> None:
    points = curve(results(OURS_CURVE), "s", OURS, WORST)
    assert [point.seconds for point in points] == pytest.approx([0.010, 0.020, 0.030])
    assert [point.value for point in points] == pytest.approx([1e-2, 2e-4, 2e-6])
    assert (points[0].low, points[0].high) == (pytest.approx(0.5e-2), pytest.approx(2e-2))
    assert points[0].seconds_p95 == pytest.approx(0.040)


def test_effort_is_measured_against_the_best_exact_answer() -> None:
    exact = [record("a", 0, 1e-4, 0.1, 1e-8, measure=0.5)]
    cheat = [record("b", 0, 1e-4, 0.1, 5e-4, measure=0.1)]  # cheaper, by what it lacks
    made = results(exact, cheat)
    assert made.best(exact[0]) == 0.5
    assert EFFORT.of(record("c", 0, 1e-4, 0.1, 1e-8, measure=0.6), made.best(exact[0])) == pytest.approx(0.2)


def test_refusals_are_left_out_of_shares_and_seen_in_counts() -> None:
    some = [record("x", number, 1e-4, 0.1 * (number + 1), 1e-6) for number in range(3)]
    some += [record("x", number, 1e-4, inf, inf, outcome=REFUSED, status="") for number in (3, 4)]
    made = results(some)
    (row,) = summaries(made)
    assert (row.cases, row.refused, row.success.value) == (5, 2, 1.0)
    assert not row.dependable


def test_performance_profiles_are_of_the_problems_that_all_took() -> None:
    """By hand: problem 0 is b's by two, 1 is a's by ten, 2 is solved by a alone, 3 b refuses."""
    times = {"a": (0.2, 0.1, 0.5, 0.1), "b": (0.1, 1.0, 0.1, 0.1)}
    made = results(
        *(
            [
                record(name, number, 1e-4, seconds, 0.5 if (name, number) == ("b", 2) else 1e-6)
                for number, seconds in enumerate(listed)
            ]
            for name, listed in times.items()
        ),
    )
    refused = record("b", 3, 1e-4, inf, inf, outcome=REFUSED, status="")
    made = results(
        [*(one for name in "ab" for one in made.default("s", name) if (name, one.number) != ("b", 3))], [refused]
    )
    found = performance(made, "s", ["a", "b"], 1e-3)
    assert found["a"] == (pytest.approx([1.0, 1.0, 2.0]), 3)
    assert found["b"] == (pytest.approx([1.0, 10.0]), 3)


def test_a_chart_has_at_most_six_methods_and_further_ones_stand_beside_ours() -> None:
    names = ["qp", "qp/daqp", "qp/osqp", "newton/slack", "newton/kkt", "ccd", "dls", "placo", "mink", "pink"]
    found = groups(names)
    assert all(len(group) <= 6 and group[0] == "qp" for group in found)
    assert found[0] == ("qp", "newton/slack", "ccd", "dls", "placo", "mink")
    assert {name for group in found for name in group} == set(names)
    assert groups(["a", "b"]) == [("a", "b")]
    assert groups([]) == []


def test_nobody_is_the_fastest_of_four_problems() -> None:
    few = {("s", number): 0.1 for number in range(4)}
    assert best({"a": few, "b": dict.fromkeys(few, 9.0)}) == ("a", "b")
    many = {("s", number): 0.1 for number in range(9)}
    assert best({"a": many, "b": dict.fromkeys(many, 9.0)}) == ("a",)


def test_methods_that_differ_are_ranked_and_seeds_that_matter_are_named() -> None:
    def made(name: str, seconds: float, fails: int = 99) -> list[Record]:
        return [
            record(name, number, 1e-4, seconds * (1 + 0.01 * number), 0.5 if number % 3 == fails else 1e-6)
            for number in range(30)
        ]

    found = results(made("fast", 0.1), made("slow", 0.4), made("uneven", 0.1, fails=1))
    (one,) = rankings(found)
    assert one.ranking is not None
    assert one.ranking.methods[0] == "fast"
    assert one.ranking.cases == 30
    rows = sensitivity(found)
    assert [row.method for row in rows if row.differs] == ["uneven"]
    assert "`uneven` in a set (10 of 10, 0 of 10, 10 of 10)" in seeds_in_words(rows, {"s": "a set"})


def test_advice_names_the_dependable_and_the_fast() -> None:
    slow = curve_of("slow", (1e-4, 0.4, 1e-6))
    fast = [record("fast", number, 1e-4, 0.001, 1e-6 if number else 0.3) for number in CASES]
    quick = curve_of("quick", (1e-4, 0.1, 1e-5))
    made = results(slow, fast, quick)
    rows = summaries(made)
    (choice,) = choices(made, rows)
    assert (choice.fastest, choice.exact) == (("quick",), ("slow",))
    assert [standing.method for standing in standings(made, rows)] == ["quick", "slow", "fast"]
    said = advice(made, rows)
    assert "`quick`" in said[0]
    assert any("`fast` alone is not enough" in sentence and "80 %" in sentence for sentence in said)


def noisy(adapter: str, share: float, error: float, seed: int) -> list[Record]:
    """Solves of 20 problems whose times are off by some 20 % each, at random."""
    rng = np.random.default_rng(seed)
    return [
        record(adapter, number, 1e-4, share * 0.01 * (number + 1) * float(np.exp(0.2 * rng.normal())), error)
        for number in range(20)
    ]


def test_advice_names_no_winner_among_solvers_of_one_method() -> None:
    made = results(noisy("qp/osqp", 1.0, 1e-6, 0), noisy("qp/daqp", 0.99, 1e-6, 1), noisy("slow", 3.0, 1e-6, 2))
    rows = summaries(made)
    (choice,) = choices(made, rows)
    assert set(choice.fastest) == {"qp/osqp", "qp/daqp"}
    assert set(choice.exact) == {"qp/osqp", "qp/daqp", "slow"}
    said = advice(made, rows)
    assert said[0].startswith("**If in doubt, take `qp` (any of ")
    assert "cannot be told apart" in said[0]
    assert "begins at 84 %" in said[0]  # Wilson, 20 of 20
    times = {standing.method: standing.slowness for standing in standings(made, rows)}
    assert times["qp/daqp"].low < 1.0 < times["qp/daqp"].high
    assert 1.0 < times["slow"].low < 3.0 < times["slow"].high


def test_advice_claims_no_accuracy_below_what_is_told_apart() -> None:
    made = results(noisy("one", 1.0, 1e-12, 0), noisy("other", 2.0, 0.0, 1))
    rows = summaries(made)
    assert set(choices(made, rows)[0].exact) == {"one", "other"}
    (sentence,) = [sentence for sentence in advice(made, rows) if sentence.startswith("**Most accurate")]
    assert "at most 1e-09" in sentence


def test_methods_are_not_compared_over_different_problems() -> None:
    easy = [one for one in noisy("quick", 1.0, 1e-6, 0) if one.number < 10]  # it was given the short ones
    hard = [one for one in noisy("other", 1.0, 1e-6, 1) if one.number >= 10]
    made = results(noisy("qp/osqp", 1.0, 1e-6, 2), easy, hard)
    found = {standing.method: standing.slowness for standing in standings(made, summaries(made))}
    assert (found["quick"].cases, found["other"].cases) == (10, 10)
    assert all(0.8 < each.value < 1.25 for each in found.values())


def test_a_share_that_may_be_dependable_is_not_called_too_little() -> None:
    good = [record("good", number, 1e-4, 0.01, 1e-6) for number in range(200)]
    nearly = [record("nearly", number, 1e-4, 0.01, 0.3 if number < 5 else 1e-6) for number in range(200)]  # 97.5 %
    made = results(good, nearly)
    assert not any("`nearly` alone" in sentence for sentence in advice(made, summaries(made)))
