"""Reports as text: templates in `templates/`, filled in with jinja2."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.base.files import templates
from wholebody.bench.statistics import Interval
from wholebody.bench.tables import formatted, sentence

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"


def render(name: str, folder: Path = TEMPLATES, /, **values: Any) -> str:
    """Fill in a template of a folder, named without its last suffix; empty lines beside each other become one."""
    lines: list[str] = []
    for line in _environment(folder).get_template(f"{name}.jinja").render(values).strip().split("\n"):
        if line.strip() or (lines and lines[-1]):
            lines.append(line.rstrip())
    return "\n".join(lines)


def page(title: str, text: str, charts: Mapping[str, Path], subtitle: str = "") -> str:
    """Markdown as one HTML page that needs no network; images of the SVG charts, by their names, are put within."""
    from markdown_it import MarkdownIt

    body = str(MarkdownIt("commonmark", {"html": False}).enable("table").render(text))
    body = re.sub(r"<td[^>]*>([^<]{35,})</td>", r'<td class="text">\1</td>', body)  # texts break into lines
    picture = r'<p><img src="[^"]*?([^"/]+)\.svg" alt="([^"]*)" ?/?></p>'
    body = re.sub(picture, lambda found: _within(charts[found[1]], found[2]), body)
    sections = [(_anchor(name), name) for name in re.findall(r"<h2>(.*?)</h2>", body)]
    body = re.sub(r"<h2>(.*?)</h2>", lambda found: f'<h2 id="{_anchor(found[1])}">{found[1]}</h2>', body)
    return render("page.html", title=title, subtitle=subtitle, sections=sections, body=body)


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def _within(svg: Path, caption: str) -> str:
    """A chart within a page. Names in it are of one file, and there are many files in the page."""
    drawn = svg.read_text(encoding="utf-8")
    drawn = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{svg.stem}-", drawn[drawn.index("<svg") :])
    return f"<figure>{drawn}<figcaption>{caption}</figcaption></figure>"


def _environment(folder: Path) -> Environment:
    made = templates(folder)
    made.filters |= {
        "f": formatted,
        "measured": sentence,
        "span": spanned,
        "strong": strong,
        "tex": tex,
        "upfirst": upfirst,
        "words": words,
    }
    return made


def spanned(found: Interval, spec: str, scale: float = 1.0, unit: str = "", ends: str = "") -> str:
    """A figure times `scale` and its interval, such as "98.5 % [93, 99]"; nothing for NaN. `ends`: their format."""
    if found.value != found.value:
        return ""
    low, high = (formatted(scale * each, ends or spec, none="∞") for each in (found.low, found.high))
    return f"{formatted(scale * found.value, spec, unit, none='∞')} [{low}, {high}]"


def strong(count: int) -> str:
    """A count in bold print, unless it is zero."""
    return f"**{count}**" if count else "0"


def tex(text: str) -> str:
    """A text in which LaTeX reads no command."""
    return re.sub(r"([&%$#_{}])", r"\\\1", text)


def upfirst(text: str) -> str:
    """A text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def words(name: str) -> str:
    """A name as one reads it."""
    return name.replace("_", " ")
