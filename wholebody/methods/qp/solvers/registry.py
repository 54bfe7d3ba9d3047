"""The QP solvers there are, by name, and those of qpsolvers."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import shown
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.methods.qp.active_set import compiled_kernel, last_resort, solve_from, violated_set
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import CORRECTIONS
from wholebody.methods.qp.solvers.base import ACTIVE_SET, SCALING, QPSolver, read_active, scaled_split

PACKAGES: Mapping[str, str] = MappingProxyType(
    {"daqp": "daqp", "quadprog": "quadprog", "proxqp": "proxsuite", "piqp": "piqp"}
)
"""Packages of solvers that are known, whether they are installed or not."""


FAR = 1e20  # what all solvers take for infinite
PATIENCE = 120  # corrections of a set that nothing is known of, before OSQP is asked


def solver_names() -> tuple[str, ...]:
    """Names that `make_solver` takes on this machine: "osqp", "active_set" and what is installed beside."""
    from qpsolvers import available_solvers

    return ("osqp", "active_set", *sorted(set(available_solvers) - {"osqp"}))


def make_solver(name: str) -> QPSolver:
    """A QP solver by name, for the programs of one run; all but "active_set" are those of qpsolvers."""
    compiled_kernel()  # not in the middle of a solve
    if not isinstance(name, str):
        raise InputError(f"solver is {shown(name)}; give the name of a QP solver, such as 'osqp'")
    if name == "active_set":
        return ActiveSetSolver()
    if name not in solver_names() and name in PACKAGES:
        package = PACKAGES[name]
        raise MissingPackageError(f"the QP solver {name} is not installed; install it with: pip install {package}")
    if name not in solver_names():
        raise UnknownNameError("QP solver", name, solver_names())
    return QpsolversSolver(name)


class QpsolversSolver(QPSolver):
    """A solver of qpsolvers on the scaled split form; set up at every call, since qpsolvers keeps no workspace.

    The active set that its multipliers tell is corrected, so the answers are exact.
    """

    def __init__(self, name: str) -> None:
        """Take a name that `qpsolvers.available_solvers` lists."""
        super().__init__()
        self.name = name

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise; see `QPSolver.solve_cold`."""
        n, k = program.size, len(program.least)
        x, multiplier, room = self._asked(program)
        self.uncorrected = x
        # an interior point keeps all multipliers above zero; those of active rows exceed the room that is left
        push, upper, lower = np.split(np.where(multiplier > np.maximum(room, 0.0), multiplier, 0.0), [k, k + n])
        solution = solve_from(program, read_active(upper - lower, push), CORRECTIONS.most)
        return last_resort(program, x, 1) if solution is None else with_values(solution, iterations=1, by=self.name)

    def _asked(self, program: QuadraticProgram) -> tuple[Array, Array, Array]:
        """What the solver answers: x (n,), and multipliers and room of the inequalities (k + 2 n,); else zeros."""
        from qpsolvers import Problem, dense_solvers, solve_problem
        from scipy import sparse

        n, m = program.size, len(program.target)
        form, box = scaled_split(program), np.eye(n, n + m + len(program.least))
        above = np.concatenate([-form.matrix[m:], box, -box])
        most = np.concatenate([-form.least[m:], form.box[1], -form.box[0]]).clip(-FAR, FAR)
        parts = np.diag(form.diagonal), above, form.matrix[:m]
        hessian, rows, equal = parts if self.name in dense_solvers else map(sparse.csc_matrix, parts)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = solve_problem(
                    Problem(hessian, form.linear, rows, most, equal if m else None, form.least[:m] if m else None),
                    solver=self.name,
                )
            except Exception:  # each solver has its own exceptions; all programs here are feasible
                found = None
        if found is None or found.x is None or not np.isfinite(found.x).all():
            return np.zeros(n), np.zeros(len(most)), np.zeros(len(most))
        multiplier = np.zeros(len(most)) if found.z is None else np.asarray(found.z)
        return found.x[:n] / SCALING.x, multiplier, most - above @ found.x


class ActiveSetSolver(QPSolver):
    """The primal-dual active set method throughout; OSQP where the sets do not settle."""

    name = "active_set"
    hot_start = True

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise from no bounds and the rows that x = 0 does not meet; see `QPSolver.solve_cold`."""
        solution = solve_from(program, violated_set(program), PATIENCE)
        if solution is None:
            return QpsolversSolver("osqp").solve_cold(program)
        return with_values(solution, by=ACTIVE_SET)
