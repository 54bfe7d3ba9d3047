"""The figures of every method in every set at the default budget, as one row each, and what they leave out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan
from typing import NamedTuple

from wholebody.bench.compare.record import COARSE, FAILED, FINE, OVERTIME, REFUSED, frame_cap
from wholebody.bench.compare.results import Results, effort_excess, middle
from wholebody.bench.compare.settings import Settings
from wholebody.bench.compare.statistics import Interval, median, share, shifted_geometric_mean
from wholebody.bench.compare.store import Chunk
from wholebody.bench.report import words
from wholebody.bench.tables import summed_programs

CAP = 20.0  # s: as a comparison ends a solve
SHOWN = 110  # characters of a message
GOOD = 0.98  # share of the cases that a method has to solve to be called dependable


@dataclass(frozen=True)
class Summary:
    """One method in one set.

    Attributes:
        cases, swept: given to it, fewer than asked for where it is too slow; and of these solved at all its budgets.
        refused, failed, overtime: cases without an answer: said so, broke, or took too long.
        said: the first refusal or exception.
        success, success_fine: share of the cases not refused that are solved to 1e-3 and to 1e-4, as judged.
        success_low, success_high: Wilson's interval of the first.
        false_claims: answers called solved that are off by more than 1 mm.
        median_ms, p95_ms, cpu_median_ms: of a call (of a frame where goals move), over all answers.
        median_low_ms, median_high_ms: bootstrap interval of the median.
        mean_ms, mean_low_ms, mean_high_ms: shifted geometric mean over all cases not refused, with its interval; one
            that is not solved counts as long as a solve, or on the average a frame, may take.
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
    cases: int
    swept: int
    refused: int
    failed: int
    overtime: int
    said: str
    success: float
    success_low: float
    success_high: float
    success_fine: float
    false_claims: int
    median_ms: float
    median_low_ms: float
    median_high_ms: float
    mean_ms: float
    mean_low_ms: float
    mean_high_ms: float
    kernels: float
    cold_ms: float
    p95_ms: float
    cpu_median_ms: float
    tool: float
    setup_ms: float
    iterations: float
    programs: str
    worst_median: float
    deepest_mm: float
    effort: float
    frame_p95_ms: float
    error_mm: float
    jerk: float
    turns: float

    @property
    def dependable(self) -> bool:
        """Whether it takes all cases and solves as many as a dependable method does."""
        return not self.refused and self.success >= GOOD


def summaries(results: Results, chunks: Sequence[Chunk] = (), cap: float = CAP) -> list[Summary]:
    """All rows, of methods that were given a case.

    Args:
        results: the records.
        chunks: what was timed beside them: the reference kernel, and first solves.
        cap: seconds of the processor's time after which a solve was ended.
    """
    kernel = kernel_of(chunks).value
    return [
        _summary(results, family, adapter, [chunk.cold for chunk in chunks if chunk.set == family], kernel, cap)
        for family in results.sets
        for adapter in results.adapters
        if results.default(family, adapter)
    ]


def kernel_of(chunks: Sequence[Chunk]) -> Interval:
    """Median seconds of the reference kernel over a run, with its interval; NaN where it was not timed."""
    return median([chunk.kernel for chunk in chunks if chunk.kernel > 0.0])


def _summary(
    results: Results, family: str, adapter: str, cold: Sequence[Mapping[str, float]], kernel: float, cap: float
) -> Summary:
    mine, taken = results.default(family, adapter), results.taken(family, adapter)
    answered = [record for record in mine if record.answered]
    efforts = [value for record in answered if (value := effort_excess(record, results.best(record))) < inf]
    silent = [record for record in mine if not record.answered]

    solved, fine = (share([record.success(tolerance) for record in taken]) for tolerance in (COARSE, FINE))
    usual = median([record.seconds for record in answered])
    cpu = middle([record.cpu_seconds for record in answered])
    longest = frame_cap(cap, results.frames(family)) if results.moving(family) else cap
    # the cap is of the processor's time: by the clock, a busy machine may take longer
    mean = shifted_geometric_mean(
        [min(record.seconds, longest) if record.success(COARSE) else longest for record in taken]
    )

    def count(outcome: str) -> int:
        return sum(record.outcome == outcome for record in mine)

    return Summary(
        set=family,
        method=adapter,
        cases=len(mine),
        swept=len(results.swept(family, adapter)),
        refused=count(REFUSED),
        failed=count(FAILED),
        overtime=count(OVERTIME),
        said=silent[0].said if silent else "",
        success=solved.value,
        success_low=solved.low,
        success_high=solved.high,
        success_fine=fine.value,
        false_claims=sum(record.false_claim for record in mine),
        median_ms=1e3 * usual.value,
        median_low_ms=1e3 * usual.low,
        median_high_ms=1e3 * usual.high,
        mean_ms=1e3 * mean.value,
        mean_low_ms=1e3 * mean.low,
        mean_high_ms=1e3 * mean.high,
        kernels=cpu / kernel,
        cold_ms=1e3 * middle([seconds[adapter] for seconds in cold if adapter in seconds]),
        p95_ms=1e3 * middle([record.seconds for record in answered], 0.95),
        cpu_median_ms=1e3 * cpu,
        tool=middle([record.tool_seconds / max(record.seconds, 1e-9) for record in answered]),
        setup_ms=1e3 * middle([record.setup_seconds for record in answered]),
        iterations=middle([record.iterations for record in answered]),
        programs=summed_programs(record.programs for record in answered),
        worst_median=middle([record.worst for record in answered]),
        deepest_mm=1e3 * max((record.penetration for record in answered), default=nan),
        effort=middle(efforts),
        frame_p95_ms=1e3 * middle([record.frame_p95 for record in answered], 0.95),
        error_mm=1e3 * middle([record.missed for record in answered]),
        jerk=middle([record.jerk for record in answered]),
        turns=middle([record.turns for record in answered]),
    )


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
