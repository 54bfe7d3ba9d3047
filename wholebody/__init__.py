"""Pose whole bodies among things: people, avatars, hands and robots, in contact and never inside.

The public names are loaded when they are first used, so that ``import wholebody`` stays light::

    import wholebody as wb

    figure = wb.load("human")
    scene = wb.Scene(figure)
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.6, 0.0, 0.72))
    solution = wb.solve(wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.55, -0.25, 0.95))]))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from wholebody.errors import (
    FileFormatError,
    InputError,
    MissingPackageError,
    UnknownNameError,
    WholebodyError,
)
from wholebody.version import __version__

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure as Figure

_LAZY: dict[str, str] = {
    "Figure": "wholebody.figures.figure",
}

__all__ = [
    "FileFormatError",
    "InputError",
    "MissingPackageError",
    "UnknownNameError",
    "WholebodyError",
    "__version__",
    *_LAZY,
]


def __getattr__(name: str) -> object:
    """Load a public name on its first use (PEP 562)."""
    try:
        module = _LAZY[name]
    except KeyError:
        raise AttributeError(f"module 'wholebody' has no attribute {name!r}") from None
    value = getattr(import_module(module), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
