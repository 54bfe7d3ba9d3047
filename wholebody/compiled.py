"""Loops that numba compiles, where it is installed (the extra "fast")."""

from __future__ import annotations

import time
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

_compiling = {"depth": 0, "since": 0.0, "seconds": 0.0}


def compiled_module(name: str) -> Any:
    """Import a module of loops that numba compiles.

    Returns:
        The module, or None: without numba, and where numba finds no folder in which it may keep what it compiled.
    """
    if find_spec("numba") is None:
        return None
    _watch()
    try:
        return import_module(name)
    except RuntimeError:  # numba: cannot cache function, no locator available
        return None


def compile_seconds() -> float:
    """Processor time that compiling has taken so far, in whatever solve it happened; no solve is charged for it."""
    return _compiling["seconds"]


@lru_cache(maxsize=1)
def _watch() -> None:
    """Count what numba takes to compile."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            if _compiling["depth"] == 0:
                _compiling["since"] = time.thread_time()
            _compiling["depth"] += 1

        def on_end(self, event: Any) -> None:
            _compiling["depth"] -= 1
            if _compiling["depth"] == 0:
                _compiling["seconds"] += time.thread_time() - _compiling["since"]

    event.register("numba:compile", Listener())
