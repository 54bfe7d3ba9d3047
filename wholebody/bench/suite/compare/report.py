"""What a comparison leaves: every solve as CSV, charts, and the report of what to choose when and what was left out."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from wholebody.bench.report import page, render
from wholebody.bench.suite.compare.advice import advice, choices, named, reference, standings
from wholebody.bench.suite.compare.charts import chart_name, draw_all, groups
from wholebody.bench.suite.compare.lock import NAME as LOCK
from wholebody.bench.suite.compare.lock import locked, write_lock
from wholebody.bench.suite.compare.results import COARSE, DEFAULT, FLOOR, Store
from wholebody.bench.suite.compare.settings import Settings
from wholebody.bench.suite.compare.summary import GOOD, Material, kernel_of, left_out, material
from wholebody.bench.tables import replace_section, write_rows, write_text

PAGE = "report.html"


def publish(
    settings: Settings,
    store: Store,
    folder: Path,
    facts: Mapping[str, str],
    missing: Mapping[str, str],
    docs: Path | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Material:
    """Write everything that is made from the records of a run into a folder, and its part of the docs where given.

    `missing` are methods that are not installed, and what installs them; `say` is told what is being made.

    Raises:
        FileFormatError: the documentation has no place for it.
    """
    given = material(settings, store.chunks, facts, missing)
    write_rows(folder / "solves.csv", facts, store.records)
    write_rows(folder / "summary.csv", facts, given.rows)
    write_lock(folder / LOCK, locked(given))
    say("charts")
    titles = {family.name: family.title for family in settings.sets}
    charts = {name: svg for name, (svg, _) in draw_all(given.results, given.rows, titles, folder / "charts").items()}
    say("report")
    text = as_markdown(given, "charts")
    write_text(folder / "compare.md", text + "\n")
    counts = f"{len(settings.sets)} problem sets, {len(settings.adapters)} methods, {len(store.records)} solves."
    subtitle = f"{counts} Measured {facts.get('date', '')} on {facts.get('processor', '')}."
    write_text(folder / PAGE, page("Speed against accuracy: which method when", text, charts, subtitle) + "\n")
    if docs is not None:
        _to_docs(given, charts, docs)
    return given


def _to_docs(given: Material, charts: Mapping[str, Path], docs: Path) -> None:
    """Write the short report into the page of results, with its charts and its lock file beside."""
    replace_section(docs / "results.md", "compare", as_markdown(given, "assets/bench", "compare_page.md"))
    assets = docs / "assets" / "bench"
    write_lock(assets / f"compare-{LOCK}", locked(given))
    for svg in charts.values():
        shutil.copyfile(svg, assets / svg.name)


def as_markdown(given: Material, charts: str, template: str = "compare.md") -> str:
    """The report as Markdown; `charts` is the folder of the charts, "compare_page.md" the template of the docs."""
    results, ranked = given.results, standings(given.results, given.rows)
    kinds = {re.split(r"[/,+ ]", one.method)[0]: one.method for one in reversed(ranked)}
    return render(
        template, kinds=list(kinds.values())[::-1], cells={(row.set, row.method): row for row in given.rows},
        given=given, charts=charts, advice=advice(results, given.rows), picked=choices(results, given.rows),
        ranked=ranked, reference=reference(results), named=named, chart=chart_name,
        groups=groups(results.adapters), counts=[row.cases for row in given.rows],
        left_out=left_out(given.settings, given.chunks, given.rows), kernel=kernel_of(given.chunks),
        good=GOOD, coarse=COARSE, floor=FLOOR, tolerance=DEFAULT[0],
    )  # fmt: skip
