"""What further starts do for a method, and what pruning does for placo: methods beside themselves set up otherwise."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.bench.report import render
from wholebody.bench.statistics import LEAST, Interval, ratio, share
from wholebody.bench.suite.adapters.starts import ONE, STARTS
from wholebody.bench.suite.compare import paired
from wholebody.bench.suite.compare.advice import percent
from wholebody.bench.suite.compare.record import COARSE
from wholebody.bench.suite.compare.results import Results

SHOWN = ("self_contact", "passage")
"""Sets in which starts decide most of what is solved."""

PRUNED = ("placo/pruned", "placo")


class Starts(NamedTuple):
    """A method from one start and from several.

    Attributes:
        method: name of the algorithm.
        shares: for every set of `SHOWN` that was compared: solved from one start, and from several.
    """

    method: str
    shares: tuple[tuple[Interval, Interval], ...]


class Pruning(NamedTuple):
    """`PRUNED` beside each other.

    Attributes:
        cases, differing: problems that both were given, and those that one of the two solves and the other does not.
        ratios: the ratio of the processor's time by set, on the problems that both solve.
    """

    cases: int
    differing: int
    ratios: dict[str, Interval]


def starts(results: Results) -> list[Starts]:
    """Every method that took part from one start and from several, in the order of reports."""
    first: dict[str, str] = {}
    for name in results.adapters:
        first.setdefault(name.partition("/")[0], name)
    found = []
    for family, name in first.items():
        one, several = f"{family}/{ONE}", f"{family}/{STARTS}"
        pair = (one, name) if one in results.adapters else (name, several)
        if set(pair) <= set(results.adapters):
            shown = [each for each in SHOWN if each in results.sets]
            found.append(
                Starts(
                    family, tuple((_share(results, each, pair[0]), _share(results, each, pair[1])) for each in shown)
                )
            )
    return found


def pruning(results: Results) -> Pruning | None:
    """What pruning is worth; None where one of the two did not take part."""
    if not set(PRUNED) <= set(results.adapters):
        return None
    clock, cases, differing, ratios = results.by_processor(), 0, 0, {}
    for family in results.sets:
        one, other = ({each.number: each.success(COARSE) for each in results.taken(family, name)} for name in PRUNED)
        both = one.keys() & other.keys()
        cases, differing = cases + len(both), differing + sum(one[number] != other[number] for number in both)
        found = ratio(*(paired.times(clock, [family], name) for name in PRUNED))
        if found.cases >= LEAST:
            ratios[family] = found
    return Pruning(cases, differing, ratios)


def report(results: Results) -> str:
    """Both as text, for the page that describes comparisons."""
    return render(
        "compare_variants.md", starts=starts(results), sets=[each for each in SHOWN if each in results.sets],
        pruning=pruning(results), percent=percent,
    )  # fmt: skip


def _share(results: Results, family: str, name: str) -> Interval:
    return share([record.success(COARSE) for record in results.taken(family, name)])
