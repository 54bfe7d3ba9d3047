"""quadprog: the dual active-set method of Goldfarb and Idnani 1983; it has no workspace to keep."""

from __future__ import annotations

import numpy as np
import quadprog

from wholebody.methods.qp.solvers.native_solver import Native, NativeSolver
from wholebody.methods.qp.solvers.split_form import SplitForm


class QuadprogSolver(NativeSolver):
    """quadprog, which solves every program from the beginning."""

    name = "quadprog"

    def minimise(self, form: SplitForm, n: int, m: int) -> Native:
        """See `NativeSolver.minimise`."""
        size = len(form.linear)
        box = np.eye(n, size)
        rows = np.vstack([form.matrix, box, -box])
        least = np.concatenate([form.lower, form.box_lower[:n], -form.box_upper[:n]])
        inverse = np.diag(1.0 / np.sqrt(form.diagonal))
        try:
            z, _, _, iterations, multiplier, _ = quadprog.solve_qp(inverse, -form.linear, rows.T, least, m, True)
        except ValueError:  # it takes rounding for a contradiction; programs have none
            return Native(np.zeros(size), np.zeros(n), np.zeros(len(form.lower) - m), 1)
        at_lower, at_upper = multiplier[-2 * n : -n], multiplier[-n:]
        return Native(z, at_upper - at_lower, multiplier[m : -2 * n], max(int(iterations[0]), 1))
