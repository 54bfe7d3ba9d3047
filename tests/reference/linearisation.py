"""Everything that counts at a posture, term by term: what the pass of `wholebody.terms.linearisation` must do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.reference.contact_rows import ReferenceRowBuilder
from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.figures.state import State, Wrench
from wholebody.tasks import StepLimit
from wholebody.tasks.base import Constraint, Goal
from wholebody.terms.linearisation import Linearisation, Lineariser


class ReferenceLineariser(Lineariser):
    """The lineariser with each term's own methods in place of the compiled pass."""

    def at(self, q: Array, within: float) -> Linearisation:
        """Everything at the posture q, shape (nq,), with the pairs nearer than `within` metres plus their clearance."""
        state, workspace = self.state, self.workspace
        contacts = workspace.near(q, within + self._largest, self._clearances[1])
        clearance = self.clearances[contacts.number]
        rows = ReferenceRowBuilder(workspace.table).rows(contacts, clearance)

        errors = [np.atleast_1d(goal.error(state)) for goal in self.goals]
        values = [np.atleast_1d(constraint.value(state)) for constraint in self.constraints]
        sizes = [len(part) for part in (*errors, *values)]
        jacobian = self._jacobians(state, sizes, rows.wrench, rows.second, rows.first)
        goal_rows = sum(len(error) for error in errors)
        value_rows = sum(len(value) for value in values)
        lower, upper = self._bounded(state)
        measure, gradient, curvature = self._measured(state)
        return Linearisation(
            q=np.array(q, dtype=float),
            goal_error=_joined(errors),
            goal_jacobian=jacobian[:goal_rows],
            value=_joined(values),
            value_jacobian=jacobian[goal_rows : goal_rows + value_rows],
            contacts=contacts,
            gap=rows.gap,
            gap_jacobian=jacobian[goal_rows + value_rows :],
            gap_contact=rows.contact,
            clearance=clearance[rows.contact],
            measure=measure,
            gradient=gradient,
            curvature=curvature,
            lower=lower,
            upper=upper,
        )

    def _jacobians(
        self, state: State, sizes: Sequence[int], gap_wrench: Array, second: Indices, first: Indices
    ) -> Array:
        """Rows of all goals, constraints and contacts, in this order; the wrenches among them in one product.

        Raises:
            InputError: a term has other numbers of values (`sizes`) and rows.
        """
        wrenches: list[Array] = []
        joint: list[int] = []
        against: list[int] = []
        dense: list[tuple[int, Array]] = []
        row = 0
        terms: list[Goal | Constraint] = [*self.goals, *self.constraints]
        for term, values in zip(terms, sizes, strict=True):
            part = term.jacobian(state)
            if isinstance(part, Wrench):
                size = len(part.rows)
                wrenches.append(part.rows)
                joint += [part.joint] * size
                against += [part.against] * size
            else:
                size = len(part)
                dense.append((row, part))
                wrenches.append(np.zeros((size, 6)))
                joint += [0] * size
                against += [0] * size
            if size != values:
                raise InputError(
                    f"{type(term).__name__} has {values} values and {size} rows at a posture; give as many"
                )
            row += size
        stacked = np.vstack([*wrenches, gap_wrench])
        result = state.rows(
            stacked,
            np.concatenate([np.array(joint, dtype=np.intp), second]),
            np.concatenate([np.array(against, dtype=np.intp), first]),
        )
        for start, part in dense:
            result[start : start + len(part)] = part
        return result

    def _limited(self, q: Array) -> tuple[Array, Array]:
        nv = self.state.model.nv
        lower, upper = np.full(nv, -np.inf), np.full(nv, np.inf)
        limits = self._limits
        lower[limits.idx_v], upper[limits.idx_v] = limits.lower - q[limits.idx_q], limits.upper - q[limits.idx_q]
        for bound in self.bounds:
            if isinstance(bound, StepLimit) and self.dt is not None:  # brakes before limits, and not on the way back
                bounded = np.isfinite(bound.bounds(self.state, self.dt)[1])
                share = -np.expm1(-self.dt / 0.05)
                lower[bounded & (lower < 0.0)] *= share
                upper[bounded & (upper > 0.0)] *= share
        return lower, upper

    def _bounded(self, state: State) -> tuple[Array, Array]:
        lower, upper = self._limited(state.q)
        for bound in self.bounds:
            # a joint out of its limits comes back no faster than the bound lets it
            low, high = bound.bounds(state, self.dt)
            lower, upper = np.clip(lower, low, high), np.clip(upper, low, high)
        return lower, upper

    def _measured(self, state: State) -> tuple[float, Array, Array]:
        value = 0.0
        gradient = np.zeros(state.model.nv)
        curvature = np.zeros(state.model.nv)
        for term in self.measures:
            value += term.weight * term.value(state)
            gradient += term.weight * term.gradient(state)
            curvature += term.weight * term.curvature(state)
        return value, gradient, curvature


def _joined(parts: list[Array]) -> Array:
    return np.concatenate(parts) if parts else np.zeros(0)
