"""From a linearisation to the quadratic program of one step, and the two figures a step is judged by.

The rows are ordered by their weights: contacts and inequalities give way last, then holds, then goals, then measures.
Because the programs are solved exactly, the order is kept to rounding whatever the factor between the weights.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.figures.state import State
from wholebody.linearisation import Linearisation
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.problem import Problem

PROXIMAL_SHARE = 0.01  # share of the curvature left where measures do not count: they still say which joints move
GOAL_FORCE = 1e4  # 1/m: what a goal pulls with, however far it is; far above what measures pull with
GOAL_WEIGHTS = (1e4, 1e8)  # 1/m^2, 1/rad^2: least and greatest weight of a goal row
HOLD_WEIGHT = 1e10  # equalities give way by 1e-6 m to the pull of a goal out of reach
ELASTIC_WEIGHT = 1e10  # and so do contacts
PULL = 0.4  # m per rad of radius: of a goal farther away, or a deeper overlap, one step asks for this much
BOX = 2.0  # radii: the box around a step, which seldom holds it; asking for little keeps programs easy instead
HOLD_SHARE = 3.0  # what a metre of hold counts against a metre of goal when a step is judged
ELASTIC_SHARE = 10.0  # and a metre of overlap; above any ratio at which overlap could buy goal
LEAST_SHARE = 1e-3  # of the largest goal weight: goals that weigh less count as this much, or they would not be met
HEAVIEST_CURVATURE = 5e3  # 1/rad^2: heavier measures are scaled to this; above it they would hold goals back
MOST_ROWS = 4096  # more than one contact ever has
LEVER = 1.0  # m: of a limb; larger = more damping of every joint while a goal is out of reach
LEAST_CURVATURE = 1e-3  # share of the largest curvature that a degree of freedom has which no measure speaks for


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


class Subproblem:
    """Builds programs for one problem."""

    def __init__(self, problem: Problem, state: State) -> None:
        """Read off which constraint rows are equalities.

        Args:
            problem: what is asked.
            state: of the run; it is moved to the problem's start.
        """
        lower, upper, weight = [], [], []
        state.update(problem.start)
        for constraint in problem.constraints:
            size = np.atleast_1d(constraint.value(state)).shape
            lower.append(np.broadcast_to(constraint.lower, size))
            upper.append(np.broadcast_to(constraint.upper, size))
        for goal in problem.goals:
            weight.append(np.full(np.atleast_1d(goal.error(state)).shape, goal.weight))
        self._lower = np.concatenate(lower) if lower else np.zeros(0)
        self._upper = np.concatenate(upper) if upper else np.zeros(0)
        goal_weight = np.concatenate(weight) if weight else np.zeros(0)
        self._goal_share = np.maximum(goal_weight / goal_weight.max(initial=1e-300), LEAST_SHARE)
        self.scale = 1.0
        """What measures are multiplied by, so that heavy ones do not outweigh goals."""
        heaviest = sum((m.weight * m.curvature(state) for m in problem.measures), np.zeros(state.model.nv))
        if heaviest.max(initial=0.0) > HEAVIEST_CURVATURE:
            self.scale = HEAVIEST_CURVATURE / float(heaviest.max())
        self._equal = np.flatnonzero(self._lower == self._upper)
        self.equalities = [int((low == high).sum()) for low, high in zip(lower, upper, strict=True)]
        """How many rows of each constraint are equalities."""
        self._low = np.flatnonzero((self._lower != self._upper) & np.isfinite(self._lower))
        self._high = np.flatnonzero((self._lower != self._upper) & np.isfinite(self._upper))

    def rows(self, at: Linearisation) -> Rows:
        """Sort the rows of a linearisation.

        Raises:
            InputError: the terms have other numbers of rows than when this was set up.
        """
        goals = len(at.goal_error)
        if goals != len(self._goal_share) or len(at.value) != len(self._lower):
            raise InputError(
                f"goals and constraints have {goals} and {len(at.value)} rows here, and had {len(self._goal_share)} "
                f"and {len(self._lower)} at the start; give each term one number of rows at all postures"
            )
        soft = np.vstack([at.goal_jacobian, at.value_jacobian[self._equal]])
        error = np.concatenate([at.goal_error, at.value[self._equal] - self._lower[self._equal]])
        distance = float(np.linalg.norm(at.goal_error))
        pull = min(max(GOAL_FORCE / max(distance, 1e-12), GOAL_WEIGHTS[0]), GOAL_WEIGHTS[1])
        weight = np.concatenate([pull * self._goal_share, np.full(len(self._equal), HOLD_WEIGHT)])
        low, high = self._low, self._high
        elastic = np.vstack([at.value_jacobian[low], -at.value_jacobian[high], at.gap_jacobian])
        violated = np.concatenate(
            [self._lower[low] - at.value[low], at.value[high] - self._upper[high], at.clearance - at.gap]
        )
        one_sided = len(low) + len(high)
        contact = np.concatenate([np.arange(one_sided), one_sided + at.gap_contact])
        contacts = len(at.contacts.distance)
        more = at.gap_contact[contacts:]
        place = np.concatenate([np.zeros(contacts, np.intp), 1 + np.arange(len(more)) - np.searchsorted(more, more)])
        key = np.concatenate([-1 - np.arange(one_sided), at.contacts.number[at.gap_contact] * MOST_ROWS + place])
        return Rows(soft, error, weight, goals, elastic, violated, contact, one_sided + contacts, key)

    def violation(self, rows: Rows, displacement: Array | None = None) -> Violation:
        """Violation at the linearised posture, or what the linearisation predicts after a displacement (nv,)."""
        error, violated = rows.soft_error, rows.elastic_violation
        if displacement is not None:
            error = error + rows.soft @ displacement
            violated = violated - rows.elastic @ displacement
        worst = np.zeros(rows.contacts)
        np.maximum.at(worst, rows.contact, violated)
        goal, hold = error[: rows.goals], error[rows.goals :]
        return Violation(
            float(np.sqrt((self._goal_share * goal) @ goal)),
            float(np.sqrt(hold @ hold)),
            float(worst.sum()),
            float(np.sqrt(goal @ goal)),
        )

    def program(
        self,
        at: Linearisation,
        rows: Rows,
        radius: float,
        pull: float | None,
        damping: float,
        shift: Array,
        measures: bool,
    ) -> QuadraticProgram:
        """The program of one step.

        Args:
            at: where.
            rows: its rows.
            radius: about the largest entry that the displacement should have, radians and metres.
            pull: of goals farther away only so much is asked for, metres and radians; None asks for all of it.
            damping: how much of the goals' neglected second derivative to add, bounded by |pull| times lever; where all
                is asked for, how much of the squared error (Sugihara 2011, as in `DampedLeastSquares`).
            shift: (soft rows,) added to the errors so that weights need not be infinite (method of multipliers).
            measures: whether the measures count; without them the nearest posture to the goals is sought.
        """
        curvature = self.scale * at.curvature
        floor = float(curvature.max(initial=0.0)) * LEAST_CURVATURE or 1.0
        diagonal = np.maximum(curvature, floor)
        linear = self.scale * at.gradient if measures else np.zeros_like(at.gradient)
        diagonal = np.maximum(diagonal if measures else PROXIMAL_SHARE * diagonal, np.abs(linear) / radius)
        error = rows.soft_error.copy()
        goal, goal_weight = error[: rows.goals], rows.soft_weight[: rows.goals]
        farthest = float(np.abs(goal).max(initial=0.0))
        if pull is None:
            # half way between joints that move alike, which takes the fewest steps, and as the measures would have them
            middle = len(diagonal) // 2
            metric = np.sqrt(diagonal / np.partition(diagonal, middle)[middle])
            diagonal = diagonal + damping * float(goal @ goal) * float(goal_weight.max(initial=0.0)) * metric
        elif farthest > pull:
            goal *= pull / farthest
        if damping > 0.0 and pull is not None:
            diagonal = diagonal + damping * LEVER * float((goal_weight * np.abs(goal)).max(initial=0.0))
        box = BOX * radius
        lower, upper = np.clip(at.lower, -box, box), np.clip(at.upper, -box, box)
        return QuadraticProgram(
            diagonal=diagonal,
            linear=linear,
            rows=rows.soft,
            target=-(error + shift),
            weight=rows.soft_weight,
            elastic=rows.elastic,
            least=np.minimum(rows.elastic_violation, PULL * radius),
            elastic_weight=np.full(len(rows.elastic_violation), ELASTIC_WEIGHT),
            lower=lower,
            upper=upper,
        )
