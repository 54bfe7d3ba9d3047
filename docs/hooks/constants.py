"""Write the tables of settings of docs/theory/qp.md anew: ``python docs/hooks/constants.py``.

Names, values and what each trades come from the records of `wholebody.methods.qp.settings`.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/theory/qp.md"
SOURCE = ROOT / "wholebody/methods/qp/settings.py"
BEGIN, END = "## Constants\n", "\n## Sources\n"
HEAD = "\n`python docs/hooks/constants.py` writes names, values and texts from `wholebody.methods.qp.settings`.\n"


def table(record: ast.ClassDef, source: str) -> str:
    """One record as a table of Markdown, under its title."""
    title, _, attributes = (ast.get_docstring(record) or "").partition("\n\nAttributes:\n")
    texts: dict[str, str] = {}
    for part in re.split(r"\n(?=    \S)", "\n" + attributes)[1:]:
        names, _, text = " ".join(part.split()).partition(": ")
        texts |= dict.fromkeys(names.split(", "), text)
    lines = ["", f"### {title.rstrip('.')}", "", "| setting | value | what it trades |", "|---|---|---|"]
    for node in record.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            name = node.target.id
            lines.append(f"| `{name}` | {ast.get_source_segment(source, node.value)} | {texts[name]} |")
    return "\n".join(lines) + "\n"


def refreshed(page: str) -> str:
    """The page with the tables as the code has them now."""
    head, _, rest = page.partition(BEGIN)
    tail = rest.partition(END)[2]
    source = SOURCE.read_text(encoding="utf-8")
    tables = [table(node, source) for node in ast.parse(source).body if isinstance(node, ast.ClassDef)]
    return head + BEGIN + HEAD + "".join(tables) + END + tail


if __name__ == "__main__":
    PAGE.write_text(refreshed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
