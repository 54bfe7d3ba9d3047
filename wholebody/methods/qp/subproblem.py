"""From a linearisation to the quadratic program of one step, and the two figures a step is judged by."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, with_values
from wholebody.base.compiled import with_loops
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.methods.qp.quadratic_program import (
    LinearRows,
    Multipliers,
    QPSolution,
    QuadraticProgram,
    Rows,
    StepSize,
    Terms,
    Violation,
)
from wholebody.methods.qp.settings import PROGRAM, WEIGHTS
from wholebody.problem import Problem
from wholebody.terms.linearisation import Linearisation, TermPlanes

_NONE = np.zeros(0)


def _with_planes(rows: Rows, planes: TermPlanes) -> Rows:
    """Rows with the terms' supporting planes, which give way as the terms do and are no violation of their own."""
    count = len(planes.value)
    weights = np.append(rows.soft_weight[: rows.goals], WEIGHTS.hold)
    # keys of supporting planes are below this, apart from all others
    return with_values(
        rows,
        elastic=np.vstack([rows.elastic, -planes.jacobian]),
        elastic_violation=np.concatenate([rows.elastic_violation, planes.value]),
        contact=np.concatenate([rows.contact, np.full(count, -1, dtype=np.intp)]),
        key=np.concatenate([rows.key, -(1 << 40) - planes.key]),
        elastic_weight=np.concatenate([rows.elastic_weight, weights[np.minimum(planes.row, rows.goals)]]),
    )


class Subproblem:
    """Builds programs for one problem.

    Attributes:
        terms: the terms' rows, with the goals' weights.
        one_sided: number of the inequalities.
    """

    def __init__(self, problem: Problem, state: State) -> None:
        """Read off which constraint rows are equalities; the state is moved to the problem's start."""
        state.update(problem.start)
        bounds: list[Array] = [np.zeros((2, 0))]
        for constraint in problem.constraints:
            low, high = np.atleast_1d(constraint.lower), np.atleast_1d(constraint.upper)
            size = max(len(low), len(high))
            if size == 1:  # one bound may be that of many rows
                size = np.size(constraint.value(state))
            bounds.append(np.array([np.broadcast_to(bound, size) for bound in (low, high)]))
        lower, upper = bound = np.concatenate(bounds, axis=1)
        weights = [np.full(np.size(goal.error(state)), goal.weight) for goal in problem.goals]
        goal_weight = np.concatenate([np.zeros(0), *weights])
        share = np.maximum(goal_weight / goal_weight.max(initial=1e-300), PROGRAM.least_share)
        self.scale = 1.0
        """What measures are multiplied by, so that heavy ones do not outweigh goals."""
        heaviest = sum((m.weight * m.curvature(state) for m in problem.measures), np.zeros(state.model.nv))
        if heaviest.max(initial=0.0) > PROGRAM.heaviest_curvature:
            self.scale = PROGRAM.heaviest_curvature / float(heaviest.max())
        # what stands for the measures where they do not count, so that what is reached does not depend on them
        self._effort = 2.0 * problem.scene.figure.effort_weights
        self._equal = np.flatnonzero(lower == upper)
        self.equalities = [int((low == high).sum()) for low, high in bounds[1:]]
        """How many rows of each constraint are equalities."""
        has_low, has_high = (lower != upper) & np.isfinite(bound)
        self.one_sided = int(has_low.sum() + has_high.sum())
        neither = (lower != upper) & ~has_low & ~has_high
        kind = np.where(neither, -1, has_low + 2 * has_high).astype(np.intp)
        self.terms = Terms(kind, bound, share, np.array(WEIGHTS))
        self._numbers, self._kernel = np.array(PROGRAM), compiled_kernel()

    def rows(self, at: Linearisation) -> Rows:
        """Sort the rows of a linearisation; InputError for other numbers of rows than when this was set up."""
        goals = len(at.goal_error)
        self.check_rows(goals, len(at.value))
        nv, soft, elastic = len(at.gradient), goals + len(self._equal), self.one_sided + len(at.gap)
        soft_rows, soft_values = np.empty((soft, nv)), np.empty((2, soft))
        elastic_rows, elastic_values = np.empty((elastic, nv)), np.empty((2, elastic))
        labels = np.empty((2, elastic), dtype=np.intp)
        rows = Rows(
            soft_rows, soft_values[0], soft_values[1], goals, elastic_rows, elastic_values[0], labels[0],
            self.one_sided + len(at.contacts.distance), labels[1], elastic_values[1],
        )  # fmt: skip
        there = LinearRows(
            at.goal_error, at.goal_jacobian, at.value, at.value_jacobian, at.gap, at.gap_jacobian, at.gap_contact,
            at.clearance, at.contacts.number,
        )  # fmt: skip
        self._kernel.fill_rows(there, self.terms, rows)
        return rows if at.planes is None else _with_planes(rows, at.planes)

    def soft_row(self, row: NDArray[np.intp]) -> NDArray[np.intp]:
        """The soft rows of rows (k,) that are counted with the goals' before all values'; they are equalities."""
        goals = len(self.terms.share)
        return np.where(row < goals, row, goals + np.searchsorted(self._equal, row - goals))

    def check_rows(self, goals: int, values: int) -> None:
        """Raise InputError where goals and constraints have other numbers of rows than when this was set up."""
        if goals != len(self.terms.share) or values != len(self.terms.kind):
            raise InputError(
                f"goals and constraints have {goals} and {values} rows here, and had {len(self.terms.share)} "
                f"and {len(self.terms.kind)} at the start; give each term one number of rows at all postures"
            )

    def violation(self, rows: Rows, displacement: Array | None = None) -> Violation:
        """Violation at the linearised posture, or what the linearisation predicts after a displacement (nv,)."""
        x = _NONE if displacement is None else displacement
        return Violation(*self._kernel.violation(rows, self.terms.share, x))

    def saving(self, program: QuadraticProgram, rows: Rows, x: Array) -> float:
        """By how much the measures of a program decrease, to second order, with the displacement x (nv,)."""
        return -float(program.linear @ x) / self.scale - self.quadratic_part(program, rows, x)

    def quadratic_part(self, program: QuadraticProgram, rows: Rows, x: Array) -> float:
        """Half of x' H x with the measures' curvature H in a program: what a tangential part x (nv,) saves."""
        soft = len(rows.soft_error)
        bent = (program.diagonal * x) @ x
        if len(program.weight) > soft:
            turned = program.rows[soft:] @ x
            bent += (program.weight[soft:] * turned) @ turned
        return 0.5 * float(bent) / self.scale

    def program(self, at: Linearisation, rows: Rows, step: StepSize, shift: Array | None = None) -> QuadraticProgram:
        """The program of one step; `shift` (soft rows,) is added to the errors (method of multipliers)."""
        squares = at.squares if step.measures else at.squares[:0]
        curvature = at.curvature - at.squared if len(squares) else at.curvature
        columns = np.array([curvature if step.measures else self._effort, at.gradient, at.lower, at.upper])
        least = np.empty(len(rows.elastic_violation))
        target = np.zeros(len(rows.soft_error)) if shift is None else shift.copy()
        self._kernel.fill_program(
            columns, rows, target, least, step, self._numbers, self.scale if step.measures else 1.0
        )
        program = QuadraticProgram(
            columns[0], columns[1], rows.soft, target, rows.soft_weight, rows.elastic, least, rows.elastic_weight,
            columns[2], columns[3],
        )  # fmt: skip
        if not len(squares):
            return program
        return program.with_squares(squares, np.full(len(squares), self.scale / step.gain))


def multipliers_of(program: QuadraticProgram, answer: QPSolution, rows: Rows, scale: float) -> Multipliers:
    """The multipliers of the answer to a program of `rows`, in which measures are multiplied by `scale`."""
    m, x = len(rows.soft_error), answer.x
    soft = program.weight[:m] * (program.rows[:m] @ x - program.target[:m]) / scale
    violated = np.where(answer.active.elastic, program.least - program.elastic @ x, 0.0)
    return Multipliers(soft, program.elastic_weight * violated / scale, rows.key)


def lagrangian(multipliers: Multipliers, measure: float, rows: Rows) -> float:
    """L at a posture with these measures and rows; elastic rows that are not there any more add nothing.

    A posture that misses its goals has lower measures than one that meets them, and the next step will take that back.
    So near the goals two postures compare by L(q) = m(q) + y' c(q) + z' v(q), with the measures m, the errors c of the
    soft rows, the violations v of the elastic ones, less than zero where they hold with room to spare, and the
    multipliers y, z of the program between them (Nocedal and Wright 2006, chapter 12).
    """
    work: float = compiled_kernel().work(*multipliers, rows.soft_error, rows.key, rows.elastic_violation)
    return measure + work


@with_loops("wholebody.methods.qp.subproblem_kernel")
def compiled_kernel(subproblem_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    none, matrix, index = np.zeros(0), np.zeros((0, 1)), np.zeros(0, dtype=np.intp)
    rows = Rows(matrix, none, none, 0, matrix, none, index, 0, index, none)
    there = LinearRows(none, matrix, none, matrix, none, matrix, index, none, index)
    subproblem_kernel.fill_rows(there, Terms(index, np.zeros((2, 0)), none, np.array(WEIGHTS)), rows)
    subproblem_kernel.violation(rows, none, none)
    size = StepSize(1.0, 1.0, 1.0, True)
    subproblem_kernel.fill_program(np.ones((4, 1)), rows, none.copy(), none.copy(), size, np.array(PROGRAM), 1.0)
    subproblem_kernel.work(none, none, index, none, index, none)
    three = np.zeros(3)
    subproblem_kernel.add_kinematic_hessian(matrix, np.zeros((0, 6)), none, three, three, three)
