"""The chart of many solves: a cell a case, in the colour of its outcome."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from wholebody.base.errors import InputError
from wholebody.base.files import write
from wholebody.studies.reach_pictures import new_chart, png

MOST = 100  # rows or columns; letters of more are too small to read
WIDTH, HEIGHT = 0.9, 0.3  # inches of a cell

COLORS: Mapping[str, str] = MappingProxyType(
    {
        "solved": "#009e73",
        "unreachable": "#e69f00",
        "infeasible": "#d55e00",
        "stalled": "#cc79a7",
        "refused": "#999999",
        "ended": "#666666",
        "cancelled": "#dddddd",
    }
)
"""Of outcomes, by Okabe and Ito (2008), whose colours are also told apart by people who are colour-blind."""


class Cell(NamedTuple):
    """A case in the table."""

    row: str  # name of its row
    column: str  # name of its column
    outcome: str  # a name of `COLORS`
    left: float  # residual distance of the goals, metres; 0 writes nothing


def draw_outcomes(cells: Sequence[Cell], path: Path) -> Path:
    """Draw the outcomes of cases as a table into a PNG file; returns the path."""
    from matplotlib.patches import Patch

    if unknown := {one.outcome for one in cells} - COLORS.keys():
        raise InputError(f"chart: no outcome is called {sorted(unknown)[0]!r}; outcomes are {', '.join(COLORS)}")
    places = Counter((one.row, one.column) for one in cells)
    if twice := [place for place, count in places.items() if count > 1]:
        name = ", ".join(filter(None, twice[0]))
        raise InputError(f"chart: {places[twice[0]]} records are called {name!r}; give records of one run")
    rows = list(dict.fromkeys(one.row for one in cells))
    columns = list(dict.fromkeys(one.column for one in cells))
    if not 0 < max(len(rows), len(columns)) <= MOST:
        raise InputError(
            f"chart: {len(rows)} rows and {len(columns)} columns; give records of 1 to {MOST} of each, such as a part"
        )
    wide = WIDTH * len(columns) + 0.09 * max(map(len, rows)) + 1.8  # inches of a letter of a row's name
    chart, axes = new_chart(1, 1, (wide, HEIGHT * len(rows) + 1.2))
    axis = axes[0, 0]
    for one in cells:
        x, y = columns.index(one.column), rows.index(one.row)
        axis.fill([x, x + 1, x + 1, x], [y, y, y + 1, y + 1], facecolor=COLORS[one.outcome], edgecolor="white")
        if one.left > 0.0:
            axis.text(x + 0.5, y + 0.5, f"{1e3 * one.left:.0f} mm", ha="center", va="center", fontsize="x-small")
    axis.set(xlim=(0, len(columns)), ylim=(len(rows), 0))
    axis.set_xticks(np.arange(len(columns)) + 0.5, [*map(_plain, columns)], fontsize="x-small")
    axis.set_yticks(np.arange(len(rows)) + 0.5, [*map(_plain, rows)], fontsize="x-small")
    axis.tick_params(length=0)
    seen = [outcome for outcome in COLORS if any(one.outcome == outcome for one in cells)]
    patches = [Patch(facecolor=COLORS[outcome], label=outcome) for outcome in seen]
    chart.legend(handles=patches, loc="outside right upper", fontsize="x-small", frameon=False)
    return write(path, png(chart))


def _plain(name: str) -> str:
    """The name so that matplotlib reads no formula in it."""
    return name.replace("$", r"\$")
