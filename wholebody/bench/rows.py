"""What every measurement is made of: a record of a case by a tool, one table of them, and two kinds of charts."""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from wholebody.base.files import packaged_toml
from wholebody.bench import plot_style
from wholebody.bench.statistics import Interval
from wholebody.bench.tables import formatted, sentence

Figure = float | int | str | Interval
_R = TypeVar("_R")


@dataclass(frozen=True)
class Row:
    """What one tool did with one case: figures by their names, which have the units and are the columns of a table."""

    case: str
    tool: str
    figures: Mapping[str, Figure]

    def __getitem__(self, name: str) -> Any:
        """A figure."""
        return self.figures[name]


def measured_ms(work: Callable[[], _R]) -> tuple[float, float, _R]:
    """Milliseconds of the processor and of the clock that a piece of work takes, and what came of it."""
    worked, clock = time.process_time(), time.perf_counter()
    result = work()
    return 1e3 * (time.process_time() - worked), 1e3 * (time.perf_counter() - clock), result


@contextmanager
def quiet() -> Iterator[None]:
    """No garbage collection and no log lines while the clock runs."""
    gc.collect()
    gc.disable()
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
        gc.enable()


def times(values: Any, unit: str = "ms", name: str = "") -> dict[str, Figure]:
    """Median and 95 % of some times (n,), as figures."""
    known = np.asarray(values, dtype=float)
    front = f"{name} " if name else ""
    return {
        f"{front}median {unit}": float(np.median(known)),
        f"{front}p95 {unit}": float(np.quantile(known, 0.95)),
    }


def table(rows: Sequence[Row]) -> str:
    """Rows as a table of Markdown: case, tool if any has one, and a column for every figure that one of them has."""
    names = list(dict.fromkeys(name for row in rows for name in row.figures))
    heads = 1 + any(row.tool for row in rows)
    lines = [f"| {' | '.join([''] * heads + names)} |", f"|{'---|' * heads}{'---:|' * len(names)}"]
    for row in rows:
        cells = [shown(row.figures[name]) if name in row.figures else "" for name in names]
        lines.append(f"| {' | '.join([*(row.case, row.tool)[:heads], *cells])} |")
    return "\n".join(lines)


def in_words(row: Row) -> str:
    """A row in one line."""
    return f"{row.case}, {row.tool}: {', '.join(f'{name} {value}' for name, value in row.figures.items())}"


def only(rows: Sequence[Row], *names: str) -> list[Row]:
    """The rows with these figures alone, for a report; their CSV file has all of them."""
    return [Row(row.case, row.tool, {name: row[name] for name in names if name in row.figures}) for row in rows]


def across(rows: Sequence[Row], *names: str, columns: str = "case") -> list[Row]:
    """Figures of rows as a table with two headings: a row a tool, a column a case and figure, or the reverse."""
    found: dict[str, dict[str, Figure]] = {}
    for row in rows:
        down, column = (row.tool, row.case) if columns == "case" else (row.case, row.tool)
        titles = {name: column if len(names) == 1 else f"{column}, {name}" for name in names if name in row.figures}
        found.setdefault(down, {}).update({title: row[name] for name, title in titles.items()})
    return [Row(down, "", figures) for down, figures in found.items() if figures]


def shown(figure: Figure) -> str:
    """A figure as text: three digits, and the interval in brackets; nothing for what is not finite."""
    if isinstance(figure, Interval):
        ends = ", ".join(shown(end) or "∞" for end in (figure.low, figure.high))
        return f"{shown(figure.value)} [{ends}]" if isfinite(figure.value) else ""
    if isinstance(figure, float):
        return formatted(figure, ".3g")
    return str(figure)


def texts() -> dict[str, Any]:
    """What `texts.toml` holds by name: what reports say above their tables, and figures that others published."""
    return packaged_toml(Path(__file__).with_name("texts.toml"))


def report(about: str, tables: Mapping[str, Sequence[Row]], facts: Mapping[str, str], notes: Sequence[str] = ()) -> str:
    """Markdown: what was measured, the tables under their titles (none for one), notes, and the machine."""
    parts = [about]
    for title, rows in tables.items():
        parts += [f"### {title}"] if title else []
        parts += [table(rows)] if rows else []
    parts += ["\n".join(f"- {note}" for note in notes)] if notes else []
    return "\n\n".join([*parts, sentence(facts)])


class Panel(NamedTuple):
    """One of the panels of a chart.

    `lines`: places along x and y by label, which has one colour in all charts; `log`: axes with a logarithmic scale,
    "", "x", "y" or "xy"; `marker` "" draws lines alone; `levels`: heights of dashed lines.
    """

    title: str
    x: str
    y: str
    lines: Mapping[str, tuple[Any, Any]]
    log: str = ""
    marker: str = ""
    levels: Sequence[float] = ()


def chart(panels: Sequence[Panel], path: Path, columns: int = 3) -> tuple[Path, Path]:
    """Draw panels beside each other; return the SVG and the PNG."""
    columns = min(columns, len(panels))
    count = -(-len(panels) // columns)
    drawn, axes = plot_style.figure(count, columns, (max(6.4, 4.4 * columns), 0.6 + 3.2 * count))
    labels: dict[str, Any] = {}
    for number, panel in enumerate(panels):
        axis = axes[number // columns][number % columns]
        for label, (x, y) in panel.lines.items():
            color = plot_style.method_style(label).color
            (labels[label],) = axis.plot(x, y, color=color, marker=panel.marker, markersize=4, linewidth=1.3)
        for level in panel.levels:
            axis.axhline(level, color="#666666", linewidth=0.9, linestyle="--")
        if "x" in panel.log:
            plot_style.plain_log(axis)
        if "y" in panel.log:
            axis.set_yscale("log")
        axis.set_title(panel.title, loc="left")
        axis.set(xlabel=panel.x, ylabel=panel.y)
    for place in range(len(panels), count * columns):
        axes[place // columns][place % columns].set_visible(False)
    plot_style.legend_below(drawn, labels)
    return plot_style.save(drawn, path)


def shares(title: str, x: str, values: Mapping[str, Any], of: Mapping[str, int] | None = None) -> Panel:
    """A panel of what share [%] of the values of each label is at most x; `of` counts those that have no value too."""
    lines = {}
    for label, found in values.items():
        known = np.sort(np.asarray(found, dtype=float))
        count = len(known) if of is None else of[label]
        lines[label] = known, 100.0 * np.arange(1, len(known) + 1) / max(count, 1)
    return Panel(title, x, "share [%]", lines, log="x")
