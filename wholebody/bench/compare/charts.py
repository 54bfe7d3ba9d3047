"""The charts of a comparison: curves of speed against accuracy, a point a budget; the share solved within a time."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.adapters.base import Budget
from wholebody.bench.compare.record import COARSE, FINE
from wholebody.bench.compare.results import Quantity, Results, middle
from wholebody.bench.plot_style import method_style

BAND = 30.0  # where points are drawn whose median is no answer: above all values, which are metres, radians, shares
GREY = "#666666"
MS = 1e3


def speed_accuracy(results: Results, family: str, title: str, path: Path) -> tuple[Path, Path]:
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
        for adapter in reversed(results.adapters):
            points = curve(results, family, adapter, quantity)
            if points:
                drawn[adapter] = _draw(panel, points, adapter, quantity)
        _dress(panel, quantity, "a frame" if results.moving(family) else "a solve")
    chart.suptitle(title, x=0.01, ha="left", fontsize=13)
    _legend(chart, results, drawn)
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
    panel.set_title("shaded: more than half of the answers are none", loc="right", fontsize=8, color=GREY)
    panel.set_title(quantity.title, loc="left", fontsize=10)
    panel.set(xlabel=f"time of {what} [ms]", ylabel=quantity.label)


def profiles(results: Results, family: str, title: str, path: Path) -> tuple[Path, Path]:
    """Share of the cases solved within a time at the default budget, to a millimetre and to a tenth of one."""
    chart, axes = plot_style.figure(1, 2, (11.0, 4.6))
    drawn: dict[str, Any] = {}
    known = [time for adapter in results.adapters for time in profile(results, family, adapter, COARSE)[0]]
    start, end = 0.7 * MS * min(known, default=1.0), 1.5 * MS * max(known, default=1.0)
    for panel, tolerance in zip(axes[0], (COARSE, FINE), strict=True):
        for adapter in reversed(results.adapters):
            times, cases = profile(results, family, adapter, tolerance)
            if not cases:
                continue
            seen = method_style(adapter)
            shares = [100.0 * (place + 1) / cases for place in range(len(times))]
            x = [MS * time for time in times]
            (drawn[adapter],) = panel.step(
                [start, *x, end], [0.0, *shares, shares[-1] if shares else 0.0], where="post",
                color=seen.color, linewidth=1.9 if seen.principal else 0.9, zorder=3 if seen.principal else 2,
            )  # fmt: skip
        panel.axhline(98.0, color=GREY, linewidth=0.9, linestyle="--", zorder=1)
        plot_style.plain_log(panel)
        panel.set(xlim=(start, end), ylim=(0.0, 103.0))
        panel.set_title(f"solved to {tolerance:g} m and rad", loc="left", fontsize=10)
        panel.set(
            xlabel=f"time of {'a frame' if results.moving(family) else 'a solve'} [ms]",
            ylabel="cases solved within the time [%]",
        )
    chart.suptitle(title, x=0.01, ha="left", fontsize=13)
    _legend(chart, results, drawn)
    return plot_style.save(chart, path)


def _legend(chart: Any, results: Results, drawn: dict[str, Any]) -> None:
    names = [adapter for adapter in results.adapters if adapter in drawn]
    if names:
        chart.legend(
            [drawn[name] for name in names], names, loc="outside lower center", ncols=min(len(names), 6),
            frameon=False, fontsize=9,
        )  # fmt: skip
    chart.draw_without_rendering()
    chart.set_layout_engine("none")  # laid out once, not for each of the files


def draw_all(results: Results, titles: Iterable[tuple[str, str]], folder: Path) -> dict[str, tuple[Path, Path]]:
    """All charts of a comparison, by name; `titles` are name and title of every set."""
    drawn = {}
    for family, title in titles:
        name = family.replace("_", "-")
        drawn[f"compare-{name}"] = speed_accuracy(results, family, title, folder / f"compare-{name}")
        drawn[f"compare-{name}-profile"] = profiles(results, family, title, folder / f"compare-{name}-profile")
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


def profile(results: Results, family: str, adapter: str, tolerance: float) -> tuple[list[float], int]:
    """Times of the cases that a method solved at its default budget, sorted, and how many it took."""
    mine = results.taken(family, adapter)
    return sorted(record.seconds for record in mine if record.success(tolerance)), len(mine)
