"""What a comparison leaves: every solve as CSV, charts, and the report of what to choose when and what was left out."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from wholebody.bench.report import html, render, spanned
from wholebody.bench.suite.compare import variants
from wholebody.bench.suite.compare.advice import (
    advice,
    choices,
    effort,
    error,
    percent,
    reference,
    slowness,
    standings,
    targets,
)
from wholebody.bench.suite.compare.charts import chart_name, draw_all, groups
from wholebody.bench.suite.compare.examples import pairs
from wholebody.bench.suite.compare.front import MOST, OURS, Rival, fronts
from wholebody.bench.suite.compare.lock import NAME as LOCK
from wholebody.bench.suite.compare.lock import locked, write_lock
from wholebody.bench.suite.compare.pages import Material, drawn_within, scene_values, with_long_cells, write_pages
from wholebody.bench.suite.compare.paired import algorithms
from wholebody.bench.suite.compare.rankings import in_words, rankings, seeds_in_words, sensitivity
from wholebody.bench.suite.compare.record import COARSE, DEFAULT
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.scenes import Scene, chosen, draw, in_brief
from wholebody.bench.suite.compare.settings import Settings
from wholebody.bench.suite.compare.store import Chunk, Store
from wholebody.bench.suite.compare.summary import GOOD, exclusions, kernel_of, summaries
from wholebody.bench.tables import replace_section, write_rows, write_text

PAGE = "report.html"
FEW = 10  # problems below which a share is no share
KERNEL = "60 products of matrices of 64 rows and 1,000 distances between boxes and capsules by coal"
PICTURE = re.compile(r'<p><img src="[^"]*?([^"/]+)\.svg" alt="([^"]*)" ?/?></p>')


def material(
    settings: Settings, chunks: Sequence[Chunk], facts: Mapping[str, str], missing: Mapping[str, str]
) -> Material:
    """Put the records of a run in order."""
    records = [record for chunk in chunks for record in chunk.records]
    results = Results(
        records, [family.name for family in settings.sets], [adapter.name for adapter in settings.adapters]
    )
    return Material(settings, chunks, results, summaries(results, chunks, settings.cap), facts, missing)


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
    write_rows(folder / "seeds.csv", facts, sensitivity(given.results))
    write_lock(folder / LOCK, locked(given))
    front = fronts(given.results)
    if front:
        write_rows(folder / "front.csv", facts, front)
    say("charts and scenes")
    examples = pairs(given.results, given.chunks)
    families = {family.name: family for family in settings.sets}
    methods = {adapter.name: adapter for adapter in settings.adapters}
    with ThreadPoolExecutor(1) as pool:  # scenes are drawn in a process of their own, charts in this one
        drawn = pool.submit(draw, chosen(given.results, examples), families, methods, settings.seed, settings.cap)
        titles = [(family.name, family.title) for family in settings.sets]
        charts = draw_all(given.results, given.rows, titles, folder / "charts")
        scenes = drawn.result()
    say("report")
    subtitle = f"{len(settings.sets)} problem sets, {len(settings.adapters)} methods, {len(store.records)} solves. " + (
        f"Measured {facts.get('date', '')} with wholebody {facts.get('wholebody', '')} on {facts.get('processor', '')}."
    )
    write_pages(given, charts, examples, scenes, folder)
    write_text(folder / PAGE, as_page(given, charts, in_brief(scenes), subtitle) + "\n")
    short = as_markdown(given, False, "assets/bench")
    write_text(folder / "compare.md", short + "\n")
    if docs is not None:
        replace_section(docs / "results.md", "compare", short)
        replace_section(docs / "comparison.md", "compare-variants", variants.report(given.results))
        write_lock(docs / "assets" / "bench" / f"compare-{LOCK}", locked(given))
        (docs / "assets" / "bench").mkdir(parents=True, exist_ok=True)
        for svg, _ in (found for name, found in charts.items() if f"/{name}.svg" in short):
            shutil.copyfile(svg, docs / "assets" / "bench" / svg.name)
    return given


def as_markdown(given: Material, whole: bool, charts: str) -> str:
    """The report as Markdown, or only the part that the documentation shows; `charts` is the folder of the charts."""
    results, settings = given.results, given.settings
    wall, processor, dependable = fronts(results), fronts(results.by_processor()), fronts(results, share=MOST)
    by_cpu, by_most = ({(rival.set, rival.quantity): rival for rival in rivals} for rivals in (processor, dependable))
    counts = [row.cases for row in given.rows]
    together = groups(results.adapters)
    return render(
        "compare.md",
        given=given, whole=whole, charts=charts, advice=advice(results, given.rows),
        picked=choices(results, given.rows), targets=targets(given.rows, wall, dependable),
        plain=_plain,
        ranked=standings(results, given.rows), reference=reference(results), error=error, effort=effort,
        slowness=slowness, percent=percent, rival=_rival, chart=chart_name,
        least=min(counts, default=0), most=max(counts, default=0), few=FEW,
        wall=wall, off=[rival for rival in wall if not rival.on_front], dependable=dependable,
        by_cpu=by_cpu, by_most=by_most, ours=OURS,
        differences={adapter.name: adapter.differences for adapter in settings.adapters},
        left_out=exclusions(settings, given.chunks, given.rows),
        ranking=rankings(results), ranking_words=in_words,
        seeds=seeds_in_words(sensitivity(results), {family.name: family.title for family in settings.sets}),
        kernel=kernel_of(given.chunks), kernel_about=KERNEL, groups=together,
        overviews=[chart_name("overview", number=number) for number in range(len(together))],
        good=GOOD, coarse=COARSE, tolerance=DEFAULT[0],
    )  # fmt: skip


def as_page(given: Material, charts: Mapping[str, tuple[Path, Path]], scenes: Sequence[Scene], subtitle: str) -> str:
    """The whole report as one HTML file that needs no network: charts within, scenes unpacked when they are seen.

    `charts` are SVG and PNG by name, of which the SVG goes into the page; the subtitle says when and on what.
    """
    text = html(as_markdown(given, True, "charts"))
    text = text.replace("<ul>", '<ul class="advice">', 1)
    text = with_long_cells(text)
    text = PICTURE.sub(lambda found: drawn_within(charts[found[1]][0], found[1], found[2]), text)
    titles = re.findall(r"<h2>(.*?)</h2>", text)
    text = re.sub(
        r"<h([23])>(.*?)</h\1>", lambda found: f'<h{found[1]} id="{_anchor(found[2])}">{found[2]}</h{found[1]}>', text
    )
    before, after = text.split("<p>&lt;!-- scenes --&gt;</p>")
    return render(
        "compare.html", subtitle=subtitle, titles=[(_anchor(title), title) for title in titles], before=before,
        after=after, **scene_values(scenes),
    )  # fmt: skip


def _plain(adapters: Sequence[str]) -> str:
    return ", ".join(algorithms(adapters))


def _rival(rival: Rival | None) -> str:
    """A ratio and the method that it is to, in a cell beside the others."""
    if rival is None or not rival.method:
        return "" if rival is None else "no other" if rival.on_front else "none"
    return f"{spanned(rival.ratio, '.2g')} ({rival.method})"


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
