"""The QP solvers there are, by name."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType

from wholebody.base.checks import shown
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.methods.qp.active_set import compiled_kernel
from wholebody.methods.qp.solvers.base import QPSolver

NATIVE: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "daqp": ("daqp", "DAQPSolver"),
        "quadprog": ("quadprog", "QuadprogSolver"),
        "proxqp": ("proxsuite", "ProxQPSolver"),
        "piqp": ("piqp", "PIQPSolver"),
    }
)
"""Solvers that are asked by their own interfaces: name -> module that it needs, class of ours."""


def solver_names() -> tuple[str, ...]:
    """Names that `make_solver` takes on this machine: "osqp", "active_set" and what is installed beside."""
    names = ["osqp", "active_set"]
    names += [name for name, (module, _) in NATIVE.items() if find_spec(module) is not None]
    if find_spec("qpsolvers") is not None:
        from qpsolvers import available_solvers

        names += sorted(set(available_solvers) - set(names))
    return tuple(names)


def make_solver(name: str, hot_start: bool = True) -> QPSolver:
    """A QP solver by name, for the programs of one run.

    Args:
        name: one of `solver_names`.
        hot_start: see `QPSolver`.

    Raises:
        InputError: not a text.
        UnknownNameError: no installed solver has this name.
        MissingPackageError: it exists but its package is not installed.
    """
    compiled_kernel()  # not in the middle of a solve
    if not isinstance(name, str):
        raise InputError(f"solver is {shown(name)}; give the name of a QP solver, such as 'osqp'")
    if name == "osqp":
        from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver

        return OSQPSolver(hot_start)
    if name == "active_set":
        from wholebody.methods.qp.solvers.osqp_solver import ActiveSetSolver

        return ActiveSetSolver(hot_start)
    if name in NATIVE:
        module, kind = NATIVE[name]
        if find_spec(module) is None:
            raise MissingPackageError(f"the QP solver {name} is not installed; install it with: pip install {module}")
        solver: QPSolver = getattr(import_module(f"{__package__}.{name}_solver"), kind)(hot_start)
        return solver
    if name not in solver_names():
        raise UnknownNameError("QP solver", name, solver_names())
    from wholebody.methods.qp.solvers.qpsolvers_solver import QpsolversSolver

    return QpsolversSolver(name, hot_start)
