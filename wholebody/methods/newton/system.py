"""All equations of some bodies as one sparse system, and the systems that an iteration passes through."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.control import Control
from wholebody.methods.newton.batches import ONE_SIDED, Batch, with_world
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.inequalities import ContactSet
from wholebody.methods.newton.linear_algebra import LinearAlgebra, Pattern, linear_algebra
from wholebody.methods.newton.settings import CONTACTS
from wholebody.scene.workspace import Workspace


class System:
    """Equations c(x) = 0 and inequalities c(x) >= 0 of n bodies: the pattern is made once, the values at every step.

    Attributes:
        pattern: structural non-zeros of the Jacobian (m, 7 n).
        goal, inequality, objective: (m,) rows that may be violated, that must be at least zero, whose squares are
            minimised.
        share: (m,) root of each goal's weight, as a share of the greatest; 1 for constraints.
        group_starts: (g,) first row of each group of rows whose norm is one error: a distance or an angle. Rows of
            inequalities are groups of their own.
        goal_groups: (g,) which groups are goals.
        stiffness: (m,) factors on the squares of the objective.
        weight: (7 n,) weight of each variable in the least motion.
    """

    def __init__(self, batches: Sequence[Batch], weight: Array) -> None:
        """Build rows and pattern of equations, of which empty ones are left out, for weights (7 n,)."""
        self.batches = [batch for batch in batches if len(batch)]
        self.weight = weight
        self._seen: tuple[Array, Array] | None = None
        self._found: tuple[Array, Array] | None = None
        roles = [batch.role for batch in self.batches]
        sizes = [len(batch) * batch.size for batch in self.batches]
        self.starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)
        self.goal = np.repeat([role.goal for role in roles], sizes).astype(bool)
        self.inequality = np.repeat([role.one_sided for role in roles], sizes).astype(bool)
        self.objective = np.repeat([role.objective for role in roles], sizes).astype(bool)
        self.stiffness = np.ones(len(self.objective))
        rows_of = [1 if batch.role.one_sided else max(batch.size, 1) for batch in self.batches]
        counts = [size // rows for size, rows in zip(sizes, rows_of, strict=True)]
        groups = np.repeat(np.array(rows_of, dtype=np.intp), counts)
        self.group_starts = (np.cumsum(groups) - groups).astype(np.intp)
        self.goal_groups = self.goal[self.group_starts]
        self._group_half_sines = np.repeat([batch.half_sines for batch in self.batches], counts).astype(bool)
        weights = np.repeat([role.weight or 0.0 for role in roles], sizes)
        self.share = np.where(self.goal, np.sqrt(weights / weights.max(initial=1e-300)), 1.0)
        rows, columns = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
        self._masks = []
        for batch, start in zip(self.batches, self.starts, strict=False):
            # (k, 7 b) columns of the variables of each equation; negative for those of the world
            column = (7 * batch.bodies[:, :, None] + np.arange(7)).reshape(len(batch), -1)
            row = start + np.arange(len(batch) * batch.size).reshape(len(batch), batch.size, 1)
            mask = batch.pattern[None] & (column >= 0)[:, None, :]
            self._masks.append(np.flatnonzero(mask))
            rows.append(np.broadcast_to(row, mask.shape)[mask])
            columns.append(np.broadcast_to(column[:, None, :], mask.shape)[mask])
        self.pattern = Pattern(np.concatenate(rows), np.concatenate(columns), int(self.starts[-1]), len(weight))

    def renew(self, batches: Sequence[Batch]) -> None:
        """Take other numbers for equations of the same pattern."""
        self._found = None
        self.batches = [batch for batch in batches if len(batch)]

    def bodies(self, x: Array) -> Array:
        """The variables (7 n,) as bodies (n + 1, 7), the world last."""
        if self._seen is None or self._seen[0] is not x:
            self._seen = (x, with_world(x))
        return self._seen[1]

    def residual(self, x: Array) -> Array:
        """(m,) metres and radians; read only, as the same array answers the same question until `renew`."""
        if self._found is None or self._found[0] is not x:
            bodies = self.bodies(x)
            found = np.concatenate([np.zeros(0), *(batch.residual(bodies).ravel() for batch in self.batches)])
            found.flags.writeable = False
            self._found = (x, found)
        return self._found[1]

    def errors(self, residual: Array) -> Array:
        """(g,) what each group of rows misses at a residual (m,), metres or radians; 0 for those of the objective."""
        rows = np.where(self.inequality, np.minimum(residual, 0.0), residual)
        rows[self.objective] = 0.0
        if not len(rows):
            return rows
        result: Array = np.sqrt(np.add.reduceat(rows * rows, self.group_starts))
        turned = self._group_half_sines
        result[turned] = 2.0 * np.arcsin(np.minimum(0.5 * result[turned], 1.0))
        return result

    def largest_errors(self, residual: Array) -> tuple[float, float]:
        """The largest error of a joint or constraint, and of a goal, at a residual (m,); metres or radians."""
        errors, goal = self.errors(residual), self.goal_groups
        return float(errors[~goal].max(initial=0.0)), float(errors[goal].max(initial=0.0))

    def values(self, x: Array) -> Array:
        """Values (nnz,) of the Jacobian in the order of the pattern."""
        bodies = self.bodies(x)
        parts = zip(self.batches, self._masks, strict=True)
        return np.concatenate([np.zeros(0), *(batch.jacobian(bodies).ravel()[mask] for batch, mask in parts)])

    def label(self, row: int) -> str:
        """Name of a row in messages."""
        index = int(np.searchsorted(self.starts, row, side="right")) - 1
        batch = self.batches[index]
        return batch.labels[(row - int(self.starts[index])) // batch.size]


def unit(x: Array) -> Array:
    """Copy of the variables (7 n,) with Euler parameters of unit length."""
    bodies = x.reshape(-1, 7).copy()
    bodies[:, 3:] /= np.sqrt((bodies[:, 3:] ** 2).sum(axis=1, keepdims=True))
    result: Array = bodies.ravel()
    return result


class ActiveSystem:
    """The equations of bodies during an iteration: what holds stays, goals, limits and contacts are renewed.

    After every step the Euler parameters of bodies get unit length, and the bodies of figures are placed by the forward
    kinematics of the nearest posture: their joints never drift, and their limits always hold. Patterns are analysed
    once while they are remembered, as contacts come and go.

    Attributes:
        system, algebra: the equations, and the factorisation for their pattern.
        contacts: the pairs that can touch; None without any.
        q: (nq,) posture at the last `retract`, where pairs can touch.
        longest: largest motion of any part of a body in a step, metres.
        control: may end the iteration early.
        path: the states (7 n,) since `begin`.
        even: whether goals count alike, whatever their weights.
        own_terms: whether there are terms of users' classes, which may not be finite everywhere.
        objective: the `Objective` of the measures; None without any.
        structures: number of patterns that were analysed.
    """

    system: System
    algebra: LinearAlgebra
    path: tuple[Array, ...] = ()
    even = own_terms = False
    longest = np.inf
    control = Control(np.inf)
    contacts: ContactSet | None = None
    q = _left = np.zeros(0)

    def __init__(
        self, held: Sequence[Batch], weight: Array, algebra: str, figures: Sequence[FigureBodies] = (),
        objective: Any = None,
    ) -> None:  # fmt: skip
        """Take what holds, weights (7 n,) of the variables in the least motion, figures, measures; goals by `begin`."""
        self.algebra_name, self._weight, self.objective = algebra, weight, objective
        self._held = [*held, *(() if objective is None else objective.batches())]
        self._figures, self._goals = tuple(figures), list[Batch]()
        self._known: dict[Hashable, tuple[System, LinearAlgebra]] = {}
        self._laid: Hashable = None
        self._goals_laid: Hashable = None
        self._here = np.zeros(0)
        self.structures = 0

    def begin(self, x: Array, goals: Sequence[Batch]) -> Array:
        """Begin a solve at x (7 n,) with these goals, and with the things where they are now; returns the start."""
        self.aim(goals)
        if self.contacts is not None:
            self.contacts.workspace.refresh()
        self._here = np.zeros(0)
        self.arrive(x)
        return self._here

    def aim(self, goals: Sequence[Batch]) -> None:
        """Take other goals for the next `arrive`."""
        self._goals, self._goals_laid = list(goals), tuple(batch.signature for batch in goals)
        self.path = ()

    def retract(self, x: Array) -> Array:
        """The variables (7 n,) after a step, projected to the nearest valid state."""
        if x is not self._here:
            self._here = x = self._projected(x)
            if self.contacts is not None:
                self.contacts.measure(self._data)
        return x

    def runs_into(self) -> bool:
        """Whether a pair that is no inequality overlaps at the result of the last `retract`: then it becomes one."""
        return self.contacts is not None and self.contacts.runs_into()

    def passes(self) -> bool:
        """Whether the motion to the result of the last `retract` neither jumps over something nor ends deep in it."""
        return self.contacts is None or self.contacts.passes(self._left, self.q)

    def arrive(self, x: Array) -> bool:
        """Renew the equations at x, the end of a step; returns whether their pattern changed."""
        x = self.retract(x)
        if self.objective is not None:
            self.objective.renew(self.posture(x))
        self._left = self.q
        fresh = not self.path
        if fresh or not np.array_equal(self.path[-1], x):
            self.path = (*self.path, x)
        if self.contacts is None and self.objective is None and not self._figures and not fresh:
            return False  # nothing depends on the state
        for figure in self._figures:
            figure.choose_limits()
        batches, laid = [*self._held, *self._goals], self._goals_laid
        if self.contacts is not None:
            rows = self.contacts.renew(self._data, with_world(x))
            rows.role = ONE_SIDED
            batches.append(rows)
            laid = (laid, self.contacts.pairs.tobytes())
        changed = laid != self._laid
        if changed:
            self._laid = laid
            self.system, self.algebra = self._analysed(laid, batches)
        if self.objective is not None:
            self.system.stiffness[self.system.objective] = self.objective.factors
        self.system.renew(batches)
        return changed

    def posture(self, x: Array) -> Array:
        """The posture (nq,) at the variables (7 n,), of which the measures are; in subclasses."""
        return x

    def _projected(self, x: Array) -> Array:
        """The nearest valid state to the variables (7 n,); where pairs can touch, subclasses set `q` and the data."""
        return unit(x)

    def _find_contacts(self, clearances: Array, workspace: Workspace, data: Any) -> None:
        """Let pairs that can touch be inequalities, none where there are none, where Pinocchio's `data` have joints."""
        self._data = data
        if len(clearances):
            self.contacts, self.longest = ContactSet(clearances, workspace), CONTACTS.longest

    def _analysed(self, laid: Hashable, batches: Sequence[Batch]) -> tuple[System, LinearAlgebra]:
        """The system of these equations and its factorisation; `laid` tells patterns apart."""
        if laid not in self._known:
            if len(self._known) >= 32:  # more would take more memory
                self._known.clear()
            system = System(batches, self._weight)
            self._known[laid] = (system, linear_algebra(system.pattern, self.algebra_name))
            self.structures += 1
        return self._known[laid]
