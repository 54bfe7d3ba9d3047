"""The figures of every method in every set at the default budget, what they leave out, and which method to choose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf, isfinite, nan
from operator import attrgetter
from typing import Any, NamedTuple

from wholebody.base.errors import one_line
from wholebody.bench.statistics import (
    LEAST,
    LEVEL,
    NOTHING,
    Interval,
    median,
    paired_difference,
    ratio,
    share,
    shifted_geometric_mean,
)
from wholebody.bench.suite.compare.results import (
    COARSE,
    FAILED,
    FLOOR,
    OVERTIME,
    REFUSED,
    WORST,
    Chunk,
    Results,
    effort_excess,
    frame_cap,
    middle,
)
from wholebody.bench.suite.compare.run import Settings
from wholebody.bench.tables import spanned, summed_programs, words

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


def _of(compute: Callable[[_Cell], Any]) -> dict[str, Callable[[_Cell], Any]]:
    """What computes a field from a cell, as its metadata."""
    return {"of": compute}


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
    cases: int = field(metadata=_of(lambda cell: len(cell.mine)))
    swept: int = field(metadata=_of(lambda cell: len(cell.results.swept(cell.set, cell.method))))
    refused: int = field(metadata=_of(lambda cell: cell.count(REFUSED)))
    failed: int = field(metadata=_of(lambda cell: cell.count(FAILED)))
    overtime: int = field(metadata=_of(lambda cell: cell.count(OVERTIME)))
    said: str = field(metadata=_of(lambda cell: cell.silent[0].said if cell.silent else ""))
    success: Interval = field(metadata=_of(lambda cell: share([one.success(COARSE) for one in cell.taken])))
    success_fine: float = field(metadata=_of(lambda cell: share([one.success(1e-4) for one in cell.taken]).value))
    false_claims: int = field(metadata=_of(lambda cell: sum(one.false_claim for one in cell.mine)))
    median_ms: Interval = field(metadata=_of(lambda cell: median([one.seconds for one in cell.answered]).scaled(1e3)))
    mean_ms: Interval = field(metadata=_of(lambda cell: cell.mean().scaled(1e3)))
    kernels: float = field(metadata=_of(lambda cell: cell.middle("cpu_seconds") / cell.kernel))
    cold_ms: float = field(metadata=_of(lambda cell: 1e3 * middle(cell.cold)))
    p95_ms: float = field(metadata=_of(lambda cell: 1e3 * cell.middle("seconds", 0.95)))
    cpu_median_ms: float = field(metadata=_of(lambda cell: 1e3 * cell.middle("cpu_seconds")))
    tool: float = field(metadata=_of(lambda cell: cell.tool()))
    setup_ms: float = field(metadata=_of(lambda cell: 1e3 * cell.middle("setup_seconds")))
    iterations: float = field(metadata=_of(lambda cell: cell.middle("iterations")))
    programs: str = field(metadata=_of(lambda cell: summed_programs(one.programs for one in cell.answered)))
    worst_median: float = field(metadata=_of(lambda cell: cell.middle("worst")))
    deepest_mm: float = field(metadata=_of(lambda cell: 1e3 * max((r.penetration for r in cell.answered), default=nan)))
    effort: float = field(metadata=_of(lambda cell: cell.effort()))
    frame_p95_ms: float = field(metadata=_of(lambda cell: 1e3 * cell.middle("frame_p95", 0.95)))
    error_mm: float = field(metadata=_of(lambda cell: 1e3 * cell.middle("missed")))
    jerk: float = field(metadata=_of(lambda cell: cell.middle("jerk")))
    turns: float = field(metadata=_of(lambda cell: cell.middle("turns")))

    @property
    def dependable(self) -> bool:
        """Whether it takes all cases and solves as many as a dependable method does."""
        return not self.refused and self.success.value >= GOOD


def summaries(results: Results, chunks: Sequence[Chunk] = (), cap: float = 20.0) -> list[Summary]:
    """All rows, of methods that were given a case; `cap`: seconds of the processor after which a solve was ended."""
    cells = (_Cell(results, family, adapter, chunks, cap) for family in results.sets for adapter in results.adapters)
    computed = {each.name: each.metadata.get("of", attrgetter(each.name)) for each in fields(Summary)}
    return [Summary(**{name: of(cell) for name, of in computed.items()}) for cell in cells if cell.mine]


def kernel_of(chunks: Sequence[Chunk]) -> Interval:
    """Median seconds of the reference kernel over a run, with its interval; NaN where it was not timed."""
    return median([chunk.kernel for chunk in chunks if chunk.kernel > 0.0])


def left_out(settings: Settings, chunks: Sequence[Chunk], rows: Sequence[Summary]) -> list[str]:
    """Sentences on refusals, failures, what there was no time for, and problems that could not be built."""
    asked, said = {family.name: settings.asked(family) for family in settings.sets}, list[str]()
    for row in rows:
        where, (cases, sweep), why = f"`{row.method}`, {words(row.set)}", asked[row.set], one_line(row.said, 110)
        if row.refused:
            said.append(f"{where}: refuses {row.refused} of {row.cases}: {why}")
        elif row.failed or row.overtime:
            said.append(f"{where}: {row.failed} without an answer, {row.overtime} ended for time: {why}")
        if row.cases < cases or (row.swept < sweep and row.refused < row.cases):
            said.append(f"{where}: {row.cases} of {cases} problems, {row.swept} of {sweep} at all budgets, for time")
    faults = [f"{words(chunk.set)} {chunk.number} could not be built: {chunk.fault}" for chunk in chunks if chunk.fault]
    return said + faults


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


OURS = "qp"  # our default method

Figures = Mapping[tuple[str, int], float]  # one positive figure a problem, by the name of its set and its number


def best(found: Mapping[str, Figures]) -> tuple[str, ...]:
    """Return the methods with the least figure and those not distinguishable from them; the least first."""
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
        if record.success(COARSE) and isfinite(record.seconds)
    }


def efforts_of(results: Results, family: str, adapter: str) -> Figures:
    """Return the effort above the best known, as a share, for every problem that a method solves."""
    found = {
        (family, record.number): effort_excess(record, results.best(record))
        for record in results.default(family, adapter)
        if record.answered
    }
    return {key: value for key, value in found.items() if isfinite(value)}


def errors_of(results: Results, family: str, adapter: str) -> Figures:
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
    """Return methods in words."""
    return ", ".join(f"`{name}`" for name in adapters)


class Choice(NamedTuple):
    """What to choose for one set. Methods that cannot be told apart stand together; none where none is dependable.

    `fastest`, `exact` and `cheapest`: dependable methods with the least time, error and effort, and the median of the
    first. `leading`: of the methods that were given all problems those that do not solve fewer than the best by more
    than chance.
    """

    set: str
    fastest: tuple[str, ...]
    fastest_ms: float
    exact: tuple[str, ...]
    exact_error: float
    cheapest: tuple[str, ...]
    cheapest_effort: float
    leading: tuple[str, ...]
    leading_share: float


class Standing(NamedTuple):
    """A method over all sets: those that it takes whole, those of which it solves 98 %, and where it solves least.

    `slowness`: its time over that of the method that others are compared with, on the problems that both solve;
    `false_claims`: answers called solved that are off by more than 1 mm; `efforts`: median and 90 % of the effort above
    the best known, as a share, of what it solves while goals stand still.
    """

    method: str
    taken: int
    dependable: int
    worst_set: str
    worst: Interval
    slowness: Interval
    false_claims: int
    deepest_mm: float
    efforts: tuple[float, float]


def choices(results: Results, rows: Sequence[Summary]) -> list[Choice]:
    """What to choose, set by set."""
    return [_choice(results, family, [row for row in rows if row.set == family]) for family in results.sets]


def _choice(results: Results, family: str, rows: Sequence[Summary]) -> Choice:
    good = [row.method for row in rows if row.dependable]
    given = max((row.cases for row in rows), default=0)  # others had easier or harder problems
    solved = {
        row.method: {one.number: one.success(COARSE) for one in results.default(family, row.method)}
        for row in rows
        if row.refused < row.cases == given
    }
    order = sorted(solved, key=lambda name: -sum(solved[name].values()))
    leading = tuple(name for name in order if paired_difference(solved[order[0]], solved[name]) > 1.0 - LEVEL)
    fast = best({name: times(results, [family], name) for name in good})
    errors = {name: errors_of(results, family, name) for name in good}
    exact = best(errors)
    efforts = {name: efforts_of(results, family, name) for name in good} if not results.moving(family) else {}
    cheap = best(efforts)
    return Choice(
        family,
        fast, next((row.median_ms.value for row in rows if fast and row.method == fast[0]), nan),
        exact, middle(list(errors[exact[0]].values())) if exact else nan,
        cheap, middle(list(efforts[cheap[0]].values())) if cheap else nan,
        leading, sum(solved[order[0]].values()) / given if order else 0.0,
    )  # fmt: skip


def reference(results: Results) -> str:
    """The method that others' times are compared with: our default, or the first where it did not take part."""
    return OURS if OURS in results.adapters else next(iter(results.adapters), "")


def standings(results: Results, rows: Sequence[Summary]) -> list[Standing]:
    """All methods, the most dependable first, and of equal ones the fastest."""
    base = times(results, results.sets, reference(results))
    found = []
    for adapter in results.adapters:
        mine = [row for row in rows if row.method == adapter]
        if not mine:
            continue
        judged = [row for row in mine if row.refused < row.cases]
        worst = min(judged, key=lambda row: row.success.value, default=None)
        still = (family for family in results.sets if not results.moving(family))
        above = [effort for family in still for effort in efforts_of(results, family, adapter).values()]
        found.append(
            Standing(
                adapter,
                sum(not row.refused for row in mine),
                sum(row.dependable for row in mine),
                worst.set if worst else "",
                worst.success if worst else NOTHING,
                ratio(times(results, results.sets, adapter), base) if base else NOTHING,
                sum(row.false_claims for row in mine),
                max((row.deepest_mm for row in judged if isfinite(row.deepest_mm)), default=nan),
                (middle(above), middle(above, 0.9)),
            )
        )
    return sorted(found, key=lambda one: (-one.dependable, one.slowness.value if one.slowness.cases else inf))


def advice(results: Results, rows: Sequence[Summary]) -> list[str]:
    """What a reader who reads nothing else should know: whom to take, who is not enough, and what nobody solves."""
    ranked, said = standings(results, rows), list[str]()
    most = max((one.dependable for one in ranked), default=0)
    if most:
        names = [one.method for one in ranked if one.dependable == most]
        alike = best({name: times(results, results.sets, name) for name in names})
        lowest = min(row.success.low for row in rows if row.method in alike and row.dependable)
        said.append(
            f"**If in doubt, take {named(alike)}:** at least {100 * GOOD:.0f} % of the problems given are solved in "
            f"{most} of {len(results.sets)} sets; the lowest interval of these shares begins at {100 * lowest:.0f} %."
            + (" The times of these cannot be told apart." if len(alike) > 1 else "")
        )
    else:
        said.append(f"**No method solves {100 * GOOD:.0f} % of any set.** Look at each set before choosing.")
    for choice in choices(results, rows):
        if choice.fastest:
            equal = " (not told apart)" if len(choice.fastest) > 1 else ""
            title, least = words(choice.set).capitalize(), f"{choice.fastest_ms:.3g} ms"
            said.append(f"**{title}:** fastest {named(choice.fastest)}{equal}, {least}.")
        else:
            apart = ", not told apart by more than chance" if len(choice.leading) > 1 else ""
            said.append(
                f"**{words(choice.set).capitalize()} is solved dependably by none;** most by "
                f"{named(choice.leading)}: {100 * choice.leading_share:.3g} %{apart}."
            )
    for standing in ranked:
        if standing.dependable == 0 and isfinite(standing.worst.value):
            said += _warning(standing, rows)
    return said


def _warning(standing: Standing, rows: Sequence[Summary]) -> list[str]:
    """That a method is not enough, if in no set so many problems that it might be dependable after all are solved."""
    mine = [row for row in rows if row.method == standing.method and row.refused < row.cases]
    if any(not row.refused and row.success.high >= GOOD for row in mine):
        return []
    best = max(mine, key=lambda row: row.success.value)
    deep = f", and ends up to {standing.deepest_mm:.0f} mm inside of things" if standing.deepest_mm > 1.0 else ""
    return [
        f"**`{standing.method}` alone is not enough:** of what it takes it solves at most "
        f"{spanned(best.success, '.0f', 100.0, ' %')} ({words(best.set)}){deep}."
    ]
