"""The example scripts, imported as they are run: with their own folder on the path."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

Example = Callable[[str], ModuleType]


@pytest.fixture
def example(root: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Example]:
    """Yield what imports an example by name."""
    folder = root / "examples"
    monkeypatch.syspath_prepend(folder)

    def load(name: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(f"example_{name}", folder / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, spec.name, module)  # dataclasses look their module up
        spec.loader.exec_module(module)
        return module

    yield load
    sys.modules.pop("presenting", None)
