"""Results as files: CSV with the machine at its head, reports from templates, sections of pages between two markers."""

from __future__ import annotations

import dataclasses
import os
import platform
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from importlib import metadata
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.base.compiled import usable_cores
from wholebody.base.files import csv_text, make_folder, templates, write
from wholebody.bench.statistics import Interval
from wholebody.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment


def machine() -> dict[str, str]:
    """Return what a reader has to know of the machine and of the versions, in the order in which it is written."""
    facts = {
        "wholebody": __version__,
        "date": date.today().isoformat(),
        "processor": _processor(),
        "cores": str(usable_cores()),
        "load": f"{os.getloadavg()[0]:.1f} in the minute before",
        "system": f"{platform.system()} {platform.release()}, {platform.libc_ver()[1] or 'unknown libc'}",
        "python": platform.python_version(),
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "not set"),
    }
    facts["numba"] = _version("numba") or "not installed"  # our own linearisation is faster with it
    packages = (
        "pin", "coal", "numpy", "scipy", "osqp", "daqp", "quadprog", "proxsuite", "piqp", "qpsolvers",
        "placo", "pin-pink", "mink", "mujoco", "rapier3d", "matplotlib",
    )  # fmt: skip
    installed = {name: _version(name) for name in packages}
    return facts | {name: version for name, version in installed.items() if version}


def sentence(facts: Mapping[str, str]) -> str:
    """The facts in one sentence of Markdown, without the system and the versions of packages: CSV files have these."""
    kept = "wholebody", "date", "processor", "cores", "load", "OMP_NUM_THREADS"
    kept_facts = [f"{name} {value}" for name, value in facts.items() if name in kept]
    return f"Measured with {'; '.join(kept_facts)}."


def formatted(value: float, spec: str, unit: str = "", none: str = "") -> str:
    """A number by a format, with its unit, without exponents of large ones; `none` for one that is not finite."""
    if not isfinite(value):
        return none
    text = f"{value:{spec}}"
    return (f"{value:.0f}" if "e+" in text and spec.endswith("g") else text) + unit


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    make_folder(path.parent)
    write(path, text)


def write_rows(path: Path, facts: Mapping[str, str], rows: Sequence[Any]) -> None:
    """Write dataclass instances, one a line, an interval in three columns; the facts stand above as comments."""
    head = "".join(f"# {name}: {value}\n" for name, value in facts.items())
    write_text(path, head + csv_text(map(flat, rows)))


def flat(row: Any) -> dict[str, Any]:
    """The fields of a row by name, the ends of those that are intervals, and the entries of those that are mappings."""
    given = {field.name: getattr(row, field.name) for field in dataclasses.fields(row)}
    cells: dict[str, Any] = {}
    for field, value in given.items():
        for name, each in value.items() if isinstance(value, Mapping) else [(field, value)]:
            cells[name] = each
            if isinstance(each, Interval):
                cells |= {name: each.value, f"{name}_low": each.low, f"{name}_high": each.high}
    return cells


def programs_text(programs: Mapping[str, int]) -> str:
    """How many programs each solver closed, most first, such as "active set 7, osqp 1"; empty where there were none."""
    return ", ".join(f"{by} {count}" for by, count in sorted(programs.items(), key=lambda entry: (-entry[1], entry[0])))


def summed_programs(texts: Iterable[str]) -> str:
    """Several texts of `programs_text` as one."""
    total: Counter[str] = Counter()
    for text in filter(None, texts):
        for part in text.split(", "):
            by, _, count = part.rpartition(" ")
            total[by] += int(count)
    return programs_text(total)


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
