"""A program in the split form that sparse and active-set solvers like: every residual is a variable of its own.

The objective is diagonal then, which spares a factorisation of x's dense Hessian: OSQP takes a third of the time and
DAQP two thirds. Solvers get it scaled (docs/theory/qp_programs.md): the program is the true one, and its heaviest rows
are nearly hard, since their residuals hardly count in them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram


class Scaling(NamedTuple):
    """How solvers get a program."""

    x: float = 100.0  # what it is multiplied by, so that its entries are as large as the residuals
    heaviest: float = 1e5  # scale of a row at most, squared; larger = heavy rows closer, light ones later
    # least value of slots without a row: never active, and no other kind of row than those in use
    inactive: float = -1e3
    infinite: float = 1e30  # what a solver takes for infinite


SCALING = Scaling()


class SplitForm(NamedTuple):
    """Objective and rows over z of size n + m + k."""

    diagonal: Array  # (n + m + k,) diagonal Hessian
    linear: Array  # (n + m + k,)
    matrix: Array  # (m + k, n + m + k) rows [T -I 0; C 0 I]
    least: Array  # (m + k,) what the first m rows are, and the others are at least
    box: Array  # (2, n) bounds of x; r and s have none


def scaled_split(program: QuadraticProgram) -> SplitForm:
    """The scaled split form of a program."""
    soft, scale = len(program.target), SCALING.x
    weight = np.concatenate([program.weight, program.elastic_weight])
    root, size = np.sqrt(np.minimum(weight, SCALING.heaviest)), len(weight)
    matrix = np.zeros((size, program.size + size))
    matrix[:, : program.size] = np.vstack([program.rows, program.elastic]) * (root / scale)[:, None]
    matrix[:, program.size :] = np.diag(np.where(np.arange(size) < soft, -root, root) / np.sqrt(weight))
    return SplitForm(
        np.concatenate([program.diagonal / scale**2, np.ones(size)]),
        np.concatenate([program.linear / scale, np.zeros(size)]),
        matrix,
        root * np.concatenate([program.target, program.least]),
        scale * np.array([program.lower, program.upper]),
    )


def read_active(box: Array, push: Array) -> ActiveSet:
    """The active set of multipliers `box` (n,), positive at an upper bound, and `push` (k,) of the elastic rows."""
    return ActiveSet(box < -1e-9, box > 1e-9, push > 1e-9)
