"""What a comparison does not show: refusals, failures, methods that are too slow or not installed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.compare.advice import words
from wholebody.bench.compare.blocks import Block, Heading, Points, Table, Text
from wholebody.bench.compare.settings import Settings
from wholebody.bench.compare.store import Chunk
from wholebody.bench.compare.summary import Summary

SHOWN = 110  # characters of a message


def part(
    settings: Settings, chunks: Sequence[Chunk], rows: Sequence[Summary], missing: Mapping[str, str]
) -> list[Block]:
    """Tables of refusals, of failures and of what there was no time for."""
    told: list[Block] = []
    told += _refusals(rows) + _failures(rows) + _slow(settings, rows)
    faults = [f"{words(chunk.set)} {chunk.number}: {chunk.fault}" for chunk in chunks if chunk.fault]
    if faults:
        told += [Heading(3, "Problems that could not be built"), Points(faults)]
    if missing:
        told.append(Heading(3, "Methods that are not installed"))
        told.append(Points([f"`{name}`: `{command}`" for name, command in missing.items()]))
    return told or [Text("Nothing: every method took every problem of every set.")]


def setup(adapter: Adapter) -> str:
    """How a method was set up, and what it cannot express."""
    differences = "".join(f"; {sentence}" for sentence in adapter.differences)
    return f"**{adapter.name}**: {adapter.setup.rstrip('.')}{differences}."


def _refusals(rows: Sequence[Summary]) -> list[Block]:
    found = [
        (row.method, words(row.set), "all" if row.refused == row.cases else f"{row.refused} of {row.cases}",
         _cut(row.said))
        for row in rows
        if row.refused
    ]  # fmt: skip
    if not found:
        return []
    return [
        Heading(3, "Refused: what a method cannot express"),
        Table(("method", "problems", "refused", "in its own words"), sorted(found)),
    ]


def _failures(rows: Sequence[Summary]) -> list[Block]:
    found = [
        (row.method, words(row.set), str(row.failed), str(row.overtime), _cut(row.said))
        for row in rows
        if row.failed or row.overtime
    ]
    if not found:
        return []
    return [
        Heading(3, "No answer: exceptions, answers that are not finite, and solves that took too long"),
        Table(("method", "problems", "failed", "took too long", "the first"), sorted(found)),
    ]


def _slow(settings: Settings, rows: Sequence[Summary]) -> list[Block]:
    asked = {family.name: settings.asked(family) for family in settings.sets}
    found = [
        (row.method, words(row.set), f"{row.cases} of {cases}", f"{row.swept} of {sweep}")
        for row in rows
        for cases, sweep in [asked[row.set]]
        if row.cases < cases or (row.swept < sweep and row.refused < row.cases)
    ]
    if not found:
        return []
    return [
        Heading(3, "Fewer problems, for there was no time for more"),
        Table(("method", "problems", "at the default budget", "at all budgets"), sorted(found)),
    ]


def _cut(text: str) -> str:
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."
