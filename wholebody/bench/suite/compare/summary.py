"""The figures of every method in every set at the default budget, as one row each, and what they leave out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, nan
from typing import NamedTuple

from wholebody.bench.report import words
from wholebody.bench.statistics import Interval, median, share, shifted_geometric_mean
from wholebody.bench.suite.compare.record import COARSE, FAILED, FINE, OVERTIME, REFUSED, frame_cap
from wholebody.bench.suite.compare.results import Results, effort_excess, middle
from wholebody.bench.suite.compare.settings import Settings
from wholebody.bench.suite.compare.store import Chunk
from wholebody.bench.tables import filled, of, summed_programs

CAP = 20.0  # s: as a comparison ends a solve
SHOWN = 110  # characters of a message
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

    Attributes:
        cases, swept: given to it, fewer than asked for where it is too slow; and of these solved at all its budgets.
        refused, failed, overtime: cases without an answer: said so, broke, or took too long.
        said: the first refusal or exception.
        success, success_fine: share of the cases not refused that are solved to 1e-3 and to 1e-4, as judged.
        false_claims: answers called solved that are off by more than 1 mm.
        median_ms, p95_ms, cpu_median_ms: of a call (of a frame where goals move), over all answers.
        mean_ms: shifted geometric mean over all cases not refused; one that is not solved counts as long as a solve, or
            on the average a frame, may take.
        kernels: the median of the processor's time in units of the reference kernel; NaN where that was not timed.
        cold_ms: median of the first solve in a process; NaN where no process was new.
        tool: share of the time within calls of the tool behind an adapter, median; 0 for methods of our own.
        setup_ms, iterations: medians; the first to build a model of its own.
        programs: what closed its quadratic programs, of all problems together.
        worst_median: median of the worst error [m or rad].
        deepest_mm: deepest overlap of all answers.
        effort: above the best known, median over the successes, as a share.
        frame_p95_ms, error_mm, jerk, turns: where goals move: 95 % of the frames, tracking error, trembling.
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
    success_fine: float = field(metadata=of(lambda cell: share([one.success(FINE) for one in cell.taken]).value))
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


def summaries(results: Results, chunks: Sequence[Chunk] = (), cap: float = CAP) -> list[Summary]:
    """All rows, of methods that were given a case.

    Args:
        results: the records.
        chunks: what was timed beside them: the reference kernel, and first solves.
        cap: seconds of the processor's time after which a solve was ended.
    """
    cells = (_Cell(results, family, adapter, chunks, cap) for family in results.sets for adapter in results.adapters)
    return [filled(Summary, cell) for cell in cells if cell.mine]


def kernel_of(chunks: Sequence[Chunk]) -> Interval:
    """Median seconds of the reference kernel over a run, with its interval; NaN where it was not timed."""
    return median([chunk.kernel for chunk in chunks if chunk.kernel > 0.0])


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
