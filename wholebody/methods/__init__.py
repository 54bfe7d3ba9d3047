"""The methods that find postures: one module or folder a method."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from types import MappingProxyType

from wholebody.base.imports import exported

METHODS: Mapping[str, str] = MappingProxyType(
    {"qp": "QP", "ccd": "CCD", "newton": "Newton", "placo": "Placo", "dls": "DampedLeastSquares"}
)
"""Names of all methods, the same in Python, in task files and on the command line -> their classes here."""

EXTRAS = {"placo": "placo"}
"""Methods whose package an extra installs -> the package; the extra has the same name."""


def installed_methods() -> tuple[str, ...]:
    """Names of the methods that can be used here: all except those whose package is not installed.

    Examples:
        >>> wb.methods.installed_methods()[0]
        'qp'
    """
    return tuple(name for name in METHODS if name not in EXTRAS or find_spec(EXTRAS[name]) is not None)


__getattr__, _, _lazy = exported(__name__, __file__)
__all__ = ["EXTRAS", "METHODS", *_lazy, "installed_methods"]


def __dir__() -> list[str]:
    return sorted(__all__)
