"""A program in the split form that sparse and active-set solvers like: every residual is a variable of its own.

The objective is diagonal then, which spares a factorisation of x's dense Hessian: OSQP takes a third of the time and
DAQP two thirds. Solvers get it scaled (docs/theory/qp_programs.md): the program is the true one, and its heaviest rows
are nearly hard, since their residuals hardly count in them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.active_set import smallest
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Scaling, SparseForm, SplitForm

SCALING = Scaling()


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


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp.solvers import split_kernel

    program, _ = smallest()
    split_kernel.within(program.rows, np.zeros((0, 1), dtype=bool))
    two, places = np.ones(2), np.zeros(0, np.int64)
    split_kernel.fill_sparse(
        program, SCALING, SparseForm(two, two, np.ones(3), two, two, np.zeros(2, np.int64), places)
    )
    return split_kernel
