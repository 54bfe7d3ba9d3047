"""What a finished comparison leaves in its folder: every solve as CSV, charts, the report; and the page's part."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from wholebody.bench.compare import report
from wholebody.bench.compare.charts import draw_all
from wholebody.bench.compare.front import fronts
from wholebody.bench.compare.scenes import chosen, draw
from wholebody.bench.compare.settings import Settings
from wholebody.bench.compare.store import Store
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
) -> report.Material:
    """Write everything that is made from the records of a run.

    Args:
        settings: what was compared.
        store: what was found.
        folder: where it goes.
        facts: of the machine and the run.
        missing: methods that are not installed, and what installs them.
        docs: folder of the documentation, to write its part too.
        say: is told what is being made.

    Raises:
        FileFormatError: the documentation has no place for it.
    """
    given = report.material(settings, store.chunks, facts, missing)
    write_rows(folder / "solves.csv", facts, store.records)
    write_rows(folder / "summary.csv", facts, given.rows)
    front = fronts(given.results)
    if front:
        write_rows(folder / "front.csv", facts, front)
    say("charts and scenes")
    families = {family.name: family for family in settings.sets}
    methods = {adapter.name: adapter for adapter in settings.adapters}
    with ThreadPoolExecutor(1) as pool:  # scenes are drawn in a process of their own, charts in this one
        drawn = pool.submit(draw, chosen(given.results), families, methods, settings.seed, settings.cap)
        titles = [(family.name, family.title) for family in settings.sets]
        charts = draw_all(given.results, titles, folder / "charts")
        scenes = drawn.result()
    say("report")
    subtitle = f"{len(settings.sets)} problem sets, {len(settings.adapters)} methods, {len(store.records)} solves. " + (
        f"Measured {facts.get('date', '')} with wholebody {facts.get('wholebody', '')} on {facts.get('processor', '')}."
    )
    write_text(folder / PAGE, report.as_page(given, charts, scenes, subtitle) + "\n")
    short = report.as_markdown(given, False, "assets/bench")
    write_text(folder / "compare.md", short + "\n")
    if docs is not None:
        replace_section(docs / "results.md", "compare", short)
        (docs / "assets" / "bench").mkdir(parents=True, exist_ok=True)
        for svg, _ in charts.values():
            shutil.copyfile(svg, docs / "assets" / "bench" / svg.name)
    return given
