"""The report of hard cases: the matrix of cases and methods, what each case asks, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wholebody.bench import plot_style
from wholebody.bench.report import render
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.verdict import WORDS, Result

METHODS = ("qp", "qp/osqp", "newton/slack", "newton/barrier", "ccd", "dls", "placo", "pink", "mink")
"""One or two of each algorithm, for a chart that can be read; others are asked by name."""

COLORS = {
    "✓": ("#8fd0b5", "solved"),
    "●": ("#f6ec9c", "honest, as good as can be"),
    "○": ("#fbf7d9", "honest, a better answer exists"),
    "–": ("#d9d9d9", "clear refusal"),
    "✗": ("#e8794a", "WRONG"),
}
"""Told apart by people with any colour vision, and by their signs in print."""


def report(result: Result, adapters: Sequence[Adapter], facts: Mapping[str, str]) -> str:
    """The counts, the cases by methods, every case in words, and every wrong answer."""
    return render("stability.md", result=result, kinds=WORDS, adapters=adapters, facts=facts)


def matrix(result: Result, path: Path) -> tuple[Path, Path]:
    """Draw all verdicts; return the paths of the SVG and the PNG."""
    width = max(8.0, 3.1 + 0.6 * len(result.methods))
    chart, axes = plot_style.figure(1, 1, (width, 1.5 + 0.22 * len(result.cases)))
    axis = axes[0][0]
    for row, case in enumerate(result.cases):
        for column, method in enumerate(result.methods):
            _cell(axis, row, column, result.verdicts[case.name, method].symbol)
    axis.set(xlim=(-0.5, len(result.methods) - 0.5), ylim=(len(result.cases) - 0.5, -0.5))
    axis.set_xticks(range(len(result.methods)), [name.replace("/", "\n") for name in result.methods], fontsize=8.5)
    axis.xaxis.tick_top()
    axis.set_yticks(range(len(result.cases)), [case.title for case in result.cases], fontsize=8.5)
    axis.tick_params(length=0)
    axis.grid(visible=False)
    for side in axis.spines.values():
        side.set_visible(False)
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=color, label=f"{symbol}  {words}") for symbol, (color, words) in COLORS.items()]
    chart.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8.5)
    return plot_style.save(chart, path)


def _cell(axis: Any, row: int, column: int, symbol: str) -> None:
    from matplotlib.patches import Rectangle

    axis.add_patch(Rectangle((column - 0.48, row - 0.45), 0.96, 0.9, facecolor=COLORS[symbol][0], edgecolor="none"))
    weight = "bold" if symbol == "✗" else "normal"
    axis.text(column, row, symbol, fontsize=8, ha="center", va="center", color="#111111", fontweight=weight)
