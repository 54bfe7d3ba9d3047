"""The report as one HTML file that needs no network: charts as SVG within, scenes packed and unpacked when seen."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from wholebody.bench.compare.advice import words
from wholebody.bench.compare.blocks import Block, Chart, Heading, Points, Scenes, Table, Text
from wholebody.bench.compare.scenes import OPENING, Scene

STYLE = """
:root { color-scheme: light; } * { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #1c2733; margin: 0; background: #fff; }
main { max-width: 1180px; margin: 0 auto; padding: 24px 28px 80px; }
h1 { font-size: 30px; margin: 18px 0 4px; } h2 { font-size: 22px; margin: 44px 0 10px; border-top: 1px solid #dde2e7;
padding-top: 18px; } h3 { font-size: 17px; margin: 26px 0 8px; } .sub { color: #5a6672; margin: 0 0 18px; }
table { border-collapse: collapse; font-size: 13.5px; margin: 14px 0; display: block; overflow-x: auto; }
th { text-align: right; font-weight: 600; color: #44505c; border-bottom: 2px solid #cfd6dd; padding: 4px 9px;
vertical-align: bottom; } td { text-align: right; padding: 3px 9px; border-bottom: 1px solid #eceff2; }
th:first-child, td:first-child, td.text { text-align: left; } tr:hover td { background: #f6f8fa; }
td, th { white-space: nowrap; } td.text, th { white-space: normal; } code { background: #eef1f4; padding: 0 4px;
border-radius: 4px; } figure { margin: 16px 0; } figure svg { width: 100%; height: auto; }
figcaption { color: #5a6672; font-size: 13.5px; } li { margin: 5px 0; } nav { font-size: 14px; line-height: 2; }
nav a { margin-right: 14px; color: #0b63a5; text-decoration: none; } .advice { background: #eef5fb; border-left: 4px
solid #0072b2; padding: 8px 20px; border-radius: 4px; } .scenes { display: grid; grid-template-columns: 1fr 1fr;
gap: 20px; } .scenes iframe { width: 100%; height: 420px; border: 1px solid #cfd6dd; border-radius: 6px; }
"""

SCRIPT = """
(async function () {
  const unpack = async text => {
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return await new Response(stream).text();
  };
  const holder = document.getElementById("shell");
  if (!holder) return;
  let shell = null;
  const show = async frame => {
    shell = shell || unpack(holder.textContent);
    const picture = await unpack(document.getElementById(frame.dataset.picture).textContent);
    const parts = (await shell).split(OPENING);
    frame.srcdoc = parts[0] + OPENING + picture + parts[1];
  };
  const seen = new IntersectionObserver(entries => {
    for (const entry of entries) if (entry.isIntersecting) { seen.unobserve(entry.target); show(entry.target); }
  }, { rootMargin: "200px" });
  for (const frame of document.querySelectorAll("iframe[data-picture]")) seen.observe(frame);
})();
"""


def write_html(
    blocks: Sequence[Block], charts: Mapping[str, tuple[Path, Path]], scenes: Sequence[Scene], subtitle: str
) -> str:
    """The page.

    Args:
        blocks: what it says.
        charts: name -> SVG and PNG; the SVG goes into the page.
        scenes: to look at.
        subtitle: below the title: when, on what.
    """
    parts, places = [], []
    advice = True
    for block in blocks:
        if isinstance(block, Heading):
            anchor = re.sub(r"[^a-z0-9]+", "-", block.text.lower()).strip("-")
            parts.append(f'<h{block.level} id="{anchor}">{html.escape(block.text)}</h{block.level}>')
            if block.level == 2:
                places.append(f'<a href="#{anchor}">{html.escape(block.text)}</a>')
        elif isinstance(block, Text):
            parts.append(f"<p>{_inline(block.text)}</p>")
        elif isinstance(block, Points):
            kind = ' class="advice"' if advice else ""
            advice = False
            parts.append(f"<div{kind}><ul>{''.join(f'<li>{_inline(text)}</li>' for text in block.texts)}</ul></div>")
        elif isinstance(block, Table):
            parts.append(_table(block))
        elif isinstance(block, Chart):
            parts.append(_chart(block, charts[block.name][0]))
        elif isinstance(block, Scenes):
            parts.append(_scenes(scenes))
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Which method when</title>'
        f'<link rel="icon" href="data:,"><style>{STYLE}</style></head><body><main>'
        "<h1>Speed against accuracy: which method when</h1>"
        f'<p class="sub">{_inline(subtitle)}</p><nav>{"".join(places)}</nav>{"".join(parts)}</main>'
        f"{_packed(scenes)}<script>const OPENING = {_script_safe(OPENING)};{SCRIPT}</script></body></html>\n"
    )


def _inline(text: str) -> str:
    made = html.escape(text)
    made = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", made)
    return re.sub(r"`(.+?)`", r"<code>\1</code>", made)


def _table(block: Table) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in block.columns)
    rows = []
    for row in block.rows:
        cells = [f"<td{_kind(cell)}>{html.escape(cell)}</td>" for cell in row]
        rows.append(f"<tr>{''.join(cells)}</tr>")
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _kind(cell: str) -> str:
    return ' class="text"' if len(cell) > 34 else ""


def _chart(block: Chart, svg: Path) -> str:
    drawn = svg.read_text(encoding="utf-8")
    drawn = drawn[drawn.index("<svg") :]
    # names are of one file, and there are many files in the page
    drawn = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{block.name}-", drawn)
    return f"<figure>{drawn}<figcaption>{html.escape(block.caption)}</figcaption></figure>"


def _scenes(scenes: Sequence[Scene]) -> str:
    if not scenes:
        return "<p>No case was found in which one method answers well and another does not.</p>"
    shown = []
    for number, scene in enumerate(scenes):
        case = scene.shown
        title = f"{words(case.set)} {case.number}"
        about = f"{case.about} Solid: {case.bad}. Transparent: {case.good}."
        shown.append(
            f'<figure><iframe data-picture="picture-{number}" title="{html.escape(title)}"></iframe>'
            f"<figcaption><strong>{html.escape(title)}.</strong> {html.escape(about)}</figcaption></figure>"
        )
    return (
        "<p>Turn them with the mouse. They are the problems of a set in which an answer is farthest from one.</p>"
        f'<div class="scenes">{"".join(shown)}</div>'
    )


def _packed(scenes: Sequence[Scene]) -> str:
    if not scenes:
        return ""
    shell = base64.b64encode(gzip.compress(scenes[0].shell.encode("utf-8"), mtime=0)).decode("ascii")
    kept = [f'<script id="shell" type="application/octet-stream">{shell}</script>']
    kept += [
        f'<script id="picture-{number}" type="application/octet-stream">{scene.picture}</script>'
        for number, scene in enumerate(scenes)
    ]
    return "".join(kept)


def _script_safe(text: str) -> str:
    return json.dumps(text).replace("<", "\\u003c")
