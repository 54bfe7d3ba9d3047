"""Which method to choose when, from the figures alone, and no winner where the figures do not tell one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf, isfinite, nan
from typing import NamedTuple

from wholebody.bench.report import spanned, upfirst, words
from wholebody.bench.statistics import LEVEL, NOTHING, Interval, against, paired_difference, ratio
from wholebody.bench.suite.compare import paired
from wholebody.bench.suite.compare.front import OURS, Rival
from wholebody.bench.suite.compare.paired import named
from wholebody.bench.suite.compare.record import COARSE, FLOOR
from wholebody.bench.suite.compare.results import EFFORT_FLOOR, Results, middle
from wholebody.bench.suite.compare.summary import GOOD, Summary


class Choice(NamedTuple):
    """What to choose for one set. Methods that cannot be told apart stand together; none where none is dependable.

    Attributes:
        fastest: dependable methods with the least time; the median milliseconds of the first.
        exact: dependable methods with the least error at any of their budgets; the median error of the first.
        cheapest: dependable methods with the least effort; the median effort of the first above the best known.
        leading: of the methods that were given all problems, the one that solves most, and those that do not solve
            fewer by more than chance, of the same problems; the share of the first.
    """

    set: str
    fastest: tuple[str, ...]
    fastest_ms: float
    exact: tuple[str, ...]
    exact_error: float
    cheapest: tuple[str, ...]
    cheapest_effort: float
    leading: tuple[str, ...]
    leading_share: float


class Standing(NamedTuple):
    """A method over all sets.

    Attributes:
        taken: sets of which it takes every case.
        dependable: sets of which it solves at least 98 %.
        worst_set, worst: where it solves least of what it takes.
        slowness: its time over that of the method that others are compared with, on the problems that both solve.
        false_claims: answers called solved that are off by more than 1 mm.
        deepest_mm: deepest overlap of all answers.
    """

    method: str
    taken: int
    dependable: int
    worst_set: str
    worst: Interval
    slowness: Interval
    false_claims: int
    deepest_mm: float


def choices(results: Results, rows: Sequence[Summary]) -> list[Choice]:
    """What to choose, set by set."""
    return [_choice(results, family, [row for row in rows if row.set == family]) for family in results.sets]


def _choice(results: Results, family: str, rows: Sequence[Summary]) -> Choice:
    good = [row.method for row in rows if row.dependable]
    given = max((row.cases for row in rows), default=0)  # others had easier or harder problems
    solved = {
        row.method: {one.number: one.success(COARSE) for one in results.default(family, row.method)}
        for row in rows
        if row.refused < row.cases == given
    }
    order = sorted(solved, key=lambda name: -sum(solved[name].values()))
    leading = tuple(name for name in order if paired_difference(solved[order[0]], solved[name]) > 1.0 - LEVEL)
    fast = paired.best({name: paired.times(results, [family], name) for name in good})
    errors = {name: paired.errors(results, family, name) for name in good}
    exact = paired.best(errors)
    efforts = {name: paired.efforts(results, family, name) for name in good} if not results.moving(family) else {}
    cheap = paired.best(efforts)
    return Choice(
        family,
        fast, next((row.median_ms.value for row in rows if fast and row.method == fast[0]), nan),
        exact, middle(list(errors[exact[0]].values())) if exact else nan,
        cheap, middle(list(efforts[cheap[0]].values())) if cheap else nan,
        leading, sum(solved[order[0]].values()) / given if order else 0.0,
    )  # fmt: skip


def reference(results: Results) -> str:
    """The method that others' times are compared with: our default, or the first where it did not take part."""
    return OURS if OURS in results.adapters else next(iter(results.adapters), "")


def standings(results: Results, rows: Sequence[Summary]) -> list[Standing]:
    """All methods, the most dependable first, and of equal ones the fastest."""
    base = paired.times(results, results.sets, reference(results))
    found = []
    for adapter in results.adapters:
        mine = [row for row in rows if row.method == adapter]
        if not mine:
            continue
        judged = [row for row in mine if row.refused < row.cases]
        worst = min(judged, key=lambda row: row.success.value, default=None)
        found.append(
            Standing(
                adapter,
                sum(not row.refused for row in mine),
                sum(row.dependable for row in mine),
                worst.set if worst else "",
                worst.success if worst else NOTHING,
                ratio(paired.times(results, results.sets, adapter), base) if base else NOTHING,
                sum(row.false_claims for row in mine),
                max((row.deepest_mm for row in judged if isfinite(row.deepest_mm)), default=nan),
            )
        )
    return sorted(found, key=lambda one: (-one.dependable, one.slowness.value if one.slowness.cases else inf))


def advice(results: Results, rows: Sequence[Summary]) -> list[str]:
    """What a reader who reads nothing else should know."""
    ranked, picked = standings(results, rows), choices(results, rows)
    said = [_in_doubt(results, ranked, rows)]
    fast = _by_method((one.fastest, f"{words(one.set)} ({one.fastest_ms:.3g} ms)") for one in picked if one.fastest)
    if fast:
        said.append(f"**Fastest of the dependable, on the problems that both solve:** {fast}.")
    exact = _by_method((one.exact, f"{words(one.set)} ({error(one.exact_error)})") for one in picked if one.exact)
    if exact:
        said.append(f"**Most accurate of the dependable:** {exact}. Errors below {FLOOR:g} are not told apart.")
    for choice in picked:
        if not choice.fastest:
            solve = "solves" if len(paired.algorithms(choice.leading)) == 1 else "solve"
            said.append(
                f"**{words(choice.set).capitalize()} is solved dependably by none;** "
                f"{named(choice.leading)} {solve} most, {100 * choice.leading_share:.3g} %{_alike(choice.leading)}."
            )
    for standing in ranked:
        if standing.dependable == 0 and isfinite(standing.worst.value):
            said += _warning(standing, rows)
    return said


def _alike(leading: Sequence[str]) -> str:
    """What to add to the share of the first of several methods that cannot be told apart."""
    return " by the first, and not apart from it by more than chance" if len(leading) > 1 else ""


def _by_method(found: Iterable[tuple[Sequence[str], str]]) -> str:
    """Methods, each with what is said of it in some sets."""
    sets: dict[str, list[str]] = {}
    for methods, said in found:
        sets.setdefault(named(methods), []).append(said)
    return "; ".join(f"{names} in {', '.join(each)}" for names, each in sets.items())


def _in_doubt(results: Results, ranked: Sequence[Standing], rows: Sequence[Summary]) -> str:
    """Which method to take where nothing else is known: the most dependable, and of those the ones that are fastest."""
    most = max((one.dependable for one in ranked), default=0)
    if not most:
        return f"**No method solves {100 * GOOD:.0f} % of any set.** Look at each set before choosing."
    names = [one.method for one in ranked if one.dependable == most]
    alike = paired.best({name: paired.times(results, results.sets, name) for name in names})
    apart = "" if len(alike) == 1 else " Their times cannot be told apart." if len(paired.algorithms(alike)) > 1 else ""
    if not apart and len(alike) > 1:
        apart = " The times of its settings cannot be told apart."
    solves = "It solves" if len(paired.algorithms(alike)) == 1 else "Each solves"
    lowest = min(row.success.low for row in rows if row.method in alike and row.dependable)
    return (
        f"**If in doubt, take {named(alike)}.** {solves} at least {100 * GOOD:.0f} % of the problems given in "
        f"{most} of {len(results.sets)} sets; "
        f"the lowest interval of these shares begins at {100 * lowest:.0f} %.{apart}"
    )


def _warning(standing: Standing, rows: Sequence[Summary]) -> list[str]:
    """That a method is not enough, if in no set so many problems that it might be dependable after all are solved."""
    mine = [row for row in rows if row.method == standing.method and row.refused < row.cases]
    if any(not row.refused and row.success.high >= GOOD for row in mine):
        return []
    best = max(mine, key=lambda row: row.success.value)
    deep = f", and ends up to {standing.deepest_mm:.0f} mm inside of things" if standing.deepest_mm > 1.0 else ""
    worst = "" if standing.worst_set == best.set else f" and in {words(standing.worst_set)} {percent(standing.worst)}"
    return [
        f"**`{standing.method}` alone is not enough:** of what it takes it solves at most {percent(best.success)} "
        f"({words(best.set)}){worst}{deep}."
    ]


def targets(rows: Sequence[Summary], wall: Sequence[Rival], dependable: Sequence[Rival]) -> list[str]:
    """What is asked of our default method, and what was found, with its interval; empty where it did not take part.

    Args:
        rows: the figures of all methods.
        wall: who is on the front by the median.
        dependable: the same by the time of nine problems in ten.
    """
    mine = [row for row in rows if row.method == OURS and row.refused < row.cases]
    if not mine:
        return []
    verdicts: dict[str, list[Summary]] = {
        "reached": [],
        "reached, with an interval that goes lower": [],
        "missed, with an interval that goes higher": [],
        "missed": [],
    }
    for row in mine:
        verdicts[against(row.success, GOOD, at_least=True)].append(row)
    found = "; ".join(
        f"{verdict}: "
        + ", ".join(f"{words(row.set)} {spanned(row.success, '.1f', 100.0, ' %')} of {row.cases}" for row in listed)
        for verdict, listed in verdicts.items()
        if listed
    )
    said = [f"`{OURS}` solves at least {100 * GOOD:.0f} % of every set. {upfirst(found)}."]
    if wall:
        ahead = sorted({rival.method for rival in wall if not rival.on_front and rival.method})
        verdict = "Missed" if ahead else "Reached"
        said.append(
            f"In no chart is another method both faster than `{OURS}` and as accurate. {verdict}: `{OURS}` is on the "
            f"front of {sum(rival.on_front for rival in wall)} of {len(wall)} charts, and of "
            f"{sum(rival.on_front for rival in dependable)} of {len(dependable)} by the time in which nine problems in "
            f"ten are solved"
            + (
                f"; ahead of it in a chart: {', '.join(f'`{name}`' for name in ahead)}, in "
                f"{sum(rival.verdict == 'no' for rival in wall)} charts by more than the interval of the ratio."
                if ahead
                else "."
            )
        )
    return said


def error(value: float) -> str:
    """An error as it was measured: those at the least that is told apart are at most that."""
    return f"at most {FLOOR:g}" if value <= FLOOR else f"{value:.0e}"


def effort(value: float) -> str:
    """An effort above the best known, in the same way."""
    return f"at most +{100 * EFFORT_FLOOR:.2g} %" if value <= EFFORT_FLOOR else f"+{100 * value:.2g} %"


def percent(found: Interval) -> str:
    """A share with its interval; empty where there is none."""
    return spanned(found, ".0f", 100.0, " %")


def slowness(found: Interval) -> str:
    """A ratio of times with its interval; empty where there are too few problems."""
    return f"× {spanned(found, '.2g')}" if isfinite(found.value) else ""
