"""The report of a comparison: what to choose when, the charts, the figures, and what was left out."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from wholebody.bench.compare.advice import advice, choices, effort, error, reference, slowness, standings
from wholebody.bench.compare.exclusions import exclusions
from wholebody.bench.compare.front import MOST, OURS, Rival, fronts
from wholebody.bench.compare.paired import algorithms
from wholebody.bench.compare.record import COARSE, DEFAULT
from wholebody.bench.compare.results import Results
from wholebody.bench.compare.scenes import OPENING, Scene
from wholebody.bench.compare.settings import Settings
from wholebody.bench.compare.store import Chunk
from wholebody.bench.compare.summary import GOOD, Summary, summaries
from wholebody.bench.report import formatted, render

FEW = 10  # problems below which a share is no share
LONG = 35  # letters of a table's cell that is a text and no figure
PICTURE = re.compile(r'<p><img src="[^"]*?([^"/]+)\.svg" alt="([^"]*)" ?/?></p>')


@dataclass(frozen=True)
class Material:
    """All that a report is written from.

    Attributes:
        settings: what was asked for.
        chunks: what was done.
        results: the records of them.
        rows: the figures at the default budget.
        facts: of the machine and the run.
        missing: methods that are not installed, and the command that installs them.
    """

    settings: Settings
    chunks: Sequence[Chunk]
    results: Results
    rows: Sequence[Summary]
    facts: Mapping[str, str]
    missing: Mapping[str, str]


def material(
    settings: Settings, chunks: Sequence[Chunk], facts: Mapping[str, str], missing: Mapping[str, str]
) -> Material:
    """Put the records of a run in order."""
    records = [record for chunk in chunks for record in chunk.records]
    results = Results(
        records, [family.name for family in settings.sets], [adapter.name for adapter in settings.adapters]
    )
    return Material(settings, chunks, results, summaries(results), facts, missing)


def as_markdown(given: Material, whole: bool, charts: str) -> str:
    """The report as Markdown.

    Args:
        given: what it is written from.
        whole: everything, or only the part that the documentation shows.
        charts: folder of the charts, as seen from the page.
    """
    results, settings = given.results, given.settings
    wall, processor, dependable = fronts(results), fronts(results.by_processor()), fronts(results, share=MOST)
    by_cpu, by_most = ({(rival.set, rival.quantity): rival for rival in rivals} for rivals in (processor, dependable))
    counts = [row.cases for row in given.rows]
    return render(
        "compare.md",
        given=given, whole=whole, charts=charts, advice=advice(results, given.rows),
        picked=choices(results, given.rows),
        plain=_plain,
        ranked=standings(results, given.rows), reference=reference(results), error=error, effort=effort,
        slowness=slowness, rival=_rival, chart=_chart,
        least=min(counts, default=0), most=max(counts, default=0), few=FEW,
        wall=wall, off=[rival for rival in wall if not rival.on_front], dependable=dependable,
        by_cpu=by_cpu, by_most=by_most, ours=OURS,
        differences={adapter.name: adapter.differences for adapter in settings.adapters},
        left_out=exclusions(settings, given.chunks, given.rows),
        good=GOOD, coarse=COARSE, tolerance=DEFAULT[0],
    )  # fmt: skip


def as_page(given: Material, charts: Mapping[str, tuple[Path, Path]], scenes: Sequence[Scene], subtitle: str) -> str:
    """The whole report as one HTML file that needs no network: charts within, scenes unpacked when they are seen.

    Args:
        given: what it is written from.
        charts: name -> SVG and PNG; the SVG goes into the page.
        scenes: to look at.
        subtitle: below the title: when, on what.
    """
    from markdown_it import MarkdownIt

    text = MarkdownIt("commonmark", {"html": False}).enable("table").render(as_markdown(given, True, "charts"))
    text = text.replace("<ul>", '<ul class="advice">', 1)
    text = re.sub(rf"<td[^>]*>([^<]{{{LONG},}})</td>", r'<td class="text">\1</td>', text)
    text = PICTURE.sub(lambda found: _drawn(charts[found[1]][0], found[1], found[2]), text)
    titles = re.findall(r"<h2>(.*?)</h2>", text)
    text = re.sub(
        r"<h([23])>(.*?)</h\1>", lambda found: f'<h{found[1]} id="{_anchor(found[2])}">{found[2]}</h{found[1]}>', text
    )
    before, after = text.split("<p>&lt;!-- scenes --&gt;</p>")
    shell = base64.b64encode(gzip.compress(scenes[0].shell.encode("utf-8"), mtime=0)).decode("ascii") if scenes else ""
    return render(
        "compare.html", subtitle=subtitle, titles=[(_anchor(title), title) for title in titles], before=before,
        after=after, scenes=scenes, shell=shell, opening=json.dumps(OPENING).replace("<", "\\u003c"),
    )  # fmt: skip


def _chart(family: str) -> str:
    """Name of the chart of a set."""
    return f"compare-{family.replace('_', '-')}"


def _plain(adapters: Sequence[str]) -> str:
    return ", ".join(algorithms(adapters))


def _rival(rival: Rival | None) -> str:
    """A ratio and the method that it is to, in a cell beside the others."""
    if rival is None or not rival.method:
        return "" if rival is None else "no other" if rival.on_front else "none"
    return f"{formatted(rival.ratio, '.2g', none='∞')} ({rival.method})"


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def _drawn(svg: Path, name: str, caption: str) -> str:
    """A chart within the page. Names in it are of one file, and there are many files in the page."""
    drawn = svg.read_text(encoding="utf-8")
    drawn = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", drawn[drawn.index("<svg") :])
    return f"<figure>{drawn}<figcaption>{caption}</figcaption></figure>"
