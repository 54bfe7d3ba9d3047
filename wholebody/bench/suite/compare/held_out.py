"""Held-out distributions beside the sets of the same question that constants were tuned on: shares, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wholebody.base.errors import InputError
from wholebody.bench.report import render
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.run import Progress, run
from wholebody.bench.suite.compare.settings import Settings
from wholebody.bench.suite.compare.summary import Summary, summaries
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.problem_sets.registry import TUNED_ON, problem_set


class Beside(NamedTuple):
    """One method in a held-out set, and in the one that constants were tuned on; None where it took part in none."""

    method: str
    held_out: Summary
    tuned_on: Summary | None


def settings(adapters: tuple[Adapter, ...], cases: int, seed: int, minutes: float) -> tuple[Settings, str]:
    """What is run: every held-out set and its counterpart; and why a set is left out, empty where none is."""
    left_out, names = "", list(TUNED_ON)
    try:
        robots.folder()
    except InputError as error:
        left_out = str(error)
        names.remove("robots")
    chosen = [*names, *dict.fromkeys(TUNED_ON[name] for name in names)]
    families = tuple(problem_set(name) for name in chosen)
    return Settings(families, adapters, cases, sweep=0, levels=1, seed=seed, cap=20.0, minutes=minutes), left_out


def measured(asked: Settings, folder: Path, jobs: int, tell: Callable[[Progress], None]) -> list[Summary]:
    """Run it, or go on with it, and return the figures of every method in every set."""
    store = run(asked, folder, jobs, None, tell)
    results = Results(
        store.records, [family.name for family in asked.sets], [adapter.name for adapter in asked.adapters]
    )
    return summaries(results, store.chunks, asked.cap)


def beside(rows: Sequence[Summary]) -> dict[str, list[Beside]]:
    """The figures of each held-out set, by its name, with those of its counterpart."""
    found = {(row.set, row.method): row for row in rows}
    return {
        name: [
            Beside(method, row, found.get((TUNED_ON[name], method)))
            for (family, method), row in found.items()
            if family == name
        ]
        for name in TUNED_ON
        if any(family == name for family, _ in found)
    }


def report(rows: Sequence[Summary], asked: Settings, left_out: str, facts: Mapping[str, str]) -> str:
    """The page's part as Markdown."""
    sets = {family.name: family for family in asked.sets}
    return render(
        "held_out.md",
        listed=beside(rows), sets=sets, tuned_on=TUNED_ON, asked=asked, left_out=left_out, facts=facts,
    )  # fmt: skip
