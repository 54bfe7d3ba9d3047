"""Pictures: heat maps of a reach map as PNG and as a page with a slider, and the chart of many solves."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.charts import new_chart, plain, png
from wholebody.base.errors import InputError
from wholebody.base.files import templates, write

INCHES = 2.4  # width of one height
MEANING = "above 0: reached, 1 with the least measure\nbelow 0: metres short; gray: inside a thing"
INSIDE_GRAY = (0.35, 0.35, 0.38, 1.0)


def slices_chart(found: Any) -> Any:
    """Draw the heights of a reach map beside each other, seen from above."""
    # heights in one picture; of more, some are left out evenly
    shown = np.unique(np.linspace(0, len(found.z) - 1, min(len(found.z), 24)).round().astype(int)).tolist()
    rows = -(-len(shown) // 6)  # columns
    columns = -(-len(shown) // rows)
    deep, wide = (float(np.ptp(places)) + 0.1 for places in (found.x, found.y))
    high = INCHES * min(max(deep / wide, 0.4), 2.5) + 0.75  # inches of one height for its title and its axis
    chart, axes = new_chart(rows, columns, (INCHES * columns + 1.6, max(high * rows + 0.5, 3.0)))
    values = heat(found)
    image: Any = None
    for axis in axes.flat[len(shown) :]:
        axis.set_axis_off()
    for axis, k in zip(axes.flat, shown, strict=False):
        image = _slice(axis, found, values, k)
    bar = chart.colorbar(image, ax=list(axes.flat), shrink=0.8)
    bar.set_label(MEANING, fontsize="x-small")
    bar.ax.tick_params(labelsize="x-small")
    reached = f"{found.share:.0%} of {found.verdict.size} places reached, seen from above"
    chart.suptitle(f"{plain(found.frame)}\n{reached}", fontsize="medium")
    return chart


def write_page(found: Any, path: Path) -> Path:
    """Write a page with one picture a height and a slider; returns the path."""
    values, images = heat(found), []
    for k, height in enumerate(found.z.tolist()):
        chart, axes = new_chart(1, 1, (6.4, 5.2))
        image = _slice(axes[0, 0], found, values, k)
        chart.colorbar(image, ax=axes[0, 0]).set_label(MEANING, fontsize="small")
        images.append((height, base64.b64encode(png(chart)).decode()))
    facts = {**found.counts(), "solves": found.solves, "reached": found.extent}
    first = int(np.argmax(found.reached.sum(axis=(0, 1))))
    page = templates(Path(__file__).parent).get_template("reach.html.jinja")
    return write(path, page.render(title=f"Reach of {found.frame}", facts=facts, first=first, images=images))


def heat(found: Any) -> Array:
    """(nx, ny, nz) minus the distance that is left, metres; where reached, 1 for the least measure to 0."""
    values: Array = -np.asarray(found.left, dtype=float)
    reached = found.reached
    if reached.any():
        measures = found.measure[reached]
        span = float(np.ptp(measures))
        values[reached] = (measures.max() - measures) / span if span > 0.0 else 1.0
    return values


def _slice(axis: Any, found: Any, values: Array, k: int) -> Any:
    """Draw one height: reached places green, the others by their residual, places inside of things gray."""
    from matplotlib.colors import LinearSegmentedColormap

    colors = LinearSegmentedColormap.from_list(
        "reach", [(0.0, "#7f0000"), (0.25, "#d7301f"), (0.4999, "#fdd0a2"), (0.5, "#c7e9c0"), (1.0, "#00441b")]
    )
    half = [0.5 * float(places[1] - places[0]) if len(places) > 1 else 0.05 for places in (found.x, found.y)]
    extent = (found.y[0] - half[1], found.y[-1] + half[1], found.x[0] - half[0], found.x[-1] + half[0])
    image = axis.imshow(
        values[:, :, k], origin="lower", extent=extent, cmap=colors, vmin=-1.0, vmax=1.0, interpolation="nearest"
    )
    gray = np.zeros((*values.shape[:2], 4))
    gray[found.inside[:, :, k]] = INSIDE_GRAY
    axis.imshow(gray, origin="lower", extent=extent, interpolation="nearest")
    axis.invert_xaxis()
    axis.set_title(f"z = {found.z[k]:.2f} m", fontsize="small")
    axis.set_xlabel("y, left [m]", fontsize="x-small")
    axis.set_ylabel("x, forward [m]", fontsize="x-small")
    axis.tick_params(labelsize="x-small")
    axis.locator_params(nbins=5)
    return image


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


def outcomes_chart(records: Sequence[Any]) -> Any:
    """Draw the outcomes of records as a table: targets are columns."""
    from matplotlib.patches import Patch

    if unknown := {one.outcome for one in records} - COLORS.keys():
        raise InputError(f"chart: no outcome is called {sorted(unknown)[0]!r}; outcomes are {', '.join(COLORS)}")
    factors = [one.factors or {"": one.name} for one in records]
    places = [
        (", ".join(value for factor, value in each.items() if factor != "target"), each.get("target", ""))
        for each in factors
    ]
    if twice := [place for place, count in Counter(places).items() if count > 1]:
        name = ", ".join(filter(None, twice[0]))
        raise InputError(f"chart: {places.count(twice[0])} records are called {name!r}; give records of one run")
    rows, columns = (list(dict.fromkeys(place[k] for place in places)) for k in (0, 1))
    if not 0 < max(len(rows), len(columns)) <= MOST:
        raise InputError(
            f"chart: {len(rows)} rows and {len(columns)} columns; give records of 1 to {MOST} of each, such as a part"
        )
    wide = WIDTH * len(columns) + 0.09 * max(map(len, rows)) + 1.8  # inches of a letter of a row's name
    chart, axes = new_chart(1, 1, (wide, HEIGHT * len(rows) + 1.2))
    axis = axes[0, 0]
    for one, (row, column) in zip(records, places, strict=True):
        x, y = columns.index(column), rows.index(row)
        axis.fill([x, x + 1, x + 1, x], [y, y, y + 1, y + 1], facecolor=COLORS[one.outcome], edgecolor="white")
        if one.goal_error > 0.0 and not one.solved:
            axis.text(x + 0.5, y + 0.5, f"{1e3 * one.goal_error:.0f} mm", ha="center", va="center", fontsize="x-small")
    axis.set(xlim=(0, len(columns)), ylim=(len(rows), 0))
    # so that matplotlib reads no formula in a name
    axis.set_xticks(np.arange(len(columns)) + 0.5, [*(plain(name) for name in columns)], fontsize="x-small")
    axis.set_yticks(np.arange(len(rows)) + 0.5, [*(plain(name) for name in rows)], fontsize="x-small")
    axis.tick_params(length=0)
    seen = {one.outcome for one in records}
    patches = [Patch(facecolor=color, label=outcome) for outcome, color in COLORS.items() if outcome in seen]
    chart.legend(handles=patches, loc="outside right upper", fontsize="x-small", frameon=False)
    return chart
