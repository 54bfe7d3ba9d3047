"""What the measures are worth where what is asked is met to different degrees: by the multipliers of a program.

A posture that misses its goals has lower measures than one that meets them, and the next step will take that back. So
near the goals two postures compare by the Lagrangian, with the multipliers y, z of the program between them:

    L(q) = m(q) + y' c(q) + z' v(q),

where m are the measures, c the errors of the soft rows and v the violations of the elastic ones (less than zero where
they hold with room to spare). For a step x = n + t in its normal and tangential parts the program's own model has L
fall along the constraints by -g' t - t' H t / 2 - y' A t + z' C t, with the soft rows A and the elastic rows C (Nocedal
and Wright 2006, chapters 12 and 18). That is t' H t / 2 where no bound holds the step, and more where one does.
Measures alone would let steps
that are too long for curved constraints swing to and fro, each by more than the last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.subproblem import Rows, compiled_kernel

SAME = 0.99  # cosine of the angle between two rows from which on they count as one


class Multipliers(NamedTuple):
    """Multipliers of a program's rows, in units of the measures for each metre or radian.

    Attributes:
        soft: (m,) y, of goals and equalities.
        elastic: (k,) z, of inequalities and gaps: positive where they push, else 0.
        key: (k,) names of the elastic rows.
    """

    soft: Array
    elastic: Array
    key: NDArray[np.intp]

    def lagrangian(self, measure: float, rows: Rows) -> float:
        """L at a posture with these measures and rows; rows that are not there any more count as at their bounds."""
        work: float = compiled_kernel().work(
            self.soft, self.elastic, self.key, rows.soft_error, rows.key, rows.elastic_violation
        )
        return measure + work

    def net(self, rows: Rows) -> Array:
        """(m,) y without what elastic rows of the same direction take back: a gap of zero that must not be negative."""
        pushing = np.flatnonzero(self.elastic > 0.0)
        long = np.linalg.norm(rows.soft, axis=1), np.linalg.norm(rows.elastic[pushing], axis=1)
        along = (rows.soft @ rows.elastic[pushing].T) / np.maximum(np.outer(*long), 1e-12)
        return np.asarray(self.soft - (along > SAME) @ self.elastic[pushing])

    def change(self, program: QuadraticProgram, x: Array) -> float:
        """What errors and violations add to L, to first order, with the displacement x (n,): y' A x - z' C x."""
        soft = program.rows[: len(self.soft)] @ x
        return float(self.soft @ soft - self.elastic @ (program.elastic @ x))


def multipliers_of(program: QuadraticProgram, answer: QPSolution, rows: Rows, scale: float) -> Multipliers:
    """The multipliers of a program.

    Args:
        program: of a step.
        answer: its answer.
        rows: that it was made of.
        scale: what measures are multiplied by in it.
    """
    soft, elastic = np.empty(len(rows.soft_error)), np.empty(len(program.least))
    compiled_kernel().multipliers(
        program.rows, program.target, program.weight, program.elastic, program.least, program.elastic_weight,
        answer.active.elastic, answer.x, scale, soft, elastic,
    )  # fmt: skip
    return Multipliers(soft, elastic, rows.key)
