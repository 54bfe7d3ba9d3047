"""Loops that numba compiles, where it is installed (the extra "fast")."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any


def compiled_module(name: str) -> Any:
    """Import a module of loops that numba compiles.

    Returns:
        The module, or None: without numba, and where numba finds no folder in which it may keep what it compiled.
    """
    if find_spec("numba") is None:
        return None
    try:
        return import_module(name)
    except RuntimeError:  # numba: cannot cache function, no locator available
        return None
