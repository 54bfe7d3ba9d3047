"""Write the tables of docs/theory/qp_constants.md anew: ``python docs/hooks/constants.py``.

Names and values come from the code. A heading of the section names the modules whose constants stand below it; modules
of the QP method that no heading names are added. What a constant trades is kept as the page has it; of a new one it is
the comment in the code.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/theory/qp_constants.md"
BEGIN, END = "## Constants\n", "\n## Sources\n"
HEADING = re.compile(r"^### .*?: (?P<modules>`wholebody.*)$")
ROW = re.compile(r"^\| `(?P<name>[A-Z_]+)` \| .*? \| (?P<text>.*) \|$")


def constants(module: str) -> dict[str, tuple[str, str]]:
    """Public literals of a module with names in capitals, in its order: name -> value as the code has it, comment."""
    source = ROOT.joinpath(*module.split(".")).with_suffix(".py").read_text(encoding="utf-8")
    lines, body = source.splitlines(), ast.parse(source).body
    found: dict[str, tuple[str, str]] = {}
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            continue
        comment = lines[(node.end_lineno or node.lineno) - 1].partition("  # ")[2]
        if not comment and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            comment = str(after.value.value)
        target = node.targets[0]
        several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
        names = target.elts if isinstance(target, ast.Tuple) and several else [target]
        values = node.value.elts if isinstance(node.value, ast.Tuple) and several else [node.value]
        for name, value in zip(names, values, strict=True):
            if isinstance(name, ast.Name) and re.fullmatch("[A-Z][A-Z_]*", name.id) and _is_number(value):
                text = " ".join((ast.get_source_segment(source, value) or "").split())
                found[name.id] = re.sub(r",? \)", ")", text).replace("( ", "("), " ".join(comment.split())
    return found


def _is_number(value: ast.expr) -> bool:
    """Whether an expression is made of numbers alone."""
    kinds = (ast.Tuple, ast.UnaryOp, ast.BinOp, ast.operator, ast.unaryop, ast.expr_context)
    return all(
        isinstance(node, kinds) or (isinstance(node, ast.Constant) and isinstance(node.value, int | float))
        for node in ast.walk(value)
    )


def refreshed(page: str) -> str:
    """The page with the tables as the code has them now."""
    head, _, rest = page.partition(BEGIN)
    section, _, tail = rest.partition(END)
    parts = re.split(r"^(?=### )", section, flags=re.MULTILINE)
    written, named = [parts[0]], set()
    for part in parts[1:]:
        heading = part.splitlines()[0]
        match = HEADING.match(heading)
        if match is None:
            raise SystemExit(f"{PAGE}: {heading!r} names no module; say '### Title: `wholebody.module`'")
        modules = [name for name in re.findall(r"`(.*?)`", match["modules"]) if _file(name).is_file()]
        texts = {row["name"]: row["text"] for row in map(ROW.match, part.splitlines()) if row}
        named.update(modules)
        title = heading.partition(": ")[0] + ": " + ", ".join(f"`{name}`" for name in modules)
        written += _table(title, modules, texts)
    for path in sorted((ROOT / "wholebody/methods/qp").rglob("*.py")):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        if module not in named:
            written += _table(f"### More: `{module}`", [module], {})
    return head + BEGIN + "".join(written).rstrip("\n") + "\n" + END + tail


def _table(title: str, modules: list[str], texts: dict[str, str]) -> list[str]:
    rows = {name: row for module in modules for name, row in constants(module).items()}
    if not rows:
        return []
    lines = [title, "", "| constant | value | what it trades |", "|---|---|---|"]
    lines += [f"| `{name}` | {value} | {texts.get(name, comment)} |" for name, (value, comment) in rows.items()]
    return ["\n".join(lines) + "\n\n"]


def _file(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


if __name__ == "__main__":
    PAGE.write_text(refreshed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
