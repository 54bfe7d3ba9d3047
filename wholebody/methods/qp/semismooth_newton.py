"""The answer of any program, however many rows it has: semismooth Newton steps with an exact line search.

The objective is convex, piecewise quadratic and smooth. On a piece (which elastic rows push, which bounds hold) its
minimiser is a linear least squares problem. Each iteration goes towards that minimiser as far as the objective falls:
along a line its derivative is piecewise linear and increasing, so the best step is found exactly (Nocedal and Wright
2006, section 16.7, does the same for bounds). The objective falls at every step, so no set is tried for ever, which
correcting of active sets cannot promise; in return it changes one bound at a time.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.active_set import ROW_TOLERANCE
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram

STILL = 1e-13  # rad, m: a step shorter than this is none
WHOLE = 1e-9  # a step this near to the whole way is the whole way but for rounding
LIMITS = np.array([STILL, WHOLE, ROW_TOLERANCE])
"""What the compiled loop takes of these."""


def minimise(program: QuadraticProgram, start: Array, iterations: int) -> tuple[Array, ActiveSet, int]:
    """Lower the objective from a start until its minimum, or for so many iterations.

    Args:
        program: what to solve.
        start: (n,) where to begin; it is clipped to the box.
        iterations: most steps.

    Returns:
        x (n,) inside the box, its active set, and the number of iterations used.

    Raises:
        ValueError: the sizes of the program do not fit together.
    """
    x = np.array(start, dtype=float)
    held = np.zeros((2, program.size), dtype=bool)
    active = ActiveSet(held[0], held[1], np.zeros(len(program.least), dtype=bool))
    program.check_shapes(active)
    parts = (
        program.diagonal, program.linear, program.rows, program.target, program.weight, program.elastic, program.least,
        program.elastic_weight, program.lower, program.upper,
    )  # fmt: skip
    used = compiled_kernel().minimise(*map(np.ascontiguousarray, parts), iterations, LIMITS, *active, x)
    return x, active, used


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import semismooth_kernel

    none, one, rows, mask = np.zeros(0), np.ones(1), np.zeros((0, 1)), np.zeros(1, dtype=bool)
    semismooth_kernel.minimise(
        one, one, rows, none, none, rows, none, none, -one, one, 1, LIMITS, mask, mask.copy(), mask[:0], one.copy()
    )
    return semismooth_kernel
