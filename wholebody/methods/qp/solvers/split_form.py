"""A program in the split form that sparse and active-set solvers like: every residual is a variable of its own.

With z = [x, r, s] the objective is diagonal, which spares a factorisation of x's dense Hessian: measured, OSQP takes a
third of the time and DAQP two thirds.

    minimise  1/2 z' diag(D, w, v) z + [g, 0, 0]' z
    subject to  lower <= x <= upper,    T x - r = e,    C x + s >= l

Solvers get it scaled: z = [a x, R r, S s], rows times the roots of their weights as far as those of `HEAVIEST`. The
objective of the residuals is then 1, and the rest of a weight is in their coefficients. The program is the true
one, however heavy its rows: the heaviest are nearly hard, since their residuals hardly count in them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.active_set import smallest
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram, Scaling, SparseForm, SplitForm

SLOTS = 8  # elastic rows come in multiples of this, so that sizes seldom change; more slots = slower iterations


SCALING = Scaling()


def split(program: QuadraticProgram) -> SplitForm:
    """The split form of a program."""
    n, m, k = program.size, len(program.target), len(program.least)
    matrix = np.zeros((m + k, n + m + k))
    matrix[:m, :n] = program.rows
    matrix[m:, :n] = program.elastic
    matrix[:m, n : n + m].flat[:: m + 1] = -1.0
    matrix[m:, n + m :].flat[:: k + 1] = 1.0
    free = np.full(m + k, np.inf)
    return SplitForm(
        np.concatenate([program.diagonal, program.weight, program.elastic_weight]),
        np.concatenate([program.linear, np.zeros(m + k)]),
        matrix,
        np.concatenate([program.target, program.least]),
        np.concatenate([program.target, np.full(k, np.inf)]),
        np.concatenate([program.lower, -free]),
        np.concatenate([program.upper, free]),
    )


def scaled_split(program: QuadraticProgram, form: SplitForm) -> SplitForm:
    """The scaled split form of a program.

    Args:
        program: with at most as many elastic rows as the form has slots.
        form: of `empty_form`, or of a program before; its arrays are written over.

    Returns:
        The same form.
    """
    compiled_kernel().fill(program.packed(), SCALING, form)
    return form


def empty_form(n: int, m: int, slots: int) -> SplitForm:
    """Room for the scaled split forms of programs of n variables, m soft rows and at most so many elastic ones."""
    size = n + m + slots
    box = np.full(size, np.inf)
    return SplitForm(
        np.ones(size), np.zeros(size), np.zeros((m + slots, size)), np.full(m + slots, SCALING.inactive),
        np.full(m + slots, np.inf), -box, box,
    )  # fmt: skip


def slots_for(program: QuadraticProgram, before: int) -> int:
    """Elastic rows of a workspace for a program, at least as many as there were before."""
    return max(before, SLOTS * -(-max(len(program.least), 1) // SLOTS))


def read_active(box: Array, push: Array) -> ActiveSet:
    """The active set that multipliers tell.

    Args:
        box: (n,) of the box; positive where an upper bound holds, negative where a lower one does.
        push: (k,) of the elastic rows, positive where they push.
    """
    return ActiveSet(box < -1e-9, box > 1e-9, push > 1e-9)


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp.solvers import split_kernel

    program, _ = smallest()
    split_kernel.within(program.rows, np.zeros((0, 1), dtype=bool))
    split_kernel.fill(program, SCALING, empty_form(1, 0, 1))
    two, places = np.ones(2), np.zeros(0, np.int64)
    split_kernel.fill_sparse(
        program, SCALING, SparseForm(two, two, np.ones(3), two, two, np.zeros(2, np.int64), places)
    )
    return split_kernel
