"""The QP solvers there are, by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from wholebody.base.checks import shown
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.methods.qp.active_set import compiled_kernel
from wholebody.methods.qp.solvers.base import QPSolver

PACKAGES: Mapping[str, str] = MappingProxyType(
    {"daqp": "daqp", "quadprog": "quadprog", "proxqp": "proxsuite", "piqp": "piqp"}
)
"""Packages of solvers that are known, whether they are installed or not."""


def solver_names() -> tuple[str, ...]:
    """Names that `make_solver` takes on this machine: "osqp", "active_set" and what is installed beside."""
    from qpsolvers import available_solvers

    return ("osqp", "active_set", *sorted(set(available_solvers) - {"osqp"}))


def make_solver(name: str, hot_start: bool = True) -> QPSolver:
    """A QP solver by name, for the programs of one run; all but the first two are those of qpsolvers."""
    compiled_kernel()  # not in the middle of a solve
    if not isinstance(name, str):
        raise InputError(f"solver is {shown(name)}; give the name of a QP solver, such as 'osqp'")
    if name == "osqp":
        from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver

        return OSQPSolver(hot_start)
    if name == "active_set":
        from wholebody.methods.qp.solvers.osqp_solver import ActiveSetSolver

        return ActiveSetSolver(hot_start)
    if name not in solver_names() and name in PACKAGES:
        package = PACKAGES[name]
        raise MissingPackageError(f"the QP solver {name} is not installed; install it with: pip install {package}")
    if name not in solver_names():
        raise UnknownNameError("QP solver", name, solver_names())
    from wholebody.methods.qp.solvers.qpsolvers_solver import QpsolversSolver

    return QpsolversSolver(name, hot_start)
