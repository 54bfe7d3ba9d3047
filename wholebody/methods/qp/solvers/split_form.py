"""A program in the split form that sparse and active-set solvers like: every residual is a variable of its own.

With z = [x, r, s] the objective is diagonal, which spares a factorisation of x's dense Hessian: measured, OSQP takes a
third of the time and DAQP two thirds.

    minimise  1/2 z' diag(D, w, v) z + [g, 0, 0]' z
    subject to  lower <= x <= upper,    T x - r = e,    C x + s >= l

Solvers get it scaled: z = [a x, R r, S s], rows times the roots of their weights as far as those of `HEAVIEST`. The
objective of the residuals is then 1, and what is left of a weight is in their coefficients. The program is the true
one, however heavy its rows: the heaviest are nearly hard, since their residuals hardly count in them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram

SCALE = 100.0  # x is in hundredths of a radian inside solvers, so that its entries are as large as the residuals
HEAVIEST = 1e5  # of a row's scale, squared: larger = heavy rows closer, light ones later
SLOTS = 8  # elastic rows come in multiples of this, so that sizes seldom change; more slots = slower iterations
INACTIVE = -1e3  # least value of slots without a row: never active, and no other kind of row than those in use
PUSHING = 1e-9  # multiplier above which a bound or a row counts as active


class SplitForm(NamedTuple):
    """Objective and rows over z of size n + m + k.

    Attributes:
        diagonal: (n + m + k,) diagonal Hessian.
        linear: (n + m + k,).
        matrix: (m + k, n + m + k) rows [T -I 0; C 0 I], dense.
        lower, upper: (m + k,) bounds of the rows.
        box_lower, box_upper: (n + m + k,) bounds of z; infinite for r and s.
    """

    diagonal: Array
    linear: Array
    matrix: Array
    lower: Array
    upper: Array
    box_lower: Array
    box_upper: Array


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
    parts = (
        program.diagonal, program.linear, program.rows, program.target, program.weight, program.elastic, program.least,
        program.elastic_weight, program.lower, program.upper,
    )  # fmt: skip
    compiled_kernel().fill(*map(np.ascontiguousarray, parts), SCALE, HEAVIEST, INACTIVE, *form)
    return form


def empty_form(n: int, m: int, slots: int) -> SplitForm:
    """Room for the scaled split forms of programs of n variables, m soft rows and at most so many elastic ones."""
    size = n + m + slots
    box = np.full(size, np.inf)
    return SplitForm(
        np.ones(size), np.zeros(size), np.zeros((m + slots, size)), np.full(m + slots, INACTIVE),
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
    return ActiveSet(box < -PUSHING, box > PUSHING, push > PUSHING)


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp.solvers import split_kernel

    none, one, row = np.zeros(0), np.ones(1), np.zeros((0, 1))
    split_kernel.fill(
        one, one, row, none, none, row, none, none, one, one, SCALE, HEAVIEST, INACTIVE, *empty_form(1, 0, 1)
    )
    return split_kernel
