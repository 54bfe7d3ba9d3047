"""Methods compared on the problems that both were given: the ratio of two figures with its interval.

Medians over different problems say nothing of two methods, and a ratio whose interval holds 1 names no winner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite

from wholebody.bench.statistics import LEAST, ratio
from wholebody.bench.suite.compare.record import COARSE, FLOOR
from wholebody.bench.suite.compare.results import WORST, Results, effort_excess, middle

OURS = "qp"
"""Our default method; "qp/..." is the same method with other settings for its programs."""

Figures = Mapping[tuple[str, int], float]
"""One positive figure a problem, by the name of its set and its number."""


def best(found: Mapping[str, Figures]) -> tuple[str, ...]:
    """Return the methods with the least figure, as many as cannot be told apart; the least of all first.

    A method that has too few problems in common with the least is left out. Where the least itself has too few problems
    to compare with anybody, nobody is told apart.
    """
    order = sorted((name for name in found if found[name]), key=lambda name: middle(list(found[name].values())))
    if order and len(found[order[0]]) < LEAST:
        return tuple(order)
    for first in order:
        others = {name: ratio(found[name], found[first]) for name in order if name != first}
        if not any(each.high < 1.0 for each in others.values()):
            return first, *(name for name, each in others.items() if each.cases >= LEAST and each.low <= 1.0)
    return tuple(order[:1])


def times(results: Results, families: Sequence[str], adapter: str) -> Figures:
    """Return the seconds of a method for every problem of some sets that it solves at the default budget."""
    return {
        (family, record.number): max(record.seconds, 1e-9)
        for family in families
        for record in results.taken(family, adapter)
        if record.success(COARSE)
    }


def efforts(results: Results, family: str, adapter: str) -> Figures:
    """Return the effort above the best known, as a share, for every problem that a method solves."""
    found = {
        (family, record.number): effort_excess(record, results.best(record))
        for record in results.default(family, adapter)
        if record.answered
    }
    return {key: value for key, value in found.items() if isfinite(value)}


def errors(results: Results, family: str, adapter: str) -> Figures:
    """Return the worst errors of a method at the budget where their median is least, on what it solved at all."""
    cases = results.swept(family, adapter)
    chosen: dict[tuple[str, int], float] = {}
    least = inf
    for level in results.levels(family, adapter):
        _, values = results.values(family, adapter, level, WORST, cases)
        if len(values) and middle(values) < least:
            least = middle(values)
            chosen = {(family, number): float(value) for number, value in zip(sorted(cases), values, strict=True)}
    return {key: max(value, FLOOR) if isfinite(value) else 1.0 for key, value in chosen.items()}


def named(adapters: Sequence[str]) -> str:
    """Return methods in words; several settings of our default method are listed behind its name."""
    ours = [name for name in adapters if f"{name}/".startswith(f"{OURS}/")]
    if len(ours) < 2:
        return ", ".join(f"`{name}`" for name in adapters)
    listed = f"`{OURS}` (any of {', '.join(f'`{name}`' for name in ours)})"
    names = dict.fromkeys(listed if name in ours else f"`{name}`" for name in adapters)
    return ", ".join(names)
