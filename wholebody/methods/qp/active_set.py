"""From a guess of the active set to the exact answer of a quadratic program.

With the active set fixed the program is a linear system. Eliminating x leaves one symmetric positive definite system in
the multipliers y of the soft and active elastic rows A (Schur complement of the diagonal),

    (A_F D_F^-1 A_F' + W^-1) y = A x_fixed-part - A_F D_F^-1 g_F - b,        x_F = -D_F^-1 (g_F + A_F' y),

of a few dozen unknowns: about 30 us. Weights enter as their inverse, so large ones cost no accuracy. With more rows
than variables, and where rows repeat each other to rounding, the system in x is the better one: the least squares
problem of the weighted rows, by QR. The set is then corrected where signs are wrong (the primal-dual active set method,
Hintermueller, Ito and Kunisch 2002), which ends after a few corrections when the guess was near. First-order solvers
such as OSQP thereby end in answers exact to rounding.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram

BOUND_TOLERANCE = 1e-11  # rad, m: an x this far outside its box counts as inside
ROW_TOLERANCE = 1e-11  # m: likewise for elastic rows
FULL_CORRECTIONS = 8  # corrections of everything at once, before only the worst entry is corrected at a time


def guess_active_set(program: QuadraticProgram, x: Array, tolerance: float) -> ActiveSet:
    """Active set read off an approximate minimiser x, shape (n,): what is within `tolerance` of its bound."""
    gradient = program.gradient(x)
    lower = (x <= program.lower + tolerance) & (gradient >= 0.0)
    upper = (x >= program.upper - tolerance) & (gradient <= 0.0) & ~lower
    return ActiveSet(lower, upper, program.elastic @ x <= program.least + tolerance)


def violated_set(program: QuadraticProgram) -> ActiveSet:
    """Active set to begin from where nothing is known: no bounds, and the elastic rows that x = 0 does not meet."""
    free = np.zeros(program.size, dtype=bool)
    return ActiveSet(free, free.copy(), program.least > 0.0)


def solve_from(program: QuadraticProgram, guess: ActiveSet, corrections: int) -> QPSolution | None:
    """Exact answer by correcting a guess of the active set.

    The first few corrections put right everything that is wrong. That may go round in circles; then only the worst
    entry is put right at a time, which is slower and surer.

    Args:
        program: what to solve.
        guess: where to begin.
        corrections: how many sets to try at the most.

    Returns:
        The answer, or None when the sets did not settle.

    Raises:
        ValueError: the sizes of the program or of the guess do not fit together.
    """
    program.check_shapes(guess)
    x = np.empty(program.size)
    active = ActiveSet(guess.lower.copy(), guess.upper.copy(), guess.elastic.copy())
    kernel = compiled_kernel()
    parts = (
        program.diagonal, program.linear, program.rows, program.target, program.weight, program.elastic, program.least,
        program.elastic_weight, program.lower, program.upper,
    )  # fmt: skip
    elastic = len(program.least)
    settled = kernel.primal_dual_active_set(
        *map(np.ascontiguousarray, parts), np.arange(elastic), *active, corrections, FULL_CORRECTIONS, BOUND_TOLERANCE,
        ROW_TOLERANCE, np.empty(kernel.work_size(program.size, len(program.target), elastic)),
        np.empty(elastic, dtype=np.intp), x,
    )  # fmt: skip
    return QPSolution(x, active, True, 0) if settled else None


def without_gradient(program: QuadraticProgram, active: ActiveSet, target: Array, work: Array) -> Array | None:
    """Minimiser of a program with g = 0 and its active set fixed.

    Args:
        program: what to solve.
        active: the set.
        target: (m,) targets of the soft rows, in the place of the program's.
        work: room; see `active_set_kernel.work_size`.

    Returns:
        (n,) the minimiser, clipped to the box; None where it is not finite.
    """
    program.check_shapes(active)
    kernel, x = compiled_kernel(), np.empty(program.size)
    parts = (
        program.diagonal, program.rows, target, program.weight, program.elastic, program.least,
        program.elastic_weight, program.lower, program.upper,
    )  # fmt: skip
    finite = kernel.minimise_without_gradient(*map(np.ascontiguousarray, parts), *active, ROW_TOLERANCE, work, x)
    return x if finite else None


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import active_set_kernel

    none, one, mask = np.zeros(0), np.ones(1), np.zeros(1, dtype=bool)
    program = (one, one, np.zeros((0, 1)), none, none, np.zeros((0, 1)), none, none, -one, one)
    index, row = np.zeros(0, dtype=np.intp), np.zeros(0, dtype=bool)
    work = np.empty(active_set_kernel.work_size(1, 0, 0))
    active_set_kernel.primal_dual_active_set(
        *program, index, mask, mask.copy(), row, 1, 1, BOUND_TOLERANCE, ROW_TOLERANCE, work, index, np.zeros(1)
    )
    active_set_kernel.solve_growing(
        *program, index, index, mask, mask.copy(), row, row, np.ones(6), work, np.zeros(1, dtype=np.intp), np.zeros(1)
    )
    active_set_kernel.minimise_without_gradient(
        one, *program[2:], mask, mask.copy(), row, ROW_TOLERANCE, work, np.zeros(1)
    )
    return active_set_kernel
