"""From a linearisation to the quadratic program of one step, and the two figures a step is judged by.

The rows are ordered by their weights: contacts and inequalities give way last, then holds, then goals, then measures.
Because the programs are solved exactly, the order is kept to rounding whatever the factor between the weights.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.records import with_values
from wholebody.figures.state import State
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.problem import Problem
from wholebody.terms.linearisation import Linearisation
from wholebody.terms.planes import TermPlanes

PROXIMAL_SHARE = 0.01  # share of the curvature left where measures do not count: they still say which joints move
GOAL_FORCE = 1e4  # 1/m: what a goal pulls with, however far it is; far above what measures pull with
GOAL_WEIGHTS = (1e4, 1e8)  # 1/m^2, 1/rad^2: least and greatest weight of a goal row
HOLD_WEIGHT = 1e10  # equalities give way by 1e-6 m to the pull of a goal out of reach
ELASTIC_WEIGHT = 1e10  # and so do contacts
ERROR_CLAMP = 0.4  # m per rad of radius: of a goal farther away, or a deeper overlap, one step asks for this much
BOX = 2.0  # radii: the box around a step, which seldom holds it; asking for little keeps programs easy instead
HOLD_SHARE = 3.0  # what a metre of hold counts against a metre of goal when a step is judged
ELASTIC_SHARE = 10.0  # and a metre of overlap; above any ratio at which overlap could buy goal
FORCE = np.array([GOAL_FORCE, *GOAL_WEIGHTS, HOLD_WEIGHT])
"""What the compiled loops take of the above."""

LEAST_SHARE = 1e-3  # of the largest goal weight: goals that weigh less count as this much, or they would not be met
HEAVIEST_CURVATURE = 5e3  # 1/rad^2: heavier measures are scaled to this; above it they would hold goals back
MOST_ROWS = 4096  # more than one contact ever has
PLANE_KEYS = -(1 << 40)  # keys of supporting planes are below this, out of the way of all others
LEVER = 1.0  # m: of a limb; larger = more damping of every joint while a goal is out of reach
LEAST_CURVATURE = 1e-3  # share of the largest curvature that a degree of freedom has which no measure speaks for

_NONE = np.zeros(0)


class Violation(NamedTuple):
    """How far a posture is from what is asked: metres and radians.

    Attributes:
        goal: norm of the goal errors, each times the root of its weight's share of the largest.
        hold: norm of the equality constraints' errors.
        elastic: sum of the violations of clearances and inequalities.
        left: norm of the goal errors, without weights.
    """

    goal: float
    hold: float
    elastic: float
    left: float

    @property
    def total(self) -> float:
        """One figure, in which overlap counts most."""
        return self.goal + HOLD_SHARE * self.hold + ELASTIC_SHARE * self.elastic

    @property
    def worst(self) -> float:
        """What is compared with the tolerance."""
        return max(self.left, self.hold, self.elastic)


class Rows(NamedTuple):
    """A linearisation sorted into soft rows (goals, then equalities) and elastic ones (inequalities, then gaps).

    Attributes:
        soft: (m, nv) goals' and equalities' rows.
        soft_error: (m,) their errors.
        soft_weight: (m,) their weights.
        goals: how many of them are goals'.
        elastic: (k, nv) rows of inequalities and gaps.
        elastic_violation: (k,) by how much they are violated; negative where they hold with room to spare.
        contact: (k,) rows of one contact share its number; the worst of them counts.
        contacts: how many numbers there are.
        key: (k,) names a row from one linearisation to the next.
        elastic_weight: (k,) their weights; None where all have `ELASTIC_WEIGHT`.
    """

    soft: Array
    soft_error: Array
    soft_weight: Array
    goals: int
    elastic: Array
    elastic_violation: Array
    contact: NDArray[np.intp]
    contacts: int
    key: NDArray[np.intp]
    elastic_weight: Array | None = None


def _with_planes(rows: Rows, planes: TermPlanes) -> Rows:
    """Rows with the terms' supporting planes, which give way as the terms do and count for no violation of their own.

    The gap itself counts, and is violated wherever a plane is.
    """
    count = len(planes.value)
    weights = np.append(rows.soft_weight[: rows.goals], HOLD_WEIGHT)
    return with_values(
        rows,
        elastic=np.vstack([rows.elastic, -planes.jacobian]),
        elastic_violation=np.concatenate([rows.elastic_violation, planes.value]),
        contact=np.concatenate([rows.contact, np.full(count, -1, dtype=np.intp)]),
        key=np.concatenate([rows.key, PLANE_KEYS - planes.key]),
        elastic_weight=np.concatenate(
            [np.full(len(rows.elastic), ELASTIC_WEIGHT), weights[np.minimum(planes.row, rows.goals)]]
        ),
    )


class Subproblem:
    """Builds programs for one problem.

    Attributes:
        goal_share: (g,) weights of the goals' rows, as shares of the largest.
        kind: (c,) of each constraint's value: whether it is an equality (0), has a lower bound (1), an upper bound (2),
            both (3) or none (-1).
        bound: (2, c) lower and upper bounds of the values.
        one_sided: number of the inequalities.
    """

    def __init__(self, problem: Problem, state: State) -> None:
        """Read off which constraint rows are equalities.

        Args:
            problem: what is asked.
            state: of the run; it is moved to the problem's start.
        """
        lower, upper, weight = [], [], []
        state.update(problem.start)
        for constraint in problem.constraints:
            low, high = np.atleast_1d(constraint.lower), np.atleast_1d(constraint.upper)
            size = max(len(low), len(high))
            if size == 1:  # one bound may be that of many rows
                size = np.size(constraint.value(state))
            lower.append(low if len(low) == size else np.full(size, low[0]))
            upper.append(high if len(high) == size else np.full(size, high[0]))
        for goal in problem.goals:
            weight.append(np.full(np.atleast_1d(goal.error(state)).shape, goal.weight))
        self._lower = np.concatenate(lower) if lower else np.zeros(0)
        self._upper = np.concatenate(upper) if upper else np.zeros(0)
        goal_weight = np.concatenate(weight) if weight else np.zeros(0)
        self.goal_share = np.maximum(goal_weight / goal_weight.max(initial=1e-300), LEAST_SHARE)
        self.scale = 1.0
        """What measures are multiplied by, so that heavy ones do not outweigh goals."""
        heaviest = sum((m.weight * m.curvature(state) for m in problem.measures), np.zeros(state.model.nv))
        if heaviest.max(initial=0.0) > HEAVIEST_CURVATURE:
            self.scale = HEAVIEST_CURVATURE / float(heaviest.max())
        self._equal = np.flatnonzero(self._lower == self._upper)
        self.equalities = [int((low == high).sum()) for low, high in zip(lower, upper, strict=True)]
        """How many rows of each constraint are equalities."""
        low = (self._lower != self._upper) & np.isfinite(self._lower)
        high = (self._lower != self._upper) & np.isfinite(self._upper)
        self.one_sided = int(low.sum() + high.sum())
        neither = (self._lower != self._upper) & ~low & ~high
        self.kind = np.where(neither, -1, low + 2 * high).astype(np.intp)
        self.bound = np.array([self._lower, self._upper]).reshape(2, -1)
        self._kernel = compiled_kernel()

    def rows(self, at: Linearisation) -> Rows:
        """Sort the rows of a linearisation.

        Raises:
            InputError: the terms have other numbers of rows than when this was set up.
        """
        goals = len(at.goal_error)
        self.check_rows(goals, len(at.value))
        nv, soft, elastic = len(at.gradient), goals + len(self._equal), self.one_sided + len(at.gap)
        soft_rows, soft_values = np.empty((soft, nv)), np.empty((2, soft))
        elastic_rows, violated = np.empty((elastic, nv)), np.empty(elastic)
        labels = np.empty((2, elastic), dtype=np.intp)
        self._kernel.sort_rows(
            at.goal_error, at.goal_jacobian, at.value, at.value_jacobian, at.gap, at.gap_jacobian, at.gap_contact,
            at.clearance, at.contacts.number, self.kind, self.bound, self.goal_share, FORCE, MOST_ROWS, soft_rows,
            soft_values, elastic_rows, violated, labels,
        )  # fmt: skip
        contacts = self.one_sided + len(at.contacts.distance)
        rows = Rows(
            soft_rows, soft_values[0], soft_values[1], goals, elastic_rows, violated, labels[0], contacts, labels[1],
        )  # fmt: skip
        return rows if at.planes is None else _with_planes(rows, at.planes)

    def soft_row(self, row: NDArray[np.intp]) -> NDArray[np.intp]:
        """The soft rows of rows (k,) that are counted with the goals' before all values'; they are equalities."""
        goals = len(self.goal_share)
        return np.where(row < goals, row, goals + np.searchsorted(self._equal, row - goals))

    def check_rows(self, goals: int, values: int) -> None:
        """Raise InputError where goals and constraints have other numbers of rows than when this was set up."""
        if goals != len(self.goal_share) or values != len(self.kind):
            raise InputError(
                f"goals and constraints have {goals} and {values} rows here, and had {len(self.goal_share)} "
                f"and {len(self.kind)} at the start; give each term one number of rows at all postures"
            )

    def violation(self, rows: Rows, displacement: Array | None = None) -> Violation:
        """Violation at the linearised posture, or what the linearisation predicts after a displacement (nv,)."""
        way = _NONE if displacement is None else displacement
        return Violation(
            *self._kernel.violation(
                rows.soft_error, rows.soft, rows.elastic_violation, rows.elastic, rows.contact, self.goal_share,
                np.empty(rows.contacts), way,
            )
        )  # fmt: skip

    def saving(self, program: QuadraticProgram, rows: Rows, x: Array) -> float:
        """By how much the measures of a program lessen, to second order, with the displacement x (nv,)."""
        return -float(program.linear @ x) / self.scale - self.quadratic_part(program, rows, x)

    def quadratic_part(self, program: QuadraticProgram, rows: Rows, x: Array) -> float:
        """Half of x' H x with the measures' curvature H in a program: what a tangential part x (nv,) saves."""
        soft = len(rows.soft_error)
        bent = (program.diagonal * x) @ x
        if len(program.weight) > soft:
            turned = program.rows[soft:] @ x
            bent += (program.weight[soft:] * turned) @ turned
        return 0.5 * float(bent) / self.scale

    def program(
        self,
        at: Linearisation,
        rows: Rows,
        radius: float,
        pull: float | None,
        damping: float,
        shift: Array,
        measures: bool,
        gain: float = 1.0,
    ) -> QuadraticProgram:
        """The program of one step.

        Args:
            at: where.
            rows: its rows.
            radius: about the largest entry that the displacement should have, radians and metres.
            pull: of goals farther away only so much is asked for, metres and radians; None asks for all of it.
            damping: how much of the goals' neglected second derivative to add, bounded by |pull| times lever; where all
                is asked for, how much of the weighted squared error (Sugihara 2011, as in `DampedLeastSquares`).
            shift: (soft rows,) added to the errors so that weights need not be infinite (method of multipliers).
            measures: whether the measures count; without them the nearest posture to the goals is sought. The squares
                that they are the sum of are soft rows, after those of `rows`.
            gain: share of the way to the least measures that the step is to go.
        """
        squares = at.squares if measures else at.squares[:0]
        curvature = at.curvature - at.squared if len(squares) else at.curvature
        numbers = np.array(
            [self.scale, LEAST_CURVATURE, PROXIMAL_SHARE, radius, 0.0 if pull is None else pull, damping, LEVER]
            + [BOX * radius, ERROR_CLAMP * radius, gain]
        )
        columns = np.empty((4, len(at.gradient)))
        target, least = np.empty(len(rows.soft_error)), np.empty(len(rows.elastic_violation))
        self._kernel.program(
            at.gradient, curvature, at.lower, at.upper, rows.soft_error, rows.soft_weight,
            rows.goals, rows.elastic_violation, shift,
            measures, pull is not None, numbers, columns, target, least,
        )  # fmt: skip
        soft, weight = rows.soft, rows.soft_weight
        if len(squares):
            soft, target = np.vstack([soft, squares]), np.concatenate([target, np.zeros(len(squares))])
            weight = np.concatenate([weight, np.full(len(squares), self.scale / gain)])
        return QuadraticProgram(
            diagonal=columns[0],
            linear=columns[1],
            rows=soft,
            target=target,
            weight=weight,
            elastic=rows.elastic,
            least=least,
            elastic_weight=np.full(len(least), ELASTIC_WEIGHT) if rows.elastic_weight is None else rows.elastic_weight,
            lower=columns[2],
            upper=columns[3],
        )


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import subproblem_kernel

    none, rows, index, pair = np.zeros(0), np.zeros((0, 1)), np.zeros(0, dtype=np.intp), np.zeros((2, 0))
    one, number = np.ones(1), np.ones(10)
    subproblem_kernel.sort_rows(
        none, rows, none, rows, none, rows, index, none, index, index, pair, none, FORCE, MOST_ROWS, rows, pair, rows,
        none, np.zeros((2, 0), dtype=np.intp),
    )  # fmt: skip
    subproblem_kernel.violation(none, rows, none, rows, index, none, none, none)
    subproblem_kernel.program(
        one, one, one, one, none, none, 0, none, none, True, True, number, np.ones((4, 1)), none, none
    )
    subproblem_kernel.multipliers(rows, none, none, rows, none, none, np.zeros(0, dtype=bool), one, 1.0, none, none)
    subproblem_kernel.work(none, none, index, none, index, none)
    one_joint = np.zeros(1, dtype=np.intp)
    subproblem_kernel.motion(
        one, np.zeros((1, 6)), one_joint, one_joint, one_joint, np.zeros((1, 4, 3)), one, np.zeros((1, 6))
    )
    return subproblem_kernel
