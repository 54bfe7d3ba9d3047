"""What `wholebody bench scaling` found: a chart with logarithmic axes, and a table with the exponents."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wholebody.bench import style
from wholebody.bench.machine import sentence
from wholebody.bench.scaling import ASSEMBLY, JOINTS, SERIES, SIMPLIFIED, THINGS, ScalingRow, exponent
from wholebody.bench.tables import markdown

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
    drawn, axes = style.figure(2, len(series), (4.3 * len(series), 7.4))
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
            _plain(axis)
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
    return style.save(drawn, path)


def report(rows: Sequence[ScalingRow], left_out: Sequence[str], facts: Mapping[str, str]) -> str:
    """Exponents, then the times at every size.

    Args:
        rows: measured.
        left_out: sentences on methods that were not asked at some size.
        facts: of the machine.
    """
    parts = [
        f"A chain 2 m long that reaches for a place among boxes. What does not grow: {JOINTS} joints with ten segments "
        f"of one box each, {THINGS} things around. Solves and judgements are the least of the repeats by the "
        "clock, the rest is the processor's time. An exponent e means time ~ size^e; it is the "
        "slope of a line through the logarithms over the sizes from a tenth of the largest on (at least three).",
        _exponents(rows),
        _times(rows),
    ]
    if left_out:
        parts.append("Not asked:\n\n" + "\n".join(f"- {line}" for line in left_out))
    return "\n\n".join([*parts, sentence(facts)])


def _exponents(rows: Sequence[ScalingRow]) -> str:
    columns = ("what grows", "method", "sizes fitted", "a solve", "an iteration", "a step", "the judgement",
               "stating the problem", "building the geometry")  # fmt: skip
    table = []
    for series, method in dict.fromkeys((row.series, row.method) for row in rows):
        mine = [row for row in rows if (row.series, row.method) == (series, method)]
        sizes = [row.size for row in mine]
        columns_of = [
            [row.solve_ms for row in mine],
            [row.solve_ms / max(row.iterations, 1) for row in mine],
            [row.step_ms for row in mine],
            [row.judge_ms for row in mine],
            [row.problem_ms for row in mine],
            [row.build_ms if method == "qp" else math.nan for row in mine],
        ]
        cells, begins = [], sizes[0]
        for values in columns_of:
            if any(math.isnan(value) for value in values) or len(values) < 2:
                cells.append("")
                continue
            slope, first = exponent(sizes, values)
            begins = int(first)
            cells.append(f"{slope:.2f}")
        table.append((NAMES[series], method, f"{begins} to {sizes[-1]}", *cells))
    return markdown(columns, table)


def _times(rows: Sequence[ScalingRow]) -> str:
    """A solve by every method, and the rest as it is for qp; one row for each size."""
    methods = [name for name in LOOKS if any(row.method == name for row in rows)]
    columns = ("what grows", "size", "pairs", *(f"{name} ms (iterations)" for name in methods), "a step of qp ms",
               "the judgement ms", "stating the problem ms", "simplifying ms", "building the geometry ms")  # fmt: skip
    table = []
    for series, size in dict.fromkeys((row.series, row.size) for row in rows):
        mine = {row.method: row for row in rows if (row.series, row.size) == (series, size)}
        cells = []
        for name in methods:
            row = mine.get(name)
            mark = "" if row is None or row.status == "solved" else f" {row.status}"
            cells.append("" if row is None else f"{_number(row.solve_ms)} ({row.iterations}){mark}")
        whole, part = mine.get("qp"), mine.get(SIMPLIFIED)
        rest = ("", "", "", "", "") if whole is None else (
            _number(whole.step_ms), _number(whole.judge_ms), _number(whole.problem_ms),
            "" if part is None else _number(part.problem_ms), _number(whole.build_ms),
        )  # fmt: skip
        table.append((NAMES[series], str(size), "" if whole is None else str(whole.pairs), *cells, *rest))
    return markdown(columns, table)


def _plain(axis: Any) -> None:
    """Sizes written out."""
    from matplotlib.ticker import LogLocator, NullLocator

    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_locator(NullLocator())


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}" if value < 10.0 else f"{value:.0f}"
