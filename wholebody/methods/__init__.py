"""The methods that find postures: one module or folder a method."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.methods.ccd.method import CCD
    from wholebody.methods.damped_least_squares import DampedLeastSquares
    from wholebody.methods.newton.assembly_solution import AssemblySolution
    from wholebody.methods.newton.method import Newton
    from wholebody.methods.newton.own_rows import AssemblyConstraint
    from wholebody.methods.placo.method import Placo
    from wholebody.methods.qp.method import QP

__all__ = [
    "CCD",
    "EXTRAS",
    "METHODS",
    "QP",
    "AssemblyConstraint",
    "AssemblySolution",
    "DampedLeastSquares",
    "Newton",
    "Placo",
    "installed_methods",
]

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


__getattr__, _ = exported(
    __name__,
    {
        "wholebody.methods.ccd.method": "CCD",
        "wholebody.methods.damped_least_squares": "DampedLeastSquares",
        "wholebody.methods.newton.own_rows": "AssemblyConstraint",
        "wholebody.methods.newton.assembly_solution": "AssemblySolution",
        "wholebody.methods.newton.method": "Newton",
        "wholebody.methods.placo.method": "Placo",
        "wholebody.methods.qp.method": "QP",
    },
)


def __dir__() -> list[str]:
    return sorted(__all__)
