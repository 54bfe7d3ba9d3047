"""Reports of benches and audits as parts of the documentation: the text, its charts, and a section between markers."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from wholebody.base.files import make_folder
from wholebody.bench.tables import write_text

LOCK = "lock.json"  # beside the report of a comparison


def put(report: Path, docs: Path, name: str = "") -> Path:
    """Put NAME.md, or what is called `name`, into a folder of documentation: the page with its section, or the text.

    The text becomes ``assets/bench/NAME.txt``, with its charts beside it. A page with ``<!-- bench:NAME -->`` gets
    charts (of a comparison those of all sets), the first table and what measured it until ``<!-- /bench:NAME -->``.
    """
    name, text, assets = name or report.stem, report.read_text("utf-8").strip(), docs / "assets" / "bench"
    make_folder(assets)
    pictures = []
    for caption, file in re.findall(r"!\[(.*?)\]\((.*?\.svg)\)", text):
        copied = Path(file).name.replace(f"{report.stem}-", f"{name}-", 1)
        shutil.copyfile(report.parent / file, assets / copied)
        text = text.replace(f"({file})", f"({copied})")
        pictures.append(f"![{caption}](assets/bench/{copied})")
    if (report.parent / LOCK).is_file():
        shutil.copyfile(report.parent / LOCK, assets / f"{name}-{LOCK}")
    write_text(assets / f"{name}.txt", text + "\n")
    first, last = f"<!-- bench:{name} -->", f"<!-- /bench:{name} -->"
    page = next((page for page in sorted(docs.glob("*.md")) if first in page.read_text("utf-8")), None)
    if page is None:
        return assets / f"{name}.txt"
    table = re.search(r"^\|.*(?:\n\|.*)*", text, re.MULTILINE)
    measured = re.search(r"^Measured (?:with|on) .*", text, re.MULTILINE)
    shown = [picture for picture in pictures if "overview" in picture] or pictures
    parts = [*shown, *(found[0] for found in (table, measured) if found)]
    part = "\n\n".join(parts) + f" [Everything measured](assets/bench/{name}.txt)."
    head, rest = page.read_text("utf-8").split(first, 1)
    write_text(page, f"{head}{first}\n\n{part}\n\n{last}{rest.split(last, 1)[1]}")
    return page
