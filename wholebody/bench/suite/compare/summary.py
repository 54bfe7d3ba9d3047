"""The figures of every method in every set at the default budget, as one row each, and what they leave out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, nan

from wholebody.bench.report import words
from wholebody.bench.statistics import Interval, median, share, shifted_geometric_mean
from wholebody.bench.suite.compare.results import (
    COARSE,
    FAILED,
    OVERTIME,
    REFUSED,
    Chunk,
    Results,
    effort_excess,
    frame_cap,
    middle,
)
from wholebody.bench.suite.compare.settings import Settings
from wholebody.bench.tables import filled, of, summed_programs

GOOD = 0.98  # share of the cases that a method has to solve to be called dependable


class _Cell:
    """One method in one set: its records, and what is computed of several of them."""

    def __init__(self, results: Results, family: str, adapter: str, chunks: Sequence[Chunk], cap: float) -> None:
        self.set, self.method, self.results = family, adapter, results
        self.mine, self.taken = results.default(family, adapter), results.taken(family, adapter)
        self.answered = [record for record in self.mine if record.answered]
        self.silent = [record for record in self.mine if not record.answered]
        self.kernel = kernel_of(chunks).value
        self.cold = [chunk.cold[adapter] for chunk in chunks if chunk.set == family and adapter in chunk.cold]
        self.longest = frame_cap(cap, results.frames(family)) if results.moving(family) else cap

    def count(self, outcome: str) -> int:
        return sum(record.outcome == outcome for record in self.mine)

    def middle(self, name: str, share: float = 0.5) -> float:
        """A quantile over the answers."""
        return middle([getattr(record, name) for record in self.answered], share)

    def mean(self) -> Interval:
        # the cap is of the processor's time: by the clock, a busy machine may take longer
        return shifted_geometric_mean(
            [min(one.seconds, self.longest) if one.success(COARSE) else self.longest for one in self.taken]
        )

    def effort(self) -> float:
        efforts = (effort_excess(record, self.results.best(record)) for record in self.answered)
        return middle([value for value in efforts if value < inf])

    def tool(self) -> float:
        return middle([record.tool_seconds / max(record.seconds, 1e-9) for record in self.answered])


@dataclass(frozen=True)
class Summary:
    """One method in one set. Shares and times are with their intervals of 95 %.

    `cases` given to it, of which `swept` at all its budgets; `refused`, `failed`, `overtime`: without an answer, and
    `said` why first. Shares solved, to 1e-3 and 1e-4, are of the cases not refused. Times are of a call, or of a frame
    where goals move, over all answers; `mean_ms` is the shifted geometric mean in which a case that is not solved
    counts as long as a solve may take; `kernels` in units of the reference kernel; `tool`: share of the time within the
    tool behind an adapter. `effort`: above the best known, as a share; `deepest_mm` of all answers; `error_mm`, `jerk`
    and `turns` where goals move.
    """

    set: str
    method: str
    cases: int = field(metadata=of(lambda cell: len(cell.mine)))
    swept: int = field(metadata=of(lambda cell: len(cell.results.swept(cell.set, cell.method))))
    refused: int = field(metadata=of(lambda cell: cell.count(REFUSED)))
    failed: int = field(metadata=of(lambda cell: cell.count(FAILED)))
    overtime: int = field(metadata=of(lambda cell: cell.count(OVERTIME)))
    said: str = field(metadata=of(lambda cell: cell.silent[0].said if cell.silent else ""))
    success: Interval = field(metadata=of(lambda cell: share([one.success(COARSE) for one in cell.taken])))
    success_fine: float = field(metadata=of(lambda cell: share([one.success(1e-4) for one in cell.taken]).value))
    false_claims: int = field(metadata=of(lambda cell: sum(one.false_claim for one in cell.mine)))
    median_ms: Interval = field(metadata=of(lambda cell: median([one.seconds for one in cell.answered]).scaled(1e3)))
    mean_ms: Interval = field(metadata=of(lambda cell: cell.mean().scaled(1e3)))
    kernels: float = field(metadata=of(lambda cell: cell.middle("cpu_seconds") / cell.kernel))
    cold_ms: float = field(metadata=of(lambda cell: 1e3 * middle(cell.cold)))
    p95_ms: float = field(metadata=of(lambda cell: 1e3 * cell.middle("seconds", 0.95)))
    cpu_median_ms: float = field(metadata=of(lambda cell: 1e3 * cell.middle("cpu_seconds")))
    tool: float = field(metadata=of(lambda cell: cell.tool()))
    setup_ms: float = field(metadata=of(lambda cell: 1e3 * cell.middle("setup_seconds")))
    iterations: float = field(metadata=of(lambda cell: cell.middle("iterations")))
    programs: str = field(metadata=of(lambda cell: summed_programs(one.programs for one in cell.answered)))
    worst_median: float = field(metadata=of(lambda cell: cell.middle("worst")))
    deepest_mm: float = field(metadata=of(lambda cell: 1e3 * max((r.penetration for r in cell.answered), default=nan)))
    effort: float = field(metadata=of(lambda cell: cell.effort()))
    frame_p95_ms: float = field(metadata=of(lambda cell: 1e3 * cell.middle("frame_p95", 0.95)))
    error_mm: float = field(metadata=of(lambda cell: 1e3 * cell.middle("missed")))
    jerk: float = field(metadata=of(lambda cell: cell.middle("jerk")))
    turns: float = field(metadata=of(lambda cell: cell.middle("turns")))

    @property
    def dependable(self) -> bool:
        """Whether it takes all cases and solves as many as a dependable method does."""
        return not self.refused and self.success.value >= GOOD


def summaries(results: Results, chunks: Sequence[Chunk] = (), cap: float = 20.0) -> list[Summary]:
    """All rows, of methods that were given a case; `cap`: seconds of the processor after which a solve was ended."""
    cells = (_Cell(results, family, adapter, chunks, cap) for family in results.sets for adapter in results.adapters)
    return [filled(Summary, cell) for cell in cells if cell.mine]


def kernel_of(chunks: Sequence[Chunk]) -> Interval:
    """Median seconds of the reference kernel over a run, with its interval; NaN where it was not timed."""
    return median([chunk.kernel for chunk in chunks if chunk.kernel > 0.0])


def left_out(settings: Settings, chunks: Sequence[Chunk], rows: Sequence[Summary]) -> list[str]:
    """Sentences on refusals, failures, what there was no time for, and problems that could not be built."""
    asked, said = {family.name: settings.asked(family) for family in settings.sets}, list[str]()
    for row in rows:
        where, (cases, sweep) = f"`{row.method}`, {words(row.set)}", asked[row.set]
        if row.refused:
            said.append(f"{where}: refuses {row.refused} of {row.cases}: {_cut(row.said)}")
        elif row.failed or row.overtime:
            said.append(f"{where}: {row.failed} without an answer, {row.overtime} ended for time: {_cut(row.said)}")
        if row.cases < cases or (row.swept < sweep and row.refused < row.cases):
            said.append(f"{where}: {row.cases} of {cases} problems, {row.swept} of {sweep} at all budgets, for time")
    faults = [f"{words(chunk.set)} {chunk.number} could not be built: {chunk.fault}" for chunk in chunks if chunk.fault]
    return said + faults


def _cut(text: str) -> str:
    return text if len(text) <= 110 else text[:107] + "..."


@dataclass(frozen=True)
class Material:
    """All that a report is written from: `missing` are methods that are not installed, and what installs them."""

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
    return Material(settings, chunks, results, summaries(results, chunks, settings.cap), facts, missing)
