"""What `wholebody bench detail` found: a chart of time against error, and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.detail import ARM_THINGS, FINEST, INSIDE, LEVELS, DetailRow
from wholebody.bench.report import render
from wholebody.simplification.simplify import GROWTH

COLORS = {"spheres": "#d55e00", "capsules": "#0072b2", "hulls": "#009e73", "own": "#444444"}
MARKERS = dict(zip(LEVELS, ("o", "^", "s", "*"), strict=True))
TITLES = {
    "clutter": "a fingertip among 20 things",
    "whole body": "low and far reaches in balance",
    "arm": f"an arm among {ARM_THINGS} things",
}


class Summary(NamedTuple):
    """One model over all cases of a task; times are medians, the rest is named."""

    task: str
    detail: str
    level: str
    freedoms: int
    pairs: int
    cases: int
    solved: int
    solve_ms: float
    judge_ms: float
    prepare_ms: float
    inside: int
    worst_penetration_mm: float
    worst_lack_mm: float
    worst_goal_error_mm: float
    above: float
    worst_above: float


def summaries(rows: Sequence[DetailRow]) -> list[Summary]:
    """One for each task, detail and level; errors are those of answers that their own model calls solved."""
    found = []
    for task, detail, level in dict.fromkeys((row.task, row.detail, row.level) for row in rows):
        mine = [row for row in rows if (row.task, row.detail, row.level) == (task, detail, level)]
        solved = [row for row in mine if row.status == "solved"]
        above = [row.above for row in solved if np.isfinite(row.above)]
        found.append(
            Summary(
                task, detail, level, int(np.median([row.freedoms for row in mine])),
                int(np.median([row.pairs for row in mine])), len(mine), len(solved),
                float(np.median([row.solve_ms for row in mine])), float(np.median([row.judge_ms for row in mine])),
                float(np.median([row.prepare_ms for row in mine])),
                sum(row.penetration_mm > 1e3 * INSIDE for row in solved),
                max((row.penetration_mm for row in solved), default=0.0),
                max((row.lack_mm for row in solved), default=0.0),
                max((row.goal_error_mm for row in solved), default=0.0),
                float(np.median(above)) if above else float("nan"),
                max(above, default=float("nan")),
            )
        )  # fmt: skip
    return found


def chart(rows: Sequence[DetailRow], path: Path) -> tuple[Path, Path]:
    """Time of a solve with its judgement against the deepest overlap, and against the effort above the finest."""
    found = summaries(rows)
    tasks = list(dict.fromkeys(one.task for one in found))
    drawn, axes = plot_style.figure(2, len(tasks), (4.3 * len(tasks), 7.2))
    for column, task in enumerate(tasks):
        above, below = axes[0][column], axes[1][column]
        for one in (one for one in found if one.task == task):
            look = {
                "color": COLORS[one.detail], "marker": MARKERS[one.level], "linestyle": "none", "alpha": 0.85,
                "markersize": 12 if one.level == "simplified" else 8,
            }  # fmt: skip
            time = one.solve_ms + one.judge_ms
            above.plot([time], [one.worst_penetration_mm], **look)
            below.plot([time], [100.0 * one.worst_above], **look)
        above.axhspan(1e3 * INSIDE, 1e3, color="#f4dddd", zorder=0)
        above.set_yscale("symlog", linthresh=1e-2)
        above.set_ylim(-2e-3, 1e2)
        below.set_yscale("symlog", linthresh=1.0)
        worst = [100.0 * one.worst_above for one in found if one.task == task and np.isfinite(one.worst_above)]
        below.set_ylim(min(-1.0, 2.0 * min(worst, default=0.0)), max(2.0, 2.0 * max(worst, default=0.0)))
        times = [one.solve_ms + one.judge_ms for one in found if one.task == task]
        for axis in (above, below):
            axis.set_xscale("log")
            axis.set_xlim(0.7 * min(times), 1.4 * max(times))
            plot_style.plain_log(axis)
        below.axhline(0.0, color="#666666", linewidth=0.8)
        above.set_title(TITLES[task], loc="left")
        below.set_xlabel("a solve with its judgement, median [ms]")
    axes[0][0].set_ylabel("deepest overlap in the finest model [mm]")
    axes[1][0].set_ylabel("effort above the finest model's, worst case [%]")
    _legends(axes[0][-1], [one.detail for one in found])
    return plot_style.save(drawn, path)


def report(rows: Sequence[DetailRow], refused: Sequence[str], facts: Mapping[str, str]) -> str:
    """Table of all models of all tasks."""
    return render(
        "detail.md", rows=summaries(rows), refused=dict.fromkeys(refused), facts=facts, finest=FINEST, inside=INSIDE,
        growth=GROWTH, simplify="scene.simplified",
    )  # fmt: skip


def _legends(axis: Any, details: Sequence[str]) -> None:
    """Colours for details, markers for levels."""
    from matplotlib.lines import Line2D

    marks = [
        Line2D([], [], color=COLORS[name], marker="o", linestyle="none", label=name) for name in dict.fromkeys(details)
    ]
    marks += [
        Line2D([], [], color="#666666", marker=marker, linestyle="none", label=level, fillstyle="none")
        for level, marker in MARKERS.items()
    ]
    axis.legend(handles=marks, frameon=False, fontsize=8, loc="upper right")
