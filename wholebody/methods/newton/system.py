"""All equations of an assembly as one sparse system: the pattern is made once, the values at every iteration."""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.methods.control import Control
from wholebody.methods.newton.batches import OBJECTIVE, Batch, Key
from wholebody.methods.newton.linear_algebra.base import LinearAlgebra, Pattern
from wholebody.methods.newton.linear_algebra.choice import linear_algebra

WORLD = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))


class System:
    """Equations c(x) = 0 and inequalities c(x) >= 0 of n bodies.

    Attributes:
        batches: the equations.
        pattern: structural non-zeros of the Jacobian (m, 7 n).
        goal: (m,) rows of goals, which may be violated.
        inequality: (m,) rows that must be at least zero.
        share: (m,) root of each goal's weight, as a share of the greatest; 1 for constraints.
        objective: (m,) rows whose squares are minimised.
        group_starts: (g,) first row of each group of rows whose norm is one error: a distance or an angle. Rows of
            inequalities are groups of their own.
        goal_groups: (g,) which groups are goals.
        stiffness: (m,) their factors, 1 by default.
        weight: (7 n,) weight of each variable in the least motion.
    """

    def __init__(self, count: int, batches: Sequence[tuple[Batch, Key]], weight: Array) -> None:
        """Build rows and pattern.

        Args:
            count: number of bodies, without the world.
            batches: equations; empty batches are left out.
            weight: (7 count,).
        """
        keys = [key for batch, key in batches if len(batch)]
        self.count = count
        self.batches = [batch for batch, _ in batches if len(batch)]
        self.weight = weight
        self._seen: tuple[Array, Array] | None = None
        self._found: tuple[Array, Array] | None = None
        sizes = [len(batch) * batch.size for batch in self.batches]
        self.starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)
        self.goal = np.repeat([key.goal for key in keys], sizes).astype(bool)
        self.inequality = np.repeat([key.one_sided for key in keys], sizes).astype(bool)
        self.objective = np.repeat([key.kind == OBJECTIVE for key in keys], sizes).astype(bool)
        self.stiffness = np.ones(len(self.objective))
        rows_of = [1 if key.one_sided else batch.size for batch, key in batches if len(batch)]
        counts = [size // rows for size, rows in zip(sizes, rows_of, strict=True)]
        groups = np.repeat(np.array(rows_of, dtype=np.intp), counts)
        self.group_starts = (np.cumsum(groups) - groups).astype(np.intp)
        self.goal_groups = self.goal[self.group_starts]
        self._group_half_sines = np.repeat([batch.half_sines for batch in self.batches], counts).astype(bool)
        weights = np.repeat([key.weight if key.goal else 0.0 for key in keys], sizes)
        self.share = np.where(self.goal, np.sqrt(weights / weights.max(initial=1e-300)), 1.0)
        rows, columns = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
        self._masks = []
        for batch, start in zip(self.batches, self.starts, strict=False):
            column = _columns(batch)
            row = start + np.arange(len(batch) * batch.size).reshape(len(batch), batch.size, 1)
            mask = batch.pattern[None] & (column < 7 * count)[:, None, :]
            mask = np.broadcast_to(mask, (len(batch), *batch.pattern.shape))
            self._masks.append(np.flatnonzero(mask))
            rows.append(np.broadcast_to(row, mask.shape)[mask])
            columns.append(np.broadcast_to(column[:, None, :], mask.shape)[mask])
        self.pattern = Pattern(np.concatenate(rows), np.concatenate(columns), int(self.starts[-1]), 7 * count)
        self._curvature_places: tuple[Indices, Indices, list[Indices]] | None = None

    def renew(self, batches: Sequence[tuple[Batch, Key]]) -> None:
        """Take other numbers for equations of the same pattern."""
        self._found = None
        self.batches = [batch for batch, _ in batches if len(batch)]

    def bodies(self, x: Array) -> Array:
        """The variables (7 n,) as bodies (n + 1, 7), the world last."""
        if self._seen is None or self._seen[0] is not x:
            self._seen = (x, np.concatenate([x, WORLD]).reshape(-1, 7))
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

    def curvature(self, x: Array, force: Array) -> tuple[Indices, Indices, Array]:
        """Second derivative of force (m,) times residual: rows, columns and values, to be summed where they repeat."""
        bodies = self.bodies(x)
        if self._curvature_places is None:
            self._curvature_places = self._lay_curvature()
        rows, columns, keeps = self._curvature_places
        values = [np.zeros(0)]
        for batch, start, stop, keep in zip(self.batches, self.starts, self.starts[1:], keeps, strict=False):
            push = force[start:stop].reshape(len(batch), batch.size)
            values.append(batch.curvature(bodies, push).ravel()[keep])
        return rows, columns, np.concatenate(values)

    def label(self, row: int) -> str:
        """Name of a row in messages."""
        index = int(np.searchsorted(self.starts, row, side="right")) - 1
        batch = self.batches[index]
        return batch.labels[(row - int(self.starts[index])) // batch.size]

    def _lay_curvature(self) -> tuple[Indices, Indices, list[Indices]]:
        rows, columns, keeps = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], []
        for batch in self.batches:
            column = _columns(batch)
            shape = (*column.shape, column.shape[1])
            row = np.broadcast_to(column[:, :, None], shape)
            other = np.broadcast_to(column[:, None, :], shape)
            keep = np.flatnonzero((row < 7 * self.count) & (other < 7 * self.count) & (row >= other))
            keeps.append(keep)
            rows.append(row.ravel()[keep])
            columns.append(other.ravel()[keep])
        return np.concatenate(rows), np.concatenate(columns), keeps


def _columns(batch: Batch) -> Indices:
    """(k, 7 b) columns of the variables of each equation; those of the world come after all others."""
    return (7 * batch.bodies[:, :, None] + np.arange(7)).reshape(len(batch), -1)


class ActiveSystem:
    """A system whose equations do not change; subclasses renew theirs.

    Attributes:
        system: the equations.
        algebra: factorisation for the system's pattern.
        longest: largest motion of any part of a body in a step, metres.
        control: may end the iteration early.
        path: the accepted states (7 n,), where a system records them.
        even: whether goals count alike, whatever their weights.
    """

    path: tuple[Array, ...] = ()
    even = False
    longest = np.inf
    control = Control(np.inf)

    def __init__(self, system: System, algebra: LinearAlgebra) -> None:
        """Take equations that do not change."""
        self.system, self.algebra = system, algebra

    def retract(self, x: Array) -> Array:
        """The variables (7 n,) after a step, projected to valid states."""
        return unit(x)

    def runs_into(self) -> bool:
        """Whether the last retraction has a new contact, which is an inequality now; then the step is repeated."""
        return False

    def passes(self) -> bool:
        """Whether the motion to the last retraction is free; if not, the step is shortened."""
        return True

    def arrive(self, x: Array) -> bool:
        """Renew the equations at x, the end of a step; returns whether their number or pattern changed."""
        return False


def unit(x: Array) -> Array:
    """Copy of the variables (7 n,) with Euler parameters of unit length."""
    bodies = x.reshape(-1, 7).copy()
    bodies[:, 3:] /= np.sqrt((bodies[:, 3:] ** 2).sum(axis=1, keepdims=True))
    result: Array = bodies.ravel()
    return result


REMEMBERED = 32  # cached structures; more = more memory


class Patterns:
    """Systems by what lays them out: each pattern is analysed once while it is remembered; contacts come and go.

    Attributes:
        structures: number of patterns that were analysed.
        laying: processor's time of these analyses [s].
    """

    def __init__(self, count: int, weight: Array, algebra: str) -> None:
        """Take the number of bodies, the weights (7 count,) of the least motion, and the name of the factorisation."""
        self._count, self._weight, self._algebra = count, weight, algebra
        self._known: dict[Hashable, tuple[System, LinearAlgebra]] = {}
        self.structures, self.laying = 0, 0.0

    def system(self, laid: Hashable, batches: Sequence[tuple[Batch, Key]]) -> tuple[System, LinearAlgebra]:
        """The system of these equations and its factorisation; `laid` tells patterns apart."""
        if laid not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            began = time.process_time()
            system = System(self._count, batches, self._weight)
            self._known[laid] = (system, linear_algebra(system.pattern, self._algebra))
            self.structures += 1
            self.laying += time.process_time() - began
        return self._known[laid]
