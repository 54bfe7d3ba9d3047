"""The page on the QP method names every constant of its code, with the value it has there."""

from __future__ import annotations

import re
from ast import literal_eval
from importlib import import_module
from pathlib import Path

HEADING = re.compile(r"^### .*: (.*)$")
ROW = re.compile(r"^\| `([A-Z_]+)` \| (.*?) \|")


def tables(root: Path) -> list[tuple[tuple[str, ...], dict[str, str]]]:
    """Modules named by each heading, and the constants with their values below it."""
    found: list[tuple[tuple[str, ...], dict[str, str]]] = []
    for line in (root / "docs/theory/qp.md").read_text(encoding="utf-8").split("## Constants")[1].splitlines():
        if heading := HEADING.match(line):
            found.append((tuple(re.findall(r"`(.*?)`", heading[1])), {}))
        elif row := ROW.match(line):
            found[-1][1][row[1]] = row[2]
    return found


def constants(module: str) -> dict[str, object]:
    """Numbers with a name in capitals that a module makes itself."""
    made = import_module(module)
    source = Path(str(made.__file__)).read_text(encoding="utf-8")
    assigned = {name for line in re.findall(r"^([A-Z][A-Z_, ]*) = ", source, re.MULTILINE) for name in line.split(", ")}
    return {name: getattr(made, name) for name in assigned}


def test_the_page_has_every_constant_and_its_value(root: Path) -> None:
    named = tables(root)
    assert len(named) > 5
    for modules, rows in named:
        known: dict[str, object] = {}
        for module in modules:
            known.update(constants(module))
        values = {name: literal_eval(text) for name, text in rows.items()}
        assert values == known, f"docs/theory/qp.md differs from {' and '.join(modules)}; mend the table"


def test_the_page_has_every_module_of_the_method(root: Path) -> None:
    named = {module for modules, _ in tables(root) for module in modules}
    for path in (root / "wholebody/methods/qp").rglob("*.py"):
        module = ".".join(path.relative_to(root).with_suffix("").parts)
        if not module.endswith("__init__") and constants(module):
            assert module in named, f"docs/theory/qp.md has no table of {module}"
