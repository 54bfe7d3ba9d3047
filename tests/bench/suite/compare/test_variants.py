"""Methods beside themselves set up otherwise, and who solves most: by hand-made records."""

from __future__ import annotations

import pytest

from wholebody.bench.suite.compare.advice import advice, choices, standings
from wholebody.bench.suite.compare.rankings import seeds_in_words, sensitivity
from wholebody.bench.suite.compare.record import ANSWERED, Record
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.summary import summaries
from wholebody.bench.suite.compare.variants import pruning, report, starts


def record(method: str, number: int, solved: bool, seconds: float = 0.1, family: str = "passage") -> Record:
    return Record(
        family, number, method, 1e-4, 0, ANSWERED, "solved", "", seconds, seconds,
        goal_error=1e-6 if solved else 0.1, goal_angle=0.0, penetration=0.0, clearance_violation=0.0,
        limit_violation=0.0, constraint_violation=0.0, measure=1.0, best=1.0,
    )  # fmt: skip


def run(**fails: int) -> Results:
    """Return forty problems; of each method so many of the first are not solved. "__" stands for "/"."""
    names = [name.replace("__", "/") for name in fails]
    records = [
        record(name, number, number >= count, 0.1 * (1 + place))
        for place, (name, count) in enumerate(zip(names, fails.values(), strict=True))
        for number in range(40)
    ]
    return Results(records, ["passage"], names)


def test_further_starts_stand_beside_one_start() -> None:
    found = run(qp=0, qp__one_start=4, newton__slack=1, newton__one_start=2, dls=40, dls__starts=10, placo=3)
    (qp, newton, dls) = starts(found)
    assert [one.method for one in (qp, newton, dls)] == ["qp", "newton", "dls"]
    assert [round(40 * each.value) for each in (*qp.shares[0], *newton.shares[0], *dls.shares[0])] == [
        36, 40, 38, 39, 0, 30
    ]  # fmt: skip
    text = report(found)
    assert "| `dls` | 0 % [0, 9] of 40 | 75 % [60, 86] of 40 |" in text
    assert "self contact" not in text
    assert "placo" not in text


def test_what_pruning_is_worth() -> None:
    found = run(placo__pruned=3, placo=5)
    pruned = pruning(found)
    assert pruned is not None
    assert (pruned.cases, pruned.differing) == (40, 2)
    assert pruned.ratios["passage"].value == pytest.approx(0.5)
    assert "differ in what they solve in 2." in report(found)
    assert "is 0.50 [0.50, 0.50] in passage." in report(found)
    assert pruning(run(placo=5)) is None


def test_who_solves_most_is_not_named_alone_inside_the_noise() -> None:
    """Five problems that one solves and the other does not are as likely as 1 in 16 by chance; six are 1 in 32."""
    near, far = run(best=0, near=5), run(best=0, far=6)
    assert choices(near, summaries(near))[0].leading == ("best", "near")
    assert choices(far, summaries(far))[0].leading == ("best",)
    assert choices(far, summaries(far))[0].leading_share == 1.0


def test_a_method_that_is_not_enough_is_told_with_intervals() -> None:
    found = run(best=0, poor=20)
    rows = summaries(found)
    assert any("solves at most 50 % [35, 65] (passage)" in sentence for sentence in advice(found, rows))
    worst = {one.method: one.worst for one in standings(found, rows)}["poor"]
    assert (worst.value, worst.low, worst.cases) == (0.5, pytest.approx(0.352, abs=1e-3), 40)


def test_the_widest_spread_of_seeds_is_told() -> None:
    said = seeds_in_words(sensitivity(run(best=0, near=1)), {"passage": "a passage"})
    assert "more than chance. The widest spread is that of `near` in a passage (13 of 14, 13 of 13, 13 of 13)." in said
