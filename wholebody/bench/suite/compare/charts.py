"""The charts of a comparison, at most six methods each, a method in the same colour everywhere.

One row a set for all of them; performance profiles; curves of speed against accuracy, a point a budget.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.plot_style import method_style
from wholebody.bench.statistics import wilson
from wholebody.bench.suite.adapters.base import Budget
from wholebody.bench.suite.compare.front import OURS
from wholebody.bench.suite.compare.record import COARSE, FINE
from wholebody.bench.suite.compare.results import Quantity, Results, middle
from wholebody.bench.suite.compare.summary import Summary

BAND = 30.0  # where points are drawn whose median is no answer: above all values, which are metres, radians, shares
GREY = "#666666"
MS = 1e3


def speed_accuracy(results: Results, family: str, title: str, adapters: Sequence[str], path: Path) -> tuple[Path, Path]:
    """One panel a quantity: median error over median time at every budget, quartiles and 95 % of the time as bars.

    The line of a method joins its best budgets; those that are slower and no more accurate stand beside it, small.
    """
    quantities = results.quantities(family)
    columns = 2
    rows = -(-len(quantities) // columns)
    chart, axes = plot_style.figure(rows, columns, (11.0, 3.9 * rows + 0.7))
    panels = [axes[place // columns][place % columns] for place in range(rows * columns)]
    for panel in panels[len(quantities) :]:
        panel.set_visible(False)
    drawn: dict[str, Any] = {}
    for panel, quantity in zip(panels, quantities, strict=False):
        for adapter in reversed(adapters):
            points = curve(results, family, adapter, quantity)
            if points:
                drawn[adapter] = _draw(panel, points, adapter, quantity)
        _dress(panel, quantity, "a frame" if results.moving(family) else "a solve")
    chart.suptitle(title, x=0.01, ha="left", fontsize=13)
    plot_style.legend_below(chart, {name: drawn[name] for name in adapters if name in drawn})
    return plot_style.save(chart, path)


def _draw(panel: Any, points: list[Point], adapter: str, quantity: Quantity) -> Any:
    seen = method_style(adapter)
    order = 3 if seen.principal else 2
    width, size = (1.8, 6.0) if seen.principal else (0.9, 4.0)
    x = [MS * point.seconds for point in points]
    y = [min(point.value, BAND) for point in points]
    best = lowest(points)
    (line,) = panel.plot(
        [MS * point.seconds for point in best], [min(point.value, BAND) for point in best], color=seen.color,
        marker=seen.marker, linewidth=width, markersize=size, zorder=order,
    )  # fmt: skip
    panel.plot(x, y, color=seen.color, marker=seen.marker, linestyle="", markersize=0.6 * size, alpha=0.5, zorder=order)
    failing = [place for place, point in enumerate(points) if point.value == inf]
    panel.plot(
        [x[k] for k in failing], [BAND] * len(failing), linestyle="", marker=seen.marker, markersize=size,
        color=seen.color, markerfacecolor="white", zorder=order + 1,
    )  # fmt: skip
    if seen.principal:
        for point in points:
            if point.value < inf:
                at, high = MS * point.seconds, min(point.high, BAND)
                bar = {"color": seen.color, "linewidth": 0.9, "alpha": 0.4, "zorder": 1}
                panel.plot([at, at], [point.low, high], **bar)
                panel.plot([at, MS * point.seconds_p95], [point.value, point.value], **bar)
    return line


def lowest(points: list[Point]) -> list[Point]:
    """Points than which no other of the same method is both faster and more accurate, from the fastest on."""
    kept: list[Point] = []
    for point in points:
        if not kept or point.value < kept[-1].value:
            kept.append(point)
    return kept


def _dress(panel: Any, quantity: Quantity, what: str) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    plot_style.plain_log(panel)
    panel.set_yscale("log")
    panel.yaxis.set_minor_locator(NullLocator())  # ten decades have a hundred, and each is laid out
    panel.yaxis.set_major_locator(LogLocator(numticks=12))
    panel.set_ylim(0.5 * quantity.floor, 2.0 * BAND)
    panel.axhspan(0.35 * BAND, 2.0 * BAND, color="#f4dddd", zorder=0)
    panel.axhline(COARSE, color=GREY, linewidth=0.9, linestyle="--", zorder=1)
    panel.set_title("shaded: no answer to more than half of the problems", loc="right", fontsize=8, color=GREY)
    panel.set_title(quantity.title, loc="left", fontsize=10)
    panel.set(xlabel=f"time of {what} [ms]", ylabel=quantity.label)


def profiles(results: Results, family: str, title: str, adapters: Sequence[str], path: Path) -> tuple[Path, Path]:
    """Performance profiles at the default budget: share of the cases solved within a factor of the fastest method.

    Dolan and More 2002, "Benchmarking optimization software with performance profiles". At the factor 1 stands how
    often a method is the fastest, at the right end how often it solves at all. Bands are Wilson's intervals of 95 %.
    """
    chart, axes = plot_style.figure(1, 2, (11.0, 4.6))
    drawn: dict[str, Any] = {}
    for panel, tolerance in zip(axes[0], (COARSE, FINE), strict=True):
        found = performance(results, family, adapters, tolerance)
        ends = [factor for factors, _ in found.values() for factor in factors]
        end = 1.5 * max(ends, default=10.0)
        for adapter in reversed([name for name in adapters if name in found]):
            factors, cases = found[adapter]
            seen = method_style(adapter)
            x = [1.0, *factors, end]
            counts = [*range(len(factors) + 1), len(factors)]
            shares = [100.0 * count / cases for count in counts]
            bands = np.array([wilson(count, cases) for count in counts]) * 100.0
            (drawn[adapter],) = panel.step(x, shares, where="post", color=seen.color, linewidth=1.6, zorder=3)
            some = [count > 0 for count in counts]  # before its first success the bands of all methods are one
            panel.fill_between(
                x, *bands.T, where=some, step="post", color=seen.color, alpha=0.12, linewidth=0.0, zorder=2
            )
        panel.axhline(98.0, color=GREY, linewidth=0.9, linestyle="--", zorder=1)
        plot_style.plain_log(panel)
        panel.set(xlim=(1.0, end), ylim=(0.0, 103.0))
        panel.set_title(f"solved to {tolerance:g} m and rad", loc="left", fontsize=10)
        count = max((cases for _, cases in found.values()), default=0)
        panel.set_title(f"{count} problems, which all methods took", loc="right", fontsize=8, color=GREY)
        panel.set(xlabel="time over that of the fastest method", ylabel="cases solved within that factor [%]")
    chart.suptitle(title, x=0.01, ha="left", fontsize=13)
    plot_style.legend_below(chart, {name: drawn[name] for name in adapters if name in drawn})
    return plot_style.save(chart, path)


def performance(
    results: Results, family: str, adapters: Sequence[str], tolerance: float
) -> dict[str, tuple[list[float], int]]:
    """Factors over the fastest of the cases that a method solved, sorted, and how many cases there are.

    The cases are those that every method which took any of the set was given and took; on others somebody is missing.
    """
    taken = {
        adapter: {record.number: record for record in results.taken(family, adapter)}
        for adapter in adapters
        if results.taken(family, adapter)
    }
    common = set.intersection(*(set(mine) for mine in taken.values())) if taken else set()
    fastest = {
        number: min((mine[number].seconds for mine in taken.values() if mine[number].success(tolerance)), default=inf)
        for number in common
    }
    return {
        adapter: (
            sorted(
                mine[number].seconds / max(fastest[number], 1e-9)
                for number in common
                if mine[number].success(tolerance)
            ),
            len(common),
        )
        for adapter, mine in taken.items()
        if common
    }


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


def chart_name(family: str, kind: str = "", number: int = 0) -> str:
    """Name of the chart of a set for a group of methods; the first group has no number."""
    return f"compare-{family.replace('_', '-')}{kind}{f'-{number + 1}' if number else ''}"


MOST = 6  # methods in a chart


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
    results: Results, rows: Sequence[Summary], titles: Iterable[tuple[str, str]], folder: Path
) -> dict[str, tuple[Path, Path]]:
    """All charts of a comparison, by name; `titles` are name and title of every set.

    The charts of the second and further groups of methods are called as those of the first, with a number behind.
    """
    drawn = {}
    known = dict(titles)
    for number, adapters in enumerate(groups(results.adapters)):
        name = chart_name("overview", number=number)
        drawn[name] = overview(rows, known, adapters, folder / name)
        for family, title in known.items():
            profile_name, scatter_name = chart_name(family, "-profile", number), chart_name(family, number=number)
            drawn[profile_name] = profiles(results, family, title, adapters, folder / profile_name)
            drawn[scatter_name] = speed_accuracy(results, family, title, adapters, folder / scatter_name)
    return drawn


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
        if not len(spent):
            continue
        quartiles = [middle(values, share) for share in (0.5, 0.25, 0.75)]
        points.append(Point(level, len(cases), middle(spent), middle(spent, 0.95), *quartiles))
    return points
