"""Whatever solver qpsolvers offers, by its name."""

from __future__ import annotations

import warnings

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.qp.active_set import guess_active_set, last_resort, solve_from
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import CORRECTIONS
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.split_form import split

GUESS_TOLERANCE = 1e-4  # rad, m: an approximate answer this near to its bound counts as on it


class QpsolversSolver(QPSolver):
    """A solver of qpsolvers on the split form; rebuilt at every call, since qpsolvers keeps no workspace."""

    def __init__(self, name: str, hot_start: bool = True) -> None:
        """Take a name that `qpsolvers.available_solvers` lists."""
        super().__init__(hot_start)
        from qpsolvers import sparse_solvers

        self.name = name
        self._sparse = name in sparse_solvers
        self._uncorrected: Array | None = None

    def uncorrected(self) -> Array | None:
        """See `QPSolver.uncorrected`."""
        return self._uncorrected

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise; see `QPSolver.solve_cold`."""
        from qpsolvers import Problem, solve_problem
        from scipy import sparse

        n, m = program.size, len(program.target)
        form = split(program)
        hessian, matrix = np.diag(form.diagonal), form.matrix
        if self._sparse:
            hessian, matrix = sparse.csc_matrix(hessian), sparse.csc_matrix(matrix)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = solve_problem(
                Problem(
                    hessian, form.linear, -matrix[m:], -form.lower[m:], matrix[:m], form.lower[:m],
                    form.box_lower, form.box_upper,
                ),
                solver=self.name,
            )  # fmt: skip
        x = np.zeros(n) if answer.x is None else np.where(np.isfinite(answer.x[:n]), answer.x[:n], 0.0)
        self._uncorrected = x
        solution = solve_from(program, guess_active_set(program, x, GUESS_TOLERANCE), CORRECTIONS.of_guess)
        return last_resort(program, x, 1) if solution is None else with_values(solution, iterations=1, by=self.name)
