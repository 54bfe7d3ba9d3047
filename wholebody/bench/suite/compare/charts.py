"""The charts of a comparison: all sets at a glance, and speed against accuracy, a point a budget.

A chart has at most six methods; a method has the same colour in all of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.plot_style import method_style
from wholebody.bench.suite.adapters.base import Budget
from wholebody.bench.suite.compare.paired import OURS
from wholebody.bench.suite.compare.record import COARSE
from wholebody.bench.suite.compare.results import Quantity, Results, middle
from wholebody.bench.suite.compare.summary import Summary

BAND = 30.0  # where points are drawn whose median is no answer: above all values, which are metres, radians, shares
MOST = 6  # methods in a chart


class Point(NamedTuple):
    """One method at one budget.

    Attributes:
        level: the budget.
        cases: how many it stands for.
        seconds, seconds_p95: median, and 95 %, of the call [s].
        value: median; infinite where more than half of the answers are none.
        low, high: quartiles.
    """

    level: Budget
    cases: int
    seconds: float
    seconds_p95: float
    value: float
    low: float
    high: float


def curve(results: Results, family: str, adapter: str, quantity: Quantity) -> list[Point]:
    """Points of a method in a set, from the fastest budget to the slowest."""
    cases = results.swept(family, adapter)
    points = []
    for level in results.levels(family, adapter):
        seconds, values = results.values(family, adapter, level, quantity, cases)
        spent = seconds[np.isfinite(seconds)]
        if len(spent):
            quartiles = [middle(values, share) for share in (0.5, 0.25, 0.75)]
            points.append(Point(level, len(cases), middle(spent), middle(spent, 0.95), *quartiles))
    return points


def lowest(points: list[Point]) -> list[Point]:
    """Points than which no other of the same method is both faster and more accurate, from the fastest on."""
    kept: list[Point] = []
    for point in points:
        if not kept or point.value < kept[-1].value:
            kept.append(point)
    return kept


def speed_accuracy(results: Results, family: str, title: str, adapters: Sequence[str], path: Path) -> tuple[Path, Path]:
    """One panel a quantity: median error over median time at every budget, quartiles and 95 % of the time as bars.

    The line of a method joins its best budgets; those that are slower and no more accurate stand beside it, small.
    """
    quantities = results.quantities(family)
    chart, axes = plot_style.figure(1, 2, (11.0, 4.6))
    drawn: dict[str, Any] = {}
    for panel in axes[0][len(quantities) :]:
        panel.set_visible(False)
    for panel, quantity in zip(axes[0], quantities, strict=False):
        for adapter in reversed(adapters):
            points = curve(results, family, adapter, quantity)
            if points:
                drawn[adapter] = _draw(panel, points, adapter)
        _dress(panel, quantity, "a frame" if results.moving(family) else "a solve")
    chart.suptitle(title, x=0.01, ha="left", fontsize=13)
    plot_style.legend_below(chart, {name: drawn[name] for name in adapters if name in drawn})
    return plot_style.save(chart, path)


def _draw(panel: Any, points: list[Point], adapter: str) -> Any:
    seen = method_style(adapter)
    order, width, size = (3, 1.8, 6.0) if seen.principal else (2, 0.9, 4.0)
    style = {"color": seen.color, "marker": seen.marker, "zorder": order}
    best = lowest(points)
    (line,) = panel.plot(*_places(best), linewidth=width, markersize=size, **style)
    panel.plot(*_places(points), linestyle="", markersize=0.6 * size, alpha=0.5, **style)
    failing = [point for point in points if point.value == inf]
    panel.plot(*_places(failing), linestyle="", markersize=size, markerfacecolor="white", **style)
    bar = {"color": seen.color, "linewidth": 0.9, "alpha": 0.4, "zorder": 1}
    for point in points if seen.principal else ():
        if point.value < inf:
            at = 1e3 * point.seconds
            panel.plot([at, at], [point.low, min(point.high, BAND)], **bar)
            panel.plot([at, 1e3 * point.seconds_p95], [point.value, point.value], **bar)
    return line


def _places(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [1e3 * point.seconds for point in points], [min(point.value, BAND) for point in points]


def _dress(panel: Any, quantity: Quantity, what: str) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    plot_style.plain_log(panel)
    panel.set_yscale("log")
    panel.yaxis.set_minor_locator(NullLocator())  # ten decades have a hundred, and each is laid out
    panel.yaxis.set_major_locator(LogLocator(numticks=12))
    panel.set_ylim(0.5 * quantity.floor, 2.0 * BAND)
    panel.axhspan(0.35 * BAND, 2.0 * BAND, color="#f4dddd", zorder=0)
    panel.axhline(COARSE, color=plot_style.GREY, linewidth=0.9, linestyle="--", zorder=1)
    panel.set_title("shaded: no answer to more than half", loc="right", fontsize=8, color=plot_style.GREY)
    panel.set_title(quantity.title, loc="left", fontsize=10)
    panel.set(xlabel=f"time of {what} [ms]", ylabel=quantity.label)


def overview(
    rows: Sequence[Summary], titles: Mapping[str, str], adapters: Sequence[str], path: Path
) -> tuple[Path, Path]:
    """One row a set: share solved and mean time of each method, with their intervals of 95 %."""
    shown = {
        title: {
            row.method: (row.success.scaled(100.0), row.mean_ms)
            for row in rows
            if row.set == family and row.method in adapters and row.refused < row.cases
        }
        for family, title in titles.items()
    }
    note = "failures as the longest"
    heading = "Every set: solved, and how fast; bands are intervals of 95 %"
    return plot_style.shares_and_times(shown, {name: method_style(name) for name in adapters}, note, heading, path)


def chart_name(family: str, number: int = 0) -> str:
    """Name of the chart of a set for a group of methods; the first group has no number."""
    return f"compare-{family.replace('_', '-')}{f'-{number + 1}' if number else ''}"


def groups(adapters: Sequence[str]) -> list[tuple[str, ...]]:
    """Methods as they stand together in charts: at most `MOST`, first one of each algorithm, then the others.

    Our default stands in every group, to compare with.
    """
    kinds: dict[str, str] = {}
    for name in adapters:
        kinds.setdefault(re.split(r"[/,+ ]", name)[0], name)
    order = [*kinds.values(), *(name for name in adapters if name not in kinds.values())]
    if len(order) <= MOST:
        return [tuple(order)] if order else []
    base = [OURS] if OURS in order else []
    others = [name for name in order if name not in base]
    size = MOST - len(base)
    return [tuple(base + others[first : first + size]) for first in range(0, len(others), size)]


def draw_all(
    results: Results, rows: Sequence[Summary], titles: Mapping[str, str], folder: Path
) -> dict[str, tuple[Path, Path]]:
    """All charts of a comparison, by name; `titles` are those of the sets by their names."""
    drawn = {}
    for number, adapters in enumerate(groups(results.adapters)):
        name = chart_name("overview", number)
        drawn[name] = overview(rows, titles, adapters, folder / name)
        for family, title in titles.items():
            name = chart_name(family, number)
            drawn[name] = speed_accuracy(results, family, title, adapters, folder / name)
    return drawn
