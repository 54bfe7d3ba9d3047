"""The page "Where methods fail" and its matrix of cases and methods: what is asked, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wholebody.bench import plot_style
from wholebody.bench.report import render
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.case import Kind
from wholebody.bench.suite.stability.pictures import Drawn
from wholebody.bench.suite.stability.verdict import SYMBOLS, WORDS, Result, Verdict

CHART = "stability.svg"
METHODS = ("qp", "qp/osqp", "newton/slack", "newton/barrier", "ccd", "dls", "placo", "pink", "mink")
"""One or two of each algorithm, for a chart that can be read; others are asked by name."""


def report(result: Result, facts: Mapping[str, str]) -> str:
    """The result in short: the counts, the cases by methods, and every wrong cell."""
    return render("stability.md", page=False, result=result, kinds=WORDS, facts=facts)


def page(result: Result, adapters: Sequence[Adapter], facts: Mapping[str, str], drawn: Drawn, folder: str) -> str:
    """The section of the page that is written by the command; `folder` has the pictures, seen from the page."""
    return render(
        "stability.md", page=True, result=result, kinds=WORDS, facts=facts, adapters=adapters, drawn=drawn,
        folder=folder, chart=CHART,
    )  # fmt: skip


COLORS: dict[Kind, str] = {
    "solved": "#8fd0b5", "honest": "#f6ec9c", "refusal": "#d9d9d9", "adapter": "#b9c7e8", "wrong": "#e8794a",
}  # fmt: skip
"""Told apart by people with any colour vision, and by their signs in print."""

PALE = "#fbf7d9"  # an honest answer where a better one was possible
CELL = (0.92, 0.27)  # inches
LEAST = 8.0  # inches, that the legend needs
MARGIN = (3.1, 1.5)  # inches, for the names and the legend


def matrix(result: Result, path: Path) -> tuple[Path, Path]:
    """Draw all verdicts; return the paths of the SVG and the PNG."""
    lines = _lines(result)
    width = max(LEAST, MARGIN[0] + CELL[0] * len(result.methods))
    chart, axes = plot_style.figure(1, 1, (width, MARGIN[1] + CELL[1] * len(lines)))
    axis = axes[0][0]
    for row, (case, title) in enumerate(lines):
        if case is None:
            axis.text(-0.5, row + 0.15, title, fontsize=9, fontweight="bold", va="center", ha="left", color="#333333")
            continue
        for column, method in enumerate(result.methods):
            _cell(axis, row, column, result.verdicts[case, method])
    axis.set(xlim=(-0.5, len(result.methods) - 0.5), ylim=(len(lines) - 0.5, -0.5))
    axis.set_xticks(range(len(result.methods)), [name.replace("/", "\n") for name in result.methods], fontsize=8.5)
    axis.xaxis.tick_top()
    rows = [number for number, (case, _) in enumerate(lines) if case is not None]
    axis.set_yticks(rows, [title for case, title in lines if case is not None], fontsize=8.5)
    axis.tick_params(length=0)
    axis.grid(visible=False)
    for side in axis.spines.values():
        side.set_visible(False)
    _legend(chart)
    return plot_style.save(chart, path)


def _lines(result: Result) -> list[tuple[str | None, str]]:
    """Case's name and title by line; None and the group's name where a group begins."""
    lines: list[tuple[str | None, str]] = []
    group = ""
    for case in result.cases:
        if case.group != group:
            group = case.group
            lines.append((None, group))
        lines.append((case.name, case.title))
    return lines


def _cell(axis: Any, row: int, column: int, verdict: Verdict) -> None:
    from matplotlib.patches import Rectangle

    color = PALE if verdict.kind == "honest" and not verdict.acceptable else COLORS[verdict.kind]
    axis.add_patch(Rectangle((column - 0.48, row - 0.45), 0.96, 0.9, facecolor=color, edgecolor="none"))
    brief = "" if verdict.brief == "best known" else verdict.brief
    weight = "bold" if verdict.kind == "wrong" else "normal"
    text = f"{verdict.symbol} {brief}".strip()
    axis.text(column, row, text, fontsize=7.5, ha="center", va="center", color="#111111", fontweight=weight)


def _legend(chart: Any) -> None:
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=COLORS[kind], label=f"{SYMBOLS[kind]}  {WORDS[kind]}") for kind in ("solved", "refusal")]
    handles[1:1] = [
        Patch(facecolor=COLORS["honest"], label="●  honest, as good as can be"),
        Patch(facecolor=PALE, edgecolor="#bbbbbb", label="○  honest, a better answer exists"),
    ]
    handles += [Patch(facecolor=COLORS[kind], label=f"{SYMBOLS[kind]}  {WORDS[kind]}") for kind in ("adapter", "wrong")]
    chart.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8.5)
