"""quadprog: the dual active-set method of Goldfarb and Idnani 1983; it has no workspace to keep.

The method puts one equality after the other into its active set. So the soft rows go into the Hessian here,

    minimise  1/2 x' (D + T' W T) x + (g - T' W e)' x + 1/2 s' V s,    C x + s >= l,    lower <= x <= upper

of which the method needs the inverse of a factor only. That is taken from the QR factorisation of the weighted rows:
the Hessian itself would lose half of the digits. It is scaled as the split form is: quadprog takes short directions for
none, and what they could do for a contradiction.
"""

from __future__ import annotations

import numpy as np
import quadprog
from scipy.linalg.lapack import dgeqrf, dtrtri

from wholebody.base.arrays import Array
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.methods.qp.solvers.native_solver import NativeAnswer, NativeSolver
from wholebody.methods.qp.solvers.split_form import SCALING


class QuadprogSolver(NativeSolver):
    """quadprog, which solves every program from the beginning."""

    name = "quadprog"

    def minimise(self, program: QuadraticProgram, slots: int) -> NativeAnswer:
        """See `NativeSolver.minimise`."""
        n, k = program.size, len(program.least)
        if self._workspace is None:
            self._workspace = _buffers(n, slots)
        factor, rows = (part[: n + k] for part in self._workspace)
        factor[:n, :n] = SCALING.x * inverse_factor(program)
        root, residuals = np.sqrt(np.minimum(program.elastic_weight, SCALING.heaviest)), np.arange(k)
        rows[:n, 2 * n : 2 * n + k] = program.elastic.T * (root / SCALING.x)
        rows[n + residuals, 2 * n + residuals] = root / np.sqrt(program.elastic_weight)
        linear = np.zeros(n + k)
        linear[:n] = ((program.weight * program.target) @ program.rows - program.linear) / SCALING.x
        least = np.concatenate([SCALING.x * program.lower, -SCALING.x * program.upper, root * program.least])
        try:
            z, _, _, iterations, multiplier, _ = quadprog.solve_qp(
                factor[:, : n + k], linear, rows[:, : 2 * n + k], least, 0, True
            )
        except ValueError:  # it takes rounding for a contradiction; programs have none
            return NativeAnswer(np.zeros(n), np.zeros(n), np.zeros(k), 1)
        box = multiplier[n : 2 * n] - multiplier[:n]
        return NativeAnswer(z[:n] / SCALING.x, box, multiplier[2 * n :], max(int(iterations[0]), 1))


def inverse_factor(program: QuadraticProgram) -> Array:
    """Upper triangular J (n, n) with J J' the inverse of D + T' W T.

    The rows stand in the order of their weights, for which Householder's QR is stable row by row (Cox and Higham 1998).
    """
    heavy = np.argsort(-program.weight, kind="stable")
    m, n = program.rows.shape
    table = np.zeros((m + n, n), order="F")
    table[:m] = program.rows[heavy] * np.sqrt(program.weight[heavy])[:, None]
    table[m + np.arange(n), np.arange(n)] = np.sqrt(program.diagonal)
    factored, *_ = dgeqrf(table, overwrite_a=True)
    inverse, _ = dtrtri(factored[:n])
    result: Array = np.triu(inverse)
    return result


def _buffers(n: int, slots: int) -> tuple[Array, Array]:
    """The factor's inverse and the columns of the inequalities for x and so many residuals, but for what changes."""
    variables, columns = np.arange(n), np.zeros((n + slots, 2 * n + slots))
    columns[variables, variables], columns[variables, n + variables] = 1.0, -1.0
    return np.eye(n + slots), columns
