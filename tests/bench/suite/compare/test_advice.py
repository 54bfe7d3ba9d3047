"""Curves, choices and advice on data made by hand, whose answer is plain."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from wholebody.bench.suite.compare.report import curve, groups
from wholebody.bench.suite.compare.results import ANSWERED, EFFORT, FLOOR, OVERTIME, REFUSED, WORST, Record, Results
from wholebody.bench.suite.compare.summary import OURS, advice, best, choices, standings, summaries

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


def test_the_line_of_a_chart_joins_the_medians_of_the_best_budgets() -> None:
    milliseconds, values = curve(results(OURS_CURVE), "s", OURS, WORST)
    assert milliseconds == pytest.approx([10.0, 20.0, 30.0])
    assert values == pytest.approx([1e-2, 2e-4, 2e-6])
    worse = curve_of(OURS, (1e-1, 0.010, 1e-1), (1e-4, 0.020, 1e-3), (1e-2, 0.030, 1e-2), (1e-6, 0.040, 1e-6))
    assert curve(results(worse), "s", OURS, WORST)[0] == pytest.approx([10.0, 20.0, 40.0])


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
    assert "`qp/daqp`" in said[0]
    assert "84 %" in said[0]  # Wilson, 20 of 20
    times = {standing.method: standing.slowness for standing in standings(made, rows)}
    assert times["qp/daqp"].low < 1.0 < times["qp/daqp"].high
    assert 1.0 < times["slow"].low < 3.0 < times["slow"].high


def test_no_accuracy_is_claimed_below_what_is_told_apart() -> None:
    made = results(noisy("one", 1.0, 1e-12, 0), noisy("other", 2.0, 0.0, 1))
    (choice,) = choices(made, summaries(made))
    assert set(choice.exact) == {"one", "other"}
    assert choice.exact_error == FLOOR


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


@pytest.mark.parametrize(("frames", "longest"), [(0, 20.0), (100, 0.2), (400, 0.1)])
def test_a_failure_counts_as_long_as_a_solve_or_a_frame_may_take(frames: int, longest: float) -> None:
    """A method that fails in every drag has no mean of 20 s beside frames of milliseconds."""
    one = Record("drag", 0, "qp", 1e-4, 0, ANSWERED, seconds=0.01, cpu_seconds=0.01, frames=frames)
    other = Record("drag", 0, "mink", 1e-4, 0, OVERTIME)
    rows = summaries(Results([one, other], ["drag"], ["qp", "mink"]))
    assert rows[1].mean_ms.value == pytest.approx(1e3 * longest)
