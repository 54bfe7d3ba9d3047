"""The parts of a report about one set, and about the front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.compare.advice import words
from wholebody.bench.compare.blocks import Block, Chart, Heading, Table, Text
from wholebody.bench.compare.front import MOST, OURS, Rival, fronts
from wholebody.bench.compare.results import Results
from wholebody.bench.compare.summary import Summary
from wholebody.bench.problem_sets.case import ProblemSet


def of_set(results: Results, rows: Sequence[Summary], family: ProblemSet) -> list[Block]:
    """Title, what is asked, both charts and the figures."""
    name = f"compare-{family.name.replace('_', '-')}"
    return [
        Heading(2, family.title[:1].upper() + family.title[1:]),
        Text(family.about),
        Chart(name, f"Speed against accuracy: {family.title}"),
        Chart(f"{name}-profile", f"Share of the problems solved within a time: {family.title}"),
        figures(results, rows, family.name),
    ]


def figures(results: Results, rows: Sequence[Summary], family: str) -> Table:
    """The figures of a set at the default budget."""
    moving = results.moving(family)
    taken = [row for row in rows if row.set == family]
    columns = ["method", "problems", "refused", "swept", "solved to 1e-3", "to 1e-4", "false “solved”",
               "median ms", "p95 ms", "CPU ms", "set-up ms", "iterations", "worst error, median",
               "deepest overlap mm"]  # fmt: skip
    columns += ["frame p95 ms", "tracking error mm", "jerk rad/s³", "gap turns /s"] if moving else ["effort above best"]
    return Table(columns, [_row(row, moving) for row in taken])


def _row(row: Summary, moving: bool) -> list[str]:
    if row.refused == row.cases:
        return [row.method, str(row.cases), "all", *[""] * (15 if moving else 12)]
    cells = [
        row.method, str(row.cases), str(row.refused), str(row.swept), _percent(row.success),
        _percent(row.success_fine), str(row.false_claims), _number(row.median_ms), _number(row.p95_ms),
        _number(row.cpu_median_ms), _number(row.setup_ms), f"{row.iterations:.3g}" if isfinite(row.iterations) else "",
        f"{row.worst_median:.0e}" if isfinite(row.worst_median) else "", _number(row.deepest_mm),
    ]  # fmt: skip
    if moving:
        return [*cells, _number(row.frame_p95_ms), _number(row.error_mm), f"{row.jerk:.2g}", f"{row.turns:.2g}"]
    return [*cells, f"{100 * row.effort:.2g} %" if isfinite(row.effort) else ""]


def front_part(results: Results, adapters: Sequence[Adapter]) -> list[Block]:
    """Whether our method is on the front of every chart, by wall time, the processor's, and nine problems in ten."""
    wall, processor, dependable = fronts(results), fronts(results.by_processor()), fronts(results, share=MOST)
    if not wall:
        return [Text(f"`{OURS}` did not take part, so nothing is said about its front.")]
    off = [rival for rival in wall if not rival.on_front]
    verdict = (
        f"`{OURS}` is on the front of all {len(wall)} charts."
        if not off
        else f"`{OURS}` is on the front of {len(wall) - len(off)} of {len(wall)} charts."
    )
    columns = ("problems", "chart", "on the front", "nearest or faster", "at accuracy", f"{OURS} ms", "other ms",
               "ratio", "ratio by CPU time", "ratio for nine in ten", "problems compared")  # fmt: skip
    still = sum(rival.on_front for rival in dependable)
    by_cpu, by_most = ({(rival.set, rival.quantity): rival for rival in rivals} for rivals in (processor, dependable))
    ahead = sorted({rival.method for rival in off})
    known = {adapter.name: adapter.differences for adapter in adapters}
    return [
        Text(
            "A method is on the front where no other is faster at any accuracy from 1e-3 down to 1e-8. The time to an "
            "accuracy is the least over the budgets of the median over the problems, a failure counting as infinitely "
            "long; budgets of first fit count with the others. Methods are compared on the problems that both were "
            f"given at all budgets. {verdict} By the time in which nine problems in ten are solved, instead of half "
            f"of them, it is on the front of {still}. A ratio above 1 says how many times longer it takes than the "
            "fastest other, at the accuracy where that is worst."
        ),
        *(
            [Text(f"What is farthest ahead of it in a chart: {'; '.join(_known(name, known) for name in ahead)}.")]
            if off
            else []
        ),
        Table(
            columns,
            [_rival(rival, *(other.get((rival.set, rival.quantity)) for other in (by_cpu, by_most))) for rival in wall],
        ),
    ]


def _known(name: str, differences: Mapping[str, Sequence[str]]) -> str:
    """A method, and what it does not do, if anything."""
    told = differences.get(name, ())
    return f"`{name}` ({told[0]})" if told else f"`{name}`"


def _rival(rival: Rival, processor: Rival | None, dependable: Rival | None) -> list[str]:
    if not rival.method:
        there = "no other gets there" if rival.on_front else "none gets there"
        shown = "yes" if rival.on_front else "no"
        return [words(rival.set), rival.quantity, shown, there, *[""] * 5, _told(dependable), str(rival.cases)]
    return [
        words(rival.set), rival.quantity, "yes" if rival.on_front else "no", rival.method, f"{rival.accuracy:.0e}",
        _number(1e3 * rival.ours) or "never", _number(1e3 * rival.other), _ratio(rival.ratio),
        _told(processor), _told(dependable), str(rival.cases),
    ]  # fmt: skip


def _told(rival: Rival | None) -> str:
    if rival is None or not rival.method:
        return "" if rival is None else "no other" if rival.on_front else "none"
    return f"{_ratio(rival.ratio)} ({rival.method})"


def _ratio(value: float) -> str:
    return "∞" if value == inf else f"{value:.2g}"


def _number(value: float) -> str:
    return f"{value:.3g}" if isfinite(value) else ""


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if isfinite(share) else ""
