"""Values of constraints without their derivatives: what a step looks at where it would end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks.base import Constraint
from wholebody.terms.linearisation import NO_CONTACTS, NO_LIMITS, NO_PIECES, compiled_kernel
from wholebody.terms.plan import Terms, checked_count, make_plan


class ConstraintValues:
    """Values of some constraints, and of nothing else, at any state of one model."""

    def __init__(self, constraints: Sequence[Constraint], state: State) -> None:
        """Take resolved constraints; `state` tells how many rows terms of one's own have, and stays where it is."""
        self._kernel = compiled_kernel()
        self._plan = plan = make_plan(NO_LIMITS, Terms(constraints=constraints), None, state)
        self._model, rows, nv = state.model, plan.value_rows, state.model.nv
        self._wrench, self._jacobian = np.empty((rows, 6)), np.empty((rows, nv))
        self._value, self._box, self._measure = np.empty(rows), np.empty((2, nv)), np.empty((2, nv + 1))
        self._no_squares = np.zeros((0, nv))

    def take(self, constraints: Sequence[Constraint]) -> bool:
        """Put others in their place; False, and nothing is done, where these are not of the same classes and frames."""
        plan = self._plan.with_terms((), self._model, constraints)
        self._plan = self._plan if plan is None else plan
        return plan is not None

    def at(self, state: State) -> Array:
        """The values (c,) where a state is; overwritten by the next call."""
        plan, value = self._plan, self._value
        self._kernel.linearise(
            (state.joints, state.columns, state.q, NO_PIECES), plan[:4], *NO_CONTACTS,
            (self._wrench, value, self._jacobian, self._box, self._measure, self._no_squares),
        )  # fmt: skip
        for term, evaluate, row, rows in plan.others:
            part = np.atleast_1d(evaluate(state))
            checked_count(term, len(part), rows)
            value[row : row + rows] = part
        return value
