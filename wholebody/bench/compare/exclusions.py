"""What a comparison does not show: refusals, failures, methods that are too slow or not installed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from wholebody.bench.compare.settings import Settings
from wholebody.bench.compare.store import Chunk
from wholebody.bench.compare.summary import Summary
from wholebody.bench.report import words

SHOWN = 110  # characters of a message


class Excluded(NamedTuple):
    """One reason to leave methods out, as a table."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]


class Exclusions(NamedTuple):
    """Everything that was left out.

    Attributes:
        tables: refusals, failures, and what there was no time for; none that is empty.
        faults: problems that could not be built, a sentence each.
    """

    tables: list[Excluded]
    faults: list[str]


def exclusions(settings: Settings, chunks: Sequence[Chunk], rows: Sequence[Summary]) -> Exclusions:
    """Collect refusals, failures and what there was no time for."""
    asked = {family.name: settings.asked(family) for family in settings.sets}
    tables = [
        Excluded(
            "Refused: what a method cannot express",
            ("method", "problems", "refused", "in its own words"),
            sorted(
                (row.method, words(row.set), "all" if row.refused == row.cases else f"{row.refused} of {row.cases}",
                 _cut(row.said))
                for row in rows
                if row.refused
            ),
        ),
        Excluded(
            "No answer: exceptions, answers that are not finite, and solves that took too long",
            ("method", "problems", "failed", "took too long", "the first"),
            sorted(
                (row.method, words(row.set), str(row.failed), str(row.overtime), _cut(row.said))
                for row in rows
                if row.failed or row.overtime
            ),
        ),
        Excluded(
            "Fewer problems, for there was no time for more",
            ("method", "problems", "at the default budget", "at all budgets"),
            sorted(
                (row.method, words(row.set), f"{row.cases} of {cases}", f"{row.swept} of {sweep}")
                for row in rows
                for cases, sweep in [asked[row.set]]
                if row.cases < cases or (row.swept < sweep and row.refused < row.cases)
            ),
        ),
    ]  # fmt: skip
    faults = [f"{words(chunk.set)} {chunk.number}: {chunk.fault}" for chunk in chunks if chunk.fault]
    return Exclusions([table for table in tables if table.rows], faults)


def _cut(text: str) -> str:
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."
