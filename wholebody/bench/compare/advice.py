"""Which method to choose when, from the figures alone."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, inf, isfinite, log, nan
from typing import NamedTuple

from wholebody.bench.compare.curves import curve
from wholebody.bench.compare.results import QUANTITIES, Results
from wholebody.bench.compare.summary import GOOD, Summary

WORST = QUANTITIES[0]


class Choice(NamedTuple):
    """What to choose for one set; names are empty where no method is dependable.

    Attributes:
        set: which.
        fastest: dependable method with the least median time; its milliseconds.
        exact: dependable method with the least median error at any of its budgets; that error, and its milliseconds.
        cheapest: dependable method with the least effort; the effort above the best known.
        leading: where none is dependable, the one that solves most; its share.
    """

    set: str
    fastest: str
    fastest_ms: float
    exact: str
    exact_error: float
    exact_ms: float
    cheapest: str
    cheapest_effort: float
    leading: str
    leading_share: float


class Standing(NamedTuple):
    """A method over all sets.

    Attributes:
        entrant: its name.
        taken: sets of which it takes every case.
        dependable: sets of which it solves at least 98 %.
        worst_set, worst_share: where it solves least of what it takes.
        slowness: geometric mean over its dependable sets of its median time over the fastest dependable method's.
        false_claims: answers called solved that are off by more than 1 mm.
        deepest_mm: deepest overlap of all answers.
    """

    entrant: str
    taken: int
    dependable: int
    worst_set: str
    worst_share: float
    slowness: float
    false_claims: int
    deepest_mm: float


def choices(results: Results, rows: Sequence[Summary]) -> list[Choice]:
    """What to choose, set by set."""
    return [_choice(results, family, [row for row in rows if row.set == family]) for family in results.sets]


def _choice(results: Results, family: str, rows: Sequence[Summary]) -> Choice:
    good = [row for row in rows if row.dependable]
    taken = [row for row in rows if row.refused < row.cases]
    leading = max(taken, key=lambda row: row.success * (row.cases - row.refused) / row.cases, default=None)
    share = leading.success * (leading.cases - leading.refused) / leading.cases if leading else 0.0
    if not good:
        return Choice(family, "", nan, "", nan, nan, "", nan, leading.entrant if leading else "", share)
    fastest = min(good, key=lambda row: row.median_ms)
    ends = {row.entrant: _most_exact(results, family, row.entrant) for row in good}
    exact = min(ends, key=lambda name: ends[name])
    cheap = min(good, key=lambda row: row.effort if isfinite(row.effort) else inf)
    return Choice(
        family, fastest.entrant, fastest.median_ms, exact, *ends[exact],
        cheap.entrant if isfinite(cheap.effort) else "", cheap.effort, leading.entrant if leading else "", share,
    )  # fmt: skip


def _most_exact(results: Results, family: str, entrant: str) -> tuple[float, float]:
    """Least median error of a method, and the milliseconds of that budget."""
    points = curve(results, family, entrant, WORST)
    return min(((point.value, 1e3 * point.seconds) for point in points), default=(inf, inf))


def standings(results: Results, rows: Sequence[Summary]) -> list[Standing]:
    """All methods, the most dependable first, and of equal ones the fastest."""
    best = {
        family: min((row.median_ms for row in rows if row.set == family and row.dependable), default=inf)
        for family in results.sets
    }
    found = []
    for entrant in results.entrants:
        mine = [row for row in rows if row.entrant == entrant]
        if not mine:
            continue
        good = [row for row in mine if row.dependable]
        ratios = [log(max(row.median_ms, 1e-6) / max(best[row.set], 1e-6)) for row in good]
        judged = [row for row in mine if row.refused < row.cases]
        worst = min(judged, key=lambda row: row.success, default=None)
        found.append(
            Standing(
                entrant,
                sum(not row.refused for row in mine),
                len(good),
                worst.set if worst else "",
                worst.success if worst else nan,
                exp(sum(ratios) / len(ratios)) if ratios else nan,
                sum(row.false_claims for row in mine),
                max((row.deepest_mm for row in judged if isfinite(row.deepest_mm)), default=nan),
            )
        )
    return sorted(found, key=lambda standing: (-standing.dependable, standing.slowness))


def advice(results: Results, rows: Sequence[Summary]) -> list[str]:
    """What a reader who reads nothing else should know."""
    ranked, count = standings(results, rows), len(results.sets)
    said = []
    first = ranked[0] if ranked else None
    if first and first.dependable:
        said.append(
            f"**If in doubt, take `{first.entrant}`.** It solves at least {100 * GOOD:.0f} % of the problems in "
            f"{first.dependable} of {count} sets, and takes {first.slowness:.2g} times as long there as the fastest "
            "method that does."
        )
    else:
        said.append(f"**No method solves {100 * GOOD:.0f} % of any set.** Look at each set before choosing.")
    picked = choices(results, rows)
    fast: dict[str, list[str]] = {}
    for choice in picked:
        if choice.fastest:
            fast.setdefault(choice.fastest, []).append(f"{words(choice.set)} ({choice.fastest_ms:.3g} ms)")
    if fast:
        listed = "; ".join(f"`{name}` in {', '.join(sets)}" for name, sets in fast.items())
        said.append(f"**Fastest of the dependable:** {listed}.")
    exact = {choice.exact for choice in picked if choice.exact}
    if exact:
        said.append(
            "**Most accurate:** "
            + "; ".join(
                f"`{choice.exact}` in {words(choice.set)} ({choice.exact_error:.0e} in {choice.exact_ms:.3g} ms)"
                for choice in picked
                if choice.exact
            )
            + "."
        )
    said += [
        f"**{words(choice.set).capitalize()} is solved dependably by none;** `{choice.leading}` solves most, "
        f"{100 * choice.leading_share:.0f} %."
        for choice in picked
        if not choice.fastest
    ]
    for standing in ranked:
        if standing.dependable == 0 and isfinite(standing.worst_share):
            said.append(_warning(standing, rows))
    return said


def _warning(standing: Standing, rows: Sequence[Summary]) -> str:
    mine = [row for row in rows if row.entrant == standing.entrant and row.refused < row.cases]
    best = max(mine, key=lambda row: row.success)
    deep = f", and ends up to {standing.deepest_mm:.0f} mm inside of things" if standing.deepest_mm > 1.0 else ""
    return (
        f"**`{standing.entrant}` alone is not enough:** of what it takes it solves at most {100 * best.success:.0f} % "
        f"({words(best.set)}) and in {words(standing.worst_set)} {100 * standing.worst_share:.0f} %{deep}."
    )


def words(name: str) -> str:
    """The name of a set as one reads it."""
    return name.replace("_", " ")
