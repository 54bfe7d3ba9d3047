"""Charts of the measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.track import CLEARANCE

if TYPE_CHECKING:
    from wholebody.bench.reaches import ReachRow
    from wholebody.bench.step import StepTime

GREY = "#666666"
THICK = "wholebody"  # drawn wide and first: with other solvers the same programs have the same answers, and hide it


def step_times(times: Sequence[StepTime], path: Path) -> tuple[Path, Path]:
    """Time of a step of every tool: the middle half as a box, 5 to 95 % as whiskers, the median written beside it."""
    reaches, tools = _names(times)
    chart, axes = plot_style.figure(1, len(reaches), (4.6 * len(reaches), 0.9 + 0.5 * len(tools)))
    for column, reach in enumerate(reaches):
        axis = axes[0][column]
        for place, tool in enumerate(reversed(tools)):
            wall = np.array([time.wall_us for time in times if (time.reach, time.tool) == (reach, tool)])
            color = plot_style.COLORS[tool]
            least, low, median, high, most = np.quantile(wall, (0.05, 0.25, 0.5, 0.75, 0.95))
            axis.plot([least, most], [place, place], color=color, linewidth=1.6, marker="|", markersize=9)
            axis.barh(place, high - low, left=low, height=0.55, color=color, alpha=0.85)
            axis.plot([median, median], [place - 0.275, place + 0.275], color="white", linewidth=1.6)
            axis.annotate(
                f"{median:.0f}", (median, place), (0, 12), textcoords="offset points",
                ha="center", va="bottom", fontsize=8, color=GREY,
            )  # fmt: skip
        plot_style.plain_log(axis)
        axis.set_yticks(range(len(tools)), tools[::-1] if column == 0 else [""] * len(tools))
        axis.set_ylim(-0.6, len(tools) - 0.2)
        axis.grid(axis="y", visible=False)
        axis.set_title(f"{reach} reach", loc="left")
        axis.set_xlabel("time of a step [µs], 5 to 95 %, median")
    return plot_style.save(chart, path)


def least_distances(times: Sequence[StepTime], path: Path) -> tuple[Path, Path]:
    """Least distance of any pair after every step, for every tool."""
    reaches, tools = _names(times)
    chart, axes = plot_style.figure(1, len(reaches), (5.0 * len(reaches), 3.4))
    for column, reach in enumerate(reaches):
        axis = axes[0][column]
        axis.axhspan(-1e3, 0.0, color="#f4dddd", zorder=0)
        axis.axhline(1e3 * CLEARANCE, color=GREY, linewidth=1.0, linestyle="--")
        lowest = 0.0
        for tool in sorted(tools, key=lambda name: name != THICK):
            chosen = [time for time in times if (time.reach, time.tool, time.repeat) == (reach, tool, 1)]
            least = np.array([time.least_mm for time in chosen])
            lowest = min(lowest, float(least.min()))
            width = 3.2 if tool == THICK else 1.5
            axis.plot([time.step for time in chosen], least, color=plot_style.COLORS[tool], linewidth=width, label=tool)
        axis.set_ylim(1.15 * lowest - 2.0, 30.0)
        axis.text(2, 1.05 * lowest - 1.5, "inside", fontsize=8, color=GREY, va="bottom")
        last = max(time.step for time in times)
        axis.text(last, 1e3 * CLEARANCE - 0.4, "clearance asked", fontsize=8, color=GREY, va="top", ha="right")
        axis.set_title(f"{reach} reach", loc="left")
        axis.set_xlabel("step")
        if column == 0:
            axis.set_ylabel("least distance of any pair [mm]")
    handles, labels = axes[0][0].get_legend_handles_labels()
    chart.legend(handles, labels, loc="outside lower center", ncols=len(tools), frameon=False)
    return plot_style.save(chart, path)


def reach_times(rows: Sequence[ReachRow], path: Path) -> tuple[Path, Path]:
    """Share of the random reaches that were answered within a time."""
    chart, axes = plot_style.figure(1, 1, (6.4, 3.4))
    axis = axes[0][0]
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        times = np.sort([row.milliseconds for row in mine if row.status == "solved"])
        share = 100.0 * np.arange(1, len(times) + 1) / len(mine)
        color = plot_style.look(method).color
        axis.step(times, share, where="post", color=color, linewidth=1.8, label=method)
    plot_style.plain_log(axis)
    axis.set_ylim(0.0, 103.0)
    axis.set_xlabel("time of a solve [ms]")
    axis.set_ylabel("reaches solved [%]")
    axis.legend(loc="lower right", frameon=False)
    return plot_style.save(chart, path)


def _names(times: Sequence[StepTime]) -> tuple[list[str], list[str]]:
    reaches = list(dict.fromkeys(time.reach for time in times))
    present = {time.tool for time in times}
    return reaches, [tool for tool in plot_style.COLORS if tool in present]
