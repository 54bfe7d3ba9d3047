"""The reference has every public name."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import wholebody

WHOLE_MODULES = ("wholebody.geometry.shapes", "wholebody.base.errors")


def test_the_reference_has_every_public_name(root: Path) -> None:
    text = (root / "docs/reference.md").read_text(encoding="utf-8")
    paths = set(re.findall(r"^::: ([\w.]+)$", text, re.MULTILINE))
    named = {path.rpartition(".")[2] for path in paths}
    for module in WHOLE_MODULES:
        assert module in paths
        named |= set(vars(import_module(module)))
    rooms = {name for name in wholebody.__all__ if isinstance(getattr(wholebody, name), ModuleType)}
    assert set(wholebody.__all__) - {"__version__"} - rooms <= named
    lazy = {name for name in rooms if hasattr(getattr(wholebody, name), "__all__")}
    assert {"ergonomics", "motion"} <= lazy
    for room in lazy - {"figures", "methods"}:  # which export types and constants that few programs name
        assert set(getattr(wholebody, room).__all__) <= named, room
