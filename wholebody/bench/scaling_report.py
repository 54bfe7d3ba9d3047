"""What `wholebody bench scaling` found: a chart with logarithmic axes, and a table with the exponents."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wholebody.bench import plot_style
from wholebody.bench.report import render
from wholebody.bench.scaling import ASSEMBLY, JOINTS, SERIES, SIMPLIFIED, THINGS, ScalingRow, exponent

NAMES = {"joints": "joints", "pieces": "pieces of each segment", "things": "things around"}
LOOKS = {
    "qp": ("#0072b2", "o", "-"),
    SIMPLIFIED: ("#0072b2", "o", "--"),
    "newton": ("#e69f00", "^", "-"),
    ASSEMBLY: ("#e69f00", "^", "--"),
    "ccd": ("#000000", "X", "-"),
    "placo": ("#d55e00", "P", "-"),
}
"""Colour, marker and line of each method: the colours of the other charts."""


def chart(rows: Sequence[ScalingRow], path: Path) -> tuple[Path, Path]:
    """Above a solve, below a step, a judgement and the building of the geometry; a column for what grows."""
    series = [name for name in SERIES if any(row.series == name for row in rows)]
    drawn, axes = plot_style.figure(2, len(series), (4.3 * len(series), 7.4))
    for column, name in enumerate(series):
        mine = [row for row in rows if row.series == name]
        above, below = axes[0][column], axes[1][column]
        for method in LOOKS:
            color, marker, line = LOOKS[method]
            shown = [row for row in mine if row.method == method]
            if shown:
                above.plot(
                    [row.size for row in shown], [row.solve_ms for row in shown], line, color=color, marker=marker,
                    markersize=5, linewidth=1.5, label=method, fillstyle="none" if line == "--" else "full",
                )  # fmt: skip
            stepped = [row for row in shown if not math.isnan(row.step_ms)]
            if stepped:
                below.plot(
                    [row.size for row in stepped], [row.step_ms for row in stepped], line, color=color, marker=marker,
                    markersize=5, linewidth=1.5, label=f"a step, {method}",
                    fillstyle="none" if line == "--" else "full",
                )  # fmt: skip
        whole = [row for row in mine if row.method == "qp"]
        for label, color, values in (
            ("the judgement", "#009e73", [row.judge_ms for row in whole]),
            ("building the geometry", "#888888", [row.build_ms for row in whole]),
        ):
            below.plot([row.size for row in whole], values, ":", color=color, marker=".", linewidth=1.5, label=label)
        for axis in (above, below):
            axis.set_xscale("log")
            axis.set_yscale("log")
            plot_style.plain_log(axis)
        above.set_title(f"more {NAMES[name]}", loc="left")
        below.set_xlabel(NAMES[name])
        if column == 0:
            above.set_ylabel("a solve, without its judgement [ms]")
            below.set_ylabel("time [ms]")
    for row in (0, 1):
        handles: dict[str, object] = {}
        for axis in axes[row]:
            handles.update(dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True)))
        axes[row][0].legend(handles.values(), handles.keys(), frameon=False, fontsize=8, loc="upper left")
        low = min(axis.get_ylim()[0] for axis in axes[row])
        high = max(axis.get_ylim()[1] for axis in axes[row])
        for axis in axes[row]:
            axis.set_ylim(low, high * (6.0 if axis is axes[row][0] and len(axes[row]) == 1 else 3.0))
    return plot_style.save(drawn, path)


def report(rows: Sequence[ScalingRow], left_out: Sequence[str], facts: Mapping[str, str]) -> str:
    """Exponents, then the times at every size.

    Args:
        rows: measured.
        left_out: sentences on methods that were not asked at some size.
        facts: of the machine.
    """
    methods = [name for name in LOOKS if any(row.method == name for row in rows)]
    keys = dict.fromkeys((row.series, row.size) for row in rows)
    sizes = [{"series": series, "size": size, "rows": _by_method(rows, methods, series, size)} for series, size in keys]
    return render(
        "scaling.md", exponents=_exponents(rows), sizes=sizes, methods=methods, simplified=SIMPLIFIED, names=NAMES,
        joints=JOINTS, things=THINGS, left_out=left_out, facts=facts,
    )  # fmt: skip


def _by_method(rows: Sequence[ScalingRow], methods: Sequence[str], series: str, size: int) -> dict[str, Any]:
    """The rows of one size; None for a method that was not asked."""
    found = {row.method: row for row in rows if (row.series, row.size) == (series, size)}
    return {name: found.get(name) for name in (*methods, "qp", SIMPLIFIED)}


def _exponents(rows: Sequence[ScalingRow]) -> list[dict[str, Any]]:
    """For each series and method: the sizes that were fitted, and the exponents; NaN where a time is not known."""
    table = []
    for series, method in dict.fromkeys((row.series, row.method) for row in rows):
        mine = [row for row in rows if (row.series, row.method) == (series, method)]
        sizes = [row.size for row in mine]
        times = [
            [row.solve_ms for row in mine],
            [row.solve_ms / max(row.iterations, 1) for row in mine],
            [row.step_ms for row in mine],
            [row.judge_ms for row in mine],
            [row.problem_ms for row in mine],
            [row.build_ms if method == "qp" else math.nan for row in mine],
        ]
        slopes, begins = [], sizes[0]
        for values in times:
            known = len(values) > 1 and not any(math.isnan(value) for value in values)
            slope, first = exponent(sizes, values) if known else (math.nan, begins)
            begins = int(first)
            slopes.append(slope)
        table.append({"series": series, "method": method, "begins": begins, "ends": sizes[-1], "slopes": slopes})
    return table
