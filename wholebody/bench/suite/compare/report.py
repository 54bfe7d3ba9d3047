"""What a comparison leaves: every solve as CSV, charts, and the report of what to choose when and what was left out."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.plot_style import MOST, method_style
from wholebody.bench.rows import Panel, chart
from wholebody.bench.suite.compare.lock import NAME as LOCK
from wholebody.bench.suite.compare.lock import locked, write_lock
from wholebody.bench.suite.compare.results import COARSE, DEFAULT, FLOOR, Quantity, Results, Store, middle
from wholebody.bench.suite.compare.run import Settings
from wholebody.bench.suite.compare.summary import (
    GOOD,
    OURS,
    Material,
    Standing,
    Summary,
    advice,
    choices,
    kernel_of,
    left_out,
    material,
    named,
    reference,
    standings,
)
from wholebody.bench.tables import page, render, write_rows, write_text


def curve(results: Results, family: str, adapter: str, quantity: Quantity) -> tuple[list[float], list[float]]:
    """Median milliseconds and values of a method at its budgets, from the fastest on, without dominated ones."""
    cases = results.swept(family, adapter)
    found: tuple[list[float], list[float]] = [], []
    for level in results.levels(family, adapter):
        seconds, values = results.values(family, adapter, level, quantity, cases)
        value, spent = middle(values), seconds[np.isfinite(seconds)]
        if np.isfinite(value) and len(spent) and value < min(found[1], default=np.inf):
            found[0].append(1e3 * middle(spent))
            found[1].append(value)
    return found


def speed_accuracy(results: Results, family: str, title: str, adapters: Sequence[str], path: Path) -> tuple[Path, Path]:
    """One panel a quantity: median error over median time at every budget of a method."""
    what = "a frame" if results.moving(family) else "a solve"
    panels = []
    for quantity in results.quantities(family):
        lines = {name: curve(results, family, name, quantity) for name in adapters}
        heading = f"{title}: {quantity.title}"
        panels.append(Panel(heading, f"time of {what} [ms]", quantity.label, lines, "xy", "o", [COARSE]))
    return chart(panels, path)


def overview(
    rows: Sequence[Summary], titles: Mapping[str, str], adapters: Sequence[str], path: Path
) -> tuple[Path, Path]:
    """One row a set: share solved and mean time of each method, with their intervals of 95 %."""
    shown = {
        title: {
            row.method: (row.success.scaled(100.0), row.mean_ms)
            for row in rows
            if row.set == family and row.method in adapters and row.refused < row.cases
        }
        for family, title in titles.items()
    }
    note = "failures as the longest"
    heading = "Every set: solved, and how fast; bands are intervals of 95 %"
    return plot_style.shares_and_times(shown, {name: method_style(name) for name in adapters}, note, heading, path)


def chart_name(family: str, number: int = 0) -> str:
    """Name of the chart of a set for a group of methods; the first group has no number."""
    return f"compare-{family.replace('_', '-')}{f'-{number + 1}' if number else ''}"


def groups(adapters: Sequence[str]) -> list[tuple[str, ...]]:
    """Methods beside each other in charts: at most `MOST`, one of each algorithm first, our default in each."""
    kinds: dict[str, str] = {}
    for name in adapters:
        kinds.setdefault(re.split(r"[/,+ ]", name)[0], name)
    order = [*kinds.values(), *(name for name in adapters if name not in kinds.values())]
    if len(order) <= MOST:
        return [tuple(order)] if order else []
    base = [OURS] if OURS in order else []
    others = [name for name in order if name not in base]
    size = MOST - len(base)
    return [tuple(base + others[first : first + size]) for first in range(0, len(others), size)]


def draw_all(
    results: Results, rows: Sequence[Summary], titles: Mapping[str, str], folder: Path
) -> dict[str, tuple[Path, Path]]:
    """All charts of a comparison, by name; `titles` are those of the sets by their names."""
    drawn = {}
    for number, adapters in enumerate(groups(results.adapters)):
        name = chart_name("overview", number)
        drawn[name] = overview(rows, titles, adapters, folder / name)
        for family, title in titles.items():
            name = chart_name(family, number)
            drawn[name] = speed_accuracy(results, family, title, adapters, folder / name)
    return drawn


PAGE = "report.html"


def write_summary(rows: Sequence[Summary], facts: Mapping[str, str], folder: Path) -> None:
    """Write the table of sets and methods as CSV, and with intervals as LaTeX for a paper."""
    write_rows(folder / "summary.csv", facts, rows)
    sets = list(dict.fromkeys(row.set for row in rows))
    text = render(
        "summary.tex", rows=rows, sets=sets, facts="; ".join(f"{name} {value}" for name, value in facts.items())
    )
    write_text(folder / "summary.tex", text + "\n")


def publish(
    settings: Settings,
    store: Store,
    folder: Path,
    facts: Mapping[str, str],
    missing: Mapping[str, str],
    say: Callable[[str], None] = lambda text: None,
) -> Material:
    """Write everything that is made from a run into a folder; `missing`: methods, and what installs them."""
    given = material(settings, store.chunks, facts, missing)
    write_rows(folder / "solves.csv", facts, store.records)
    write_summary(given.rows, facts, folder)
    write_lock(folder / LOCK, locked(given))
    say("charts")
    titles = {family.name: family.title for family in settings.sets}
    charts = {name: svg for name, (svg, _) in draw_all(given.results, given.rows, titles, folder / "charts").items()}
    say("report")
    text = as_markdown(given)
    write_text(folder / "compare.md", text + "\n")
    counts = f"{len(settings.sets)} problem sets, {len(settings.adapters)} methods, {len(store.records)} solves."
    subtitle = f"{counts} Measured {facts.get('date', '')} on {facts.get('processor', '')}."
    write_text(folder / PAGE, page("Speed against accuracy: which method when", text, charts, subtitle) + "\n")
    return given


def as_markdown(given: Material) -> str:
    """The report as Markdown; its charts are in the folder `charts`."""
    results, ranked = given.results, standings(given.results, given.rows)
    leading: dict[str, Standing] = {}  # the best of each algorithm
    for one in ranked:
        leading.setdefault(re.split(r"[/,+ ]", one.method)[0], one)
    return render(
        "compare.md", given=given, leading=list(leading.values()), charts="charts", advice=advice(results, given.rows),
        picked=choices(results, given.rows),
        ranked=ranked, reference=reference(results), named=named, chart=chart_name,
        groups=groups(results.adapters), counts=[row.cases for row in given.rows],
        left_out=left_out(given.settings, given.chunks, given.rows), kernel=kernel_of(given.chunks),
        good=GOOD, coarse=COARSE, floor=FLOOR, tolerance=DEFAULT[0],
    )  # fmt: skip
