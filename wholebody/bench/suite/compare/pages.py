"""A page for every set and for every method: what the report says of it alone, with a link to the others."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from wholebody.bench.report import html, render, upfirst
from wholebody.bench.suite.compare.advice import choices, effort, error, percent, reference, slowness, standings
from wholebody.bench.suite.compare.charts import chart_name, groups
from wholebody.bench.suite.compare.examples import Pair, fault, resisting
from wholebody.bench.suite.compare.paired import named
from wholebody.bench.suite.compare.rankings import in_words, rankings
from wholebody.bench.suite.compare.results import Results
from wholebody.bench.suite.compare.scenes import OPENING, Scene
from wholebody.bench.suite.compare.settings import Settings
from wholebody.bench.suite.compare.store import Chunk
from wholebody.bench.suite.compare.summary import GOOD, Summary
from wholebody.bench.tables import write_text

FOLDER = "pages"
LONG = 35  # letters of a table's cell that is a text and no figure


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


def write_pages(
    given: Material,
    charts: Mapping[str, tuple[Path, Path]],
    examples: Mapping[tuple[str, str], Pair],
    scenes: Sequence[Scene],
    folder: Path,
) -> list[Path]:
    """Write `pages/set-NAME.html`, with the scenes of the set, and `pages/method-NAME.html`; return them."""
    resisted = resisting(given.chunks)
    results, rows = given.results, given.rows
    ranked = {one.set: one for one in rankings(results)}
    picked = {one.set: one for one in choices(results, rows)}
    standing = {one.method: one for one in standings(results, rows)}
    links = {
        **{family.title: page_name("set", family.name) for family in given.settings.sets},
        **{adapter.name: page_name("method", adapter.name) for adapter in given.settings.adapters},
    }
    made = []
    groups_count = len(groups(results.adapters))
    for family in given.settings.sets:
        shown = [chart_name(family.name, kind, number) for number in range(groups_count) for kind in ("-profile", "")]
        text = render(
            "compare_set.md", family=family, rows=[row for row in rows if row.set == family.name],
            moving=results.moving(family.name), choice=picked[family.name], ranking=ranked[family.name].ranking,
            in_words=in_words, named=named, error=error, effort=effort, good=GOOD, facts=given.facts,
            pairs=[(name, pair) for name in results.adapters if any(pair := examples[family.name, name])],
            resisting=resisted.get(family.name, (0, 0)), fault=fault,
        )  # fmt: skip
        path = folder / FOLDER / page_name("set", family.name)
        mine = [scene for scene in scenes if scene.shown.record.set == family.name]
        write_page(path, family.title, text, [charts[name][0] for name in shown], _others(links, path), mine)
        made.append(path)
    for adapter in given.settings.adapters:
        text = render(
            "compare_method.md", adapter=adapter, rows=[row for row in rows if row.method == adapter.name],
            titles={family.name: family.title for family in given.settings.sets}, standing=standing.get(adapter.name),
            sentence=partial(_sentence, adapter.name), slowness=slowness, percent=percent, base=reference(results),
            good=GOOD, sets=len(given.settings.sets), facts=given.facts, fault=fault,
            pairs=[(one.title, pair) for one in given.settings.sets if any(pair := examples[one.name, adapter.name])],
        )  # fmt: skip
        path = folder / FOLDER / page_name("method", adapter.name)
        write_page(path, adapter.name, text, [], _others(links, path))
        made.append(path)
    return made


def _sentence(name: str, said: str) -> str:
    """What an adapter says, as a sentence; names of code, which methods have too, keep their small letters."""
    first = re.split(r"\W", said, maxsplit=1)[0]
    kept = first in (re.split(r"\W", name, maxsplit=1)[0], "wb") or re.match(r"\w+\.\w", said)
    return f"{(said if kept else upfirst(said)).rstrip('.')}."


def page_name(kind: str, name: str) -> str:
    """File of a page: names of methods have signs that files must not have."""
    return f"{kind}-{re.sub(r'[^A-Za-z0-9]+', '-', name).strip('-')}.html"


def _others(links: Mapping[str, str], path: Path) -> list[tuple[str, str]]:
    return [(other, file) for other, file in links.items() if file != path.name]


def write_page(
    path: Path,
    title: str,
    text: str,
    charts: Sequence[Path],
    links: Sequence[tuple[str, str]],
    scenes: Sequence[Scene] = (),
) -> Path:
    """Write Markdown as a page with scenes and SVG charts within, and links: what each is to, and its file."""
    drawn = [drawn_within(svg, svg.stem, "") for svg in charts]
    body = with_long_cells(html(text))
    write_text(
        path, render("page.html", title=title, body=body, drawn=drawn, links=links, **scene_values(scenes)) + "\n"
    )
    return path


def with_long_cells(text: str) -> str:
    """HTML whose table cells that are texts and no figures are marked as such, so that they are broken into lines."""
    return re.sub(rf"<td[^>]*>([^<]{{{LONG},}})</td>", r'<td class="text">\1</td>', text)


def scene_values(scenes: Sequence[Scene]) -> dict[str, Any]:
    """What a template needs to show scenes: they, what all of them share, packed, and where a picture belongs in it."""
    shell = base64.b64encode(gzip.compress(scenes[0].shell.encode("utf-8"), mtime=0)).decode("ascii") if scenes else ""
    return {"scenes": scenes, "shell": shell, "opening": json.dumps(OPENING).replace("<", "\\u003c")}


def drawn_within(svg: Path, name: str, caption: str) -> str:
    """A chart within the page. Names in it are of one file, and there are many files in the page."""
    drawn = svg.read_text(encoding="utf-8")
    drawn = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", drawn[drawn.index("<svg") :])
    return f"<figure>{drawn}<figcaption>{caption}</figcaption></figure>"
