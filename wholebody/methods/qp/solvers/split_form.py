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

from typing import NamedTuple

import numpy as np

from wholebody.arrays import Array
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram

SCALE = 100.0  # x is in hundredths of a radian inside solvers, so that its entries are as large as the residuals
HEAVIEST = 1e5  # of a row's scale, squared: larger = heavy rows closer, light ones later
SLOTS = 8  # elastic rows come in multiples of this, so that sizes seldom change; more slots = slower iterations
IDLE = -1e3  # least value of slots without a row: never active, and no other kind of row than those in use
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


def scaled_split(program: QuadraticProgram, slots: int) -> SplitForm:
    """The scaled split form of a program, with idle rows until it has `slots` elastic ones."""
    n, m, k = program.size, len(program.target), len(program.least)
    root = np.sqrt(np.minimum(program.weight, HEAVIEST))
    elastic_root = np.sqrt(np.minimum(program.elastic_weight, HEAVIEST))
    size = n + m + slots
    matrix = np.zeros((m + slots, size))
    matrix[:m, :n] = program.rows * (root / SCALE)[:, None]
    matrix[m : m + k, :n] = program.elastic * (elastic_root / SCALE)[:, None]
    matrix[np.arange(m), n + np.arange(m)] = -root / np.sqrt(program.weight)
    matrix[m + np.arange(slots), n + m + np.arange(slots)] = 1.0
    matrix[m + np.arange(k), n + m + np.arange(k)] = elastic_root / np.sqrt(program.elastic_weight)
    linear, diagonal = np.zeros(size), np.ones(size)
    linear[:n], diagonal[:n] = program.linear / SCALE, program.diagonal / SCALE**2
    lower, upper = np.full(m + slots, IDLE), np.full(m + slots, np.inf)
    lower[:m] = upper[:m] = root * program.target
    lower[m : m + k] = elastic_root * program.least
    box_lower, box_upper = np.full(size, -np.inf), np.full(size, np.inf)
    box_lower[:n], box_upper[:n] = SCALE * program.lower, SCALE * program.upper
    return SplitForm(diagonal, linear, matrix, lower, upper, box_lower, box_upper)


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
