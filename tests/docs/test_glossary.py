"""The glossary names modules and objects that exist."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

NAME = re.compile(r"`(wholebody(?:\.\w+)+)`")


def test_every_name_of_the_glossary_is_there(root: Path) -> None:
    names = NAME.findall((root / "docs/reference.md").read_text(encoding="utf-8"))
    assert len(names) > 40
    for name in names:
        home, _, last = name.rpartition(".")
        try:
            import_module(name)
        except ModuleNotFoundError:
            assert hasattr(import_module(home), last), name
