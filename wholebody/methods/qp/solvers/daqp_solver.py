"""DAQP (Arnstroem, Bemporad and Axehill 2022): a dual active-set solver, exact by itself and fast at this size."""

from __future__ import annotations

from ctypes import c_int

import daqp
import numpy as np

from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.fallback import finish, last_resort
from wholebody.methods.qp.solvers.split_form import split

FAR = 1e30  # DAQP's infinity
HEAVIEST = (
    1e5,
    1e10,
)  # weights are cut to this: milder programs are faster, and mostly enough for `finish`
LIMIT = 500  # iterations
TOLERANCE = 1e-9  # of rows, m
EQUALITY = 5  # DAQP's mark for a row that is always active


class DAQPSolver(QPSolver):
    """DAQP on the split form; its active set is then finished with the true weights."""

    name = "daqp"

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Minimise with mild weights, and where that does not lead to the exact answer, with the true ones."""
        n, m, k = program.size, len(program.target), len(program.least)
        iterations = 0
        x = np.zeros(n)
        for heaviest in HEAVIEST:
            form = split(program, heaviest)
            upper = np.concatenate([program.upper, np.minimum(form.upper, FAR)])
            lower = np.concatenate([program.lower, form.lower])
            sense = np.zeros(n + m + k, dtype=c_int)
            sense[n : n + m] = EQUALITY
            x, _, _, info = daqp.solve(
                np.diag(form.diagonal),
                form.linear,
                form.matrix,
                upper,
                lower,
                sense,
                primal_tol=TOLERANCE,
                iter_limit=LIMIT,
            )
            x = np.where(np.isfinite(x[:n]), x[:n], 0.0)
            iterations += int(info["iterations"])
            solution = finish(program, x, iterations, self.name)
            if solution is not None:
                return solution
        return last_resort(program, x, iterations)
