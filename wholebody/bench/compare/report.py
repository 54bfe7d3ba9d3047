"""The report of a comparison: what to choose when, the charts, the figures, and what was left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from wholebody.bench.compare import leftout, sections
from wholebody.bench.compare.advice import advice, choices, effort, error, reference, slowness, standings, words
from wholebody.bench.compare.blocks import Block, Chart, Heading, Points, Scenes, Table, Text
from wholebody.bench.compare.paired import algorithms
from wholebody.bench.compare.record import COARSE, DEFAULT
from wholebody.bench.compare.results import Results
from wholebody.bench.compare.settings import Settings
from wholebody.bench.compare.store import Chunk
from wholebody.bench.compare.summary import GOOD, Summary, summaries
from wholebody.bench.machine import sentence

FEW = 10  # problems below which a share is no share


@dataclass(frozen=True)
class Material:
    """All that a report is written from.

    Attributes:
        settings: what was asked for.
        chunks: what was done.
        results: the records of them.
        rows: the figures at the default budget.
        facts: of the machine and the run.
        missing: methods that are not installed, and the command that installs them.
    """

    settings: Settings
    chunks: Sequence[Chunk]
    results: Results
    rows: Sequence[Summary]
    facts: Mapping[str, str]
    missing: Mapping[str, str]


def material(
    settings: Settings, chunks: Sequence[Chunk], facts: Mapping[str, str], missing: Mapping[str, str]
) -> Material:
    """Put the records of a run in order."""
    records = [record for chunk in chunks for record in chunk.records]
    results = Results(
        records, [family.name for family in settings.sets], [adapter.name for adapter in settings.adapters]
    )
    return Material(settings, chunks, results, summaries(results), facts, missing)


def blocks(given: Material) -> list[Block]:
    """The whole report."""
    return [
        Heading(2, "What to choose when"),
        Points(advice(given.results, given.rows)),
        Text(basis(given)),
        _choices(given),
        Heading(2, "All methods at a glance"),
        _standings(given),
        Text(
            f"**Dependable** is a method that takes every problem of a set and solves at least {100 * GOOD:.0f} % of "
            f"them: goals met and everything that must hold kept to {COARSE:g} m and rad, as judged from the posture "
            "by a judge who shares no code with any method. **Time against** another method is the geometric mean "
            "over the problems that both solve, with its interval of 95 %."
        ),
        *_reading(given),
        *(block for family in given.settings.sets for block in sections.of_set(given.results, given.rows, family)),
        Heading(2, "Who is on the front"),
        *sections.front_part(given.results, given.settings.adapters),
        Heading(2, "Scenes of chosen cases"),
        Scenes(),
        Heading(2, "What was left out"),
        *leftout.part(given.settings, given.chunks, given.rows, given.missing),
        Heading(2, "How the methods were set up"),
        Points([leftout.setup(adapter) for adapter in given.settings.adapters]),
        Heading(2, "Settings and machine"),
        Text(settings_sentence(given)),
        Text(sentence(given.facts)),
    ]


def short(given: Material) -> list[Block]:
    """The part of the report that the documentation shows."""
    charts: list[Block] = []
    for family in given.settings.sets:
        name = f"compare-{family.name.replace('_', '-')}"
        charts += [Heading(3, family.title.capitalize()), Text(family.about), Chart(name, f"{family.title}")]
        charts += [Chart(f"{name}-profile", f"{family.title}: share solved within a time")]
        charts += [sections.figures(given.results, given.rows, family.name)]
    return [
        Heading(2, "What to choose when"),
        Points(advice(given.results, given.rows)),
        Text(basis(given)),
        _choices(given),
        _standings(given),
        *charts,
        Heading(3, "Who is on the front"),
        *sections.front_part(given.results, given.settings.adapters),
        Heading(3, "What was left out"),
        *leftout.part(given.settings, given.chunks, given.rows, given.missing),
        Text(settings_sentence(given)),
        Text(sentence(given.facts)),
    ]


def basis(given: Material) -> str:
    """How much the advice stands on."""
    counts = [row.cases for row in given.rows]
    least, most = min(counts, default=0), max(counts, default=0)
    said = f"This rests on {least} to {most} problems" if least < most else f"This rests on {most} problems"
    said += " a set for each method"
    if least < FEW:
        said += (
            "; where there are only a few, a share of 100 % says little: run it longer, on a machine with nothing else "
            "to do, or on more of them (`--jobs`, `--cluster`)"
        )
    return said + ". The tables below say how many each method was given."


def settings_sentence(given: Material) -> str:
    """What was run, in words."""
    settings = given.settings
    return (
        f"Seed {settings.seed}; up to {settings.cases} problems a set at a tolerance of {DEFAULT[0]:g} m and rad, the "
        f"first {settings.sweep} of them at every budget, a tenth of that where goals move; "
        f"{settings.minutes:g} minutes of solving in all, shared among "
        f"methods and sets; a solve is ended after {settings.cap:g} s (a drag after a tenth of a second a frame, if "
        "that is more). Every solve is by a fresh method in a process of its own on one thread, in turning order; one "
        "solve goes before the first and is not counted. Time is wall time of the call; the set-up of methods that "
        "build a model of their own, and the judgement, are apart."
    )


def _reading(given: Material) -> list[Block]:
    return [
        Heading(2, "How to read the charts"),
        Points(
            [
                "Down and to the left is better: more accurate, sooner. Each marker is one budget (a tolerance, a "
                "number of iterations, or for qp the first posture that fits at a tolerance): its median time and "
                "median error over the same problems; thin bars show the quartiles of the error and 95 % of the time. "
                "The line joins the best budgets of a method.",
                "**Worst of all** is the accuracy of an answer: the largest of goal error, overlap, lack of clearance, "
                "violated limits and constraints. In the other panels an answer that fails in anything else by more "
                "than 1 mm or mrad is none; an empty marker in the red band says that more than half of them are.",
                "Errors below 1e-9 are drawn as 1e-9. Effort is compared with the least that is known of the problem, "
                "from the witness and from all answers exact to 1e-6.",
                f"The steps show the share of problems solved within a time at the tolerance {DEFAULT[0]:g}; the "
                f"dashed line is {100 * GOOD:.0f} %. A method that refuses a problem is not counted for it, and the "
                "tables say how many it took.",
            ]
        ),
    ]


def _choices(given: Material) -> Table:
    rows = []
    for choice in choices(given.results, given.rows):
        most = f"{_plain(choice.leading)}, {100 * choice.leading_share:.3g} %"
        if not choice.fastest:
            rows.append((words(choice.set), "none", "", "", most))
            continue
        rows.append(
            (
                words(choice.set),
                f"{_plain(choice.fastest)} ({choice.fastest_ms:.3g} ms)",
                f"{_plain(choice.exact)} ({error(choice.exact_error)})" if choice.exact else "",
                f"{_plain(choice.cheapest)} ({effort(choice.cheapest_effort)})" if choice.cheapest else "",
                most,
            )
        )
    return Table(("problems", "fastest dependable", "most accurate dependable", "least effort", "solves most"), rows)


def _plain(adapters: Sequence[str]) -> str:
    return ", ".join(algorithms(adapters))


def _standings(given: Material) -> Table:
    rows = []
    for standing in standings(given.results, given.rows):
        worst = f"{words(standing.worst_set)} ({100 * standing.worst_share:.0f} %)" if standing.worst_set else ""
        rows.append(
            (
                standing.method, f"{standing.taken} of {len(given.results.sets)}", str(standing.dependable), worst,
                slowness(standing.slowness), str(standing.slowness.cases), str(standing.false_claims),
                f"{standing.deepest_mm:.2g}" if isfinite(standing.deepest_mm) else "",
            )
        )  # fmt: skip
    columns = ("method", "sets it takes", "dependable in", "solves least of",
               f"time against {reference(given.results)}", "problems compared",
               "false “solved”", "deepest overlap mm")  # fmt: skip
    return Table(columns, rows)
