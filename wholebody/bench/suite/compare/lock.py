"""What a comparison found, with all that is needed to do it again; and what differs, when it is done again.

A figure differs where the published value is outside of the new interval, and the new one outside of the published.
Times are in units of the reference kernel.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import read_text
from wholebody.bench.statistics import LEAST, Interval, median
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.compare.run import Settings
from wholebody.bench.suite.compare.summary import Material, kernel_of
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.bench.tables import spanned, words, write_text

NAME = "lock.json"
HEAD = {"format": "wholebody comparison", "version": "1.0"}
AMOUNTS = ("cases", "sweep", "levels", "seed", "cap", "minutes")


@dataclass(frozen=True)
class Locked:
    """A comparison as published: `figures` by set, method and name, "solved" and "median time" in kernels."""

    sets: tuple[str, ...]
    methods: tuple[str, ...]
    amounts: Mapping[str, float]
    facts: Mapping[str, str]
    figures: Mapping[tuple[str, str, str], Interval]

    def settings(self) -> Settings:
        """The settings to do it again; UnknownNameError for a set or a method that is not known or not installed."""
        given = self.amounts
        return Settings(
            tuple(problem_set(name) for name in self.sets),
            adapters(self.methods),
            cases=int(given["cases"]),
            sweep=int(given["sweep"]),
            levels=int(given["levels"]),
            seed=int(given["seed"]),
            cap=given["cap"],
            minutes=given["minutes"],
        )


def locked(given: Material) -> Locked:
    """What a comparison found. An interval of a time in kernels has the uncertainty of the kernel's own time too."""
    kernel = kernel_of(given.chunks)
    figures: dict[tuple[str, str, str], Interval] = {}
    for row in given.rows:
        if row.refused < row.cases:
            figures[row.set, row.method, "solved"] = Interval(*row.success[:3])
            answered = [one for one in given.results.default(row.set, row.method) if one.answered]
            spent = median([one.cpu_seconds for one in answered])
            times = (spent.value / kernel.value, spent.low / kernel.high, spent.high / kernel.low)
            if row.cases - row.refused >= LEAST and all(isfinite(value) for value in times):
                figures[row.set, row.method, "median time"] = Interval(*times)
    asked = given.settings
    return Locked(
        tuple(family.name for family in asked.sets),
        tuple(adapter.name for adapter in asked.adapters),
        {name: getattr(asked, name) for name in AMOUNTS},
        given.facts,
        figures,
    )


def write_lock(path: Path, found: Locked) -> None:
    """Write a lock file."""
    content = {
        **HEAD,
        "sets": list(found.sets),
        "methods": list(found.methods),
        "amounts": dict(found.amounts),
        "facts": dict(found.facts),
        "figures": [[*key, *figure[:3]] for key, figure in found.figures.items()],
    }
    write_text(path, json.dumps(content, indent=1) + "\n")


def read_lock(path: Path) -> Locked:
    """Read a lock file; FileFormatError where it is none."""
    text = read_text(path, "lock file")
    try:
        content: Any = json.loads(text)
        if {name: content[name] for name in HEAD} != HEAD:
            raise ValueError(f"its format is not {' '.join(HEAD.values())}")
        return Locked(
            tuple(map(str, content["sets"])),
            tuple(map(str, content["methods"])),
            {name: float(content["amounts"][name]) for name in AMOUNTS},
            {str(name): str(value) for name, value in content["facts"].items()},
            {
                (str(a), str(b), str(c)): Interval(float(value), float(low), float(high))
                for a, b, c, value, low, high in content["figures"]
            },
        )
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise FileFormatError(
            f"{path}: no lock file of `wholebody bench compare` ({error}); give the {NAME} of a run"
        ) from None


class Difference(NamedTuple):
    """One figure that is not what was published."""

    set: str
    method: str
    what: str
    published: Interval
    found: Interval


def differences(published: Locked, found: Locked) -> list[Difference]:
    """Figures that differ by more than their intervals, in the order of the lock; InputError where none is common."""
    common = [key for key in published.figures if key in found.figures]
    if not common:
        raise InputError(
            "the two comparisons have no figure in common; give the lock file of the same sets and methods"
        )
    pairs = [(key, published.figures[key], found.figures[key]) for key in common]
    return [
        Difference(*key, one, other)
        for key, one, other in pairs
        if not (one.low <= other.value <= one.high or other.low <= one.value <= other.high)
    ]


def in_words(published: Locked, found: Locked) -> list[str]:
    """What differs, a sentence each: figures first, then what of the machine and the versions."""
    common = sum(key in found.figures for key in published.figures)
    differing = differences(published, found)
    said = [f"{common} figures compared; {len(differing)} differ by more than their intervals."]
    said += [
        f"{words(one.set)}, {one.method}, {one.what}: {_shown(one.what, one.published)} published, "
        f"{_shown(one.what, one.found)} now."
        for one in differing
    ]
    missing = [key for key in published.figures if key not in found.figures]
    if missing:
        said.append(f"{len(missing)} published figures were not found again, {', '.join(missing[0])} first.")
    changed = [
        f"{name} {value}, now {found.facts.get(name, 'absent')}"
        for name, value in published.facts.items()
        if found.facts.get(name) != value and name not in ("load", "date")
    ]
    if changed:
        said.append(f"Other than published: {'; '.join(changed)}.")
    return said


def _shown(what: str, figure: Interval) -> str:
    if what == "solved":
        return spanned(figure, ".1f", 100.0, " %", ".0f")
    return spanned(figure, ".3g", unit=" kernels")


def shares(found: Sequence[Difference]) -> list[Difference]:
    """Those that are of what is solved: they do not depend on the machine."""
    return [one for one in found if one.what == "solved"]
