"""Inequalities as equations with one slack each: squared slacks (eq. 15) or a logarithmic barrier (eqs. 13 and 14).

The slack is eliminated: a row ``grad phi . d + M y = -c`` stays in the pattern, whether it is active or not.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from wholebody.base.arrays import Array, Indices, cross
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import Coincide
from wholebody.methods.newton.settings import CONTACTS
from wholebody.scene.workspace import Workspace

FREE = 1e12  # diagonal of an inactive inequality: it is in the pattern, but has no effect
Kind = Literal["slack", "barrier"]
KINDS = ("slack", "barrier")


class SquaredSlacks:
    """phi - Y^2 = 0: where Y is zero the row is an equation; elsewhere its multiplier is zero (2 y Y = 0), and the row.

    The first solution of a step that crosses no inequality releases all slacks with negative multipliers, later ones
    the most negative one, so no active set repeats (Nocedal and Wright 2006, "Numerical Optimization", 16.5).
    """

    def __init__(self, phi: Array) -> None:
        """Begin with the slacks of the values phi (k,); violated inequalities begin at zero."""
        self.slack = np.sqrt(np.maximum(phi, 0.0))
        self.begin(phi)

    def begin(self, phi: Array) -> None:
        """A new step begins at values phi."""
        self._at, self._releases_all = phi, True
        self.slack[phi <= 0.0] = 0.0

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """Right-hand sides and diagonals (k,): a slack at zero gives an equation, any other an inactive row."""
        active = self.slack == 0.0
        return np.where(active, phi, 0.0), np.where(active, 0.0, FREE)

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Set or release slacks as values and multipliers (k,) say: the motion's share, and whether to solve again."""
        active = self.slack == 0.0
        crossing = ~active & (predicted < -1e-9)  # m or rad
        if crossing.any():
            until = np.full(len(active), np.inf)
            at = np.maximum(self._at[crossing], 0.0)
            until[crossing] = at / np.maximum(at - predicted[crossing], 1e-300)
            first = float(until.min())
            self.slack[until <= first + 0.01] = 0.0  # those that become zero soon after the first become active with it
            self._at = self._at + first * (predicted - self._at)
            return first, True
        self._at = predicted
        leave = np.flatnonzero(active & (multiplier < -1e-12))
        if not len(leave):
            return 1.0, False
        if not self._releases_all:
            leave = leave[multiplier[leave].argmin()][None]
        self._releases_all = False
        self.slack[leave] = 1.0
        self._at[leave] = np.maximum(self._at[leave], 0.0)
        return 1.0, True

    def share(self) -> float:
        """Share of the step that keeps the slacks positive: all of it."""
        return 1.0

    def accept(self, share: float, phi: Array) -> None:
        """Slacks away from zero follow their values."""
        active = (self.slack == 0.0) & (phi < 1e-2)  # m or rad: one that is farther is released
        self.slack = np.where(active, 0.0, np.sqrt(np.maximum(phi, 0.0)))

    def finished(self) -> bool:
        """Whether the inequalities allow the iteration to stop: always."""
        return True


class LogBarrier:
    """phi - s = 0 with -mu log s in the objective, mu decreasing to zero; s y = mu linearised in both (primal-dual)."""

    def __init__(self, phi: Array) -> None:
        """Begin with positive slacks; the equation phi = s corrects values phi (k,) that are not positive."""
        self.slack = np.maximum(phi, 1e-2)
        self.barrier = 1e-3
        self.multiplier = self.barrier / self.slack
        self._slack_step = np.zeros(len(phi))
        self._multiplier_step = np.zeros(len(phi))

    def rows(self, phi: Array) -> tuple[Array, Array]:
        """Rows after substitution of the slack's step (mu - s y) / y."""
        return phi - self.slack - self.barrier / self.multiplier, self.slack / self.multiplier

    def begin(self, phi: Array) -> None:
        """Nothing to prepare."""

    def correct(self, predicted: Array, multiplier: Array) -> tuple[float, bool]:
        """Store the steps; no second solution is needed."""
        self._slack_step = (self.barrier - self.slack * multiplier) / self.multiplier
        self._multiplier_step = multiplier - self.multiplier
        return 1.0, False

    def share(self) -> float:
        """As far as slacks stay positive."""
        return _to_boundary(self.slack, self._slack_step)

    def accept(self, share: float, phi: Array) -> None:
        """Move slacks and multipliers, and lower the barrier."""
        self.slack = self.slack + share * self._slack_step
        self.multiplier = self.multiplier + _to_boundary(self.multiplier, self._multiplier_step) * self._multiplier_step
        self.barrier = max(0.15 * self.barrier, 1e-12)  # a faster fall takes fewer steps, which are less centred

    def finished(self) -> bool:
        """Whether all products of slack and multiplier are small [m]."""
        return len(self.slack) == 0 or float((self.slack * self.multiplier).max()) <= 1e-10


def _to_boundary(values: Array, step: Array) -> float:
    """Share of a step (k,) that keeps positive values (k,) positive: at most 0.95 of the distance to the boundary."""
    falling = step < 0.0
    return float(min(1.0, (-0.95 * values[falling] / step[falling]).min(initial=1.0)))


Inequalities = SquaredSlacks | LogBarrier
"""State of the inequalities phi >= 0 during an iteration."""


def inequalities(kind: Kind, phi: Array) -> Inequalities:
    """The first state at values phi (k,)."""
    return LogBarrier(phi) if kind == "barrier" else SquaredSlacks(phi)


FAR = 1.0  # m: gap of an unused slot


class ContactSet:
    """The pairs (k,), among the collision pairs, that are inequalities at present, and their rows at a posture."""

    def __init__(self, clearances: Array, workspace: Workspace) -> None:
        """Make an empty set of pairs whose least distances are `clearances` (pairs,), metres."""
        self.workspace, self.clearances = workspace, clearances
        self.pairs: Indices = np.zeros(0, dtype=np.intp)
        self._forced: Indices = np.zeros(0, dtype=np.intp)
        self._largest = float(clearances.max(initial=0.0))
        self._within = CONTACTS.leave + self._largest
        table = workspace.table
        self._names = tuple(piece.name for piece in workspace.geometry.geometryObjects)
        self._labels: list[str] = []
        self._joint = table.joint[table.pairs].reshape(-1, 2)
        thin = np.array([swept.width for swept in table.swept])[table.pairs].reshape(-1, 2).min(axis=1)
        self._bearable = np.minimum(CONTACTS.deepest, CONTACTS.shallow * thin)
        self._here: QueryResult | None = None
        self._there: QueryResult | None = None

    def measure(self, data: Any) -> None:
        """Measure at the joints' places in `data` (Pinocchio's), where a step leads."""
        self._there = QueryResult(self.workspace.proximity.query(data, self._within), self._within)

    def runs_into(self) -> bool:
        """Whether a pair that is no inequality overlaps at the end of the step; such pairs become inequalities."""
        assert self._there is not None
        contacts = self._there.contacts
        violation = self.clearances[contacts.number] - contacts.distance
        new = contacts.number[violation > CONTACTS.overlap]
        if len(new):
            new = np.setdiff1d(new, self.pairs)
        if not len(new):
            return False
        self._forced = new
        return True

    def passes(self, before: Array, after: Array) -> bool:
        """Whether a step between two postures (nq,) neither jumps over something nor ends deep in it."""
        assert self._here is not None
        assert self._there is not None
        here, there = self._here.contacts, self._there.contacts
        depth = np.zeros(len(self.clearances))
        depth[here.number] = np.maximum(-here.distance, 0.0)
        allowed = np.maximum(depth + CONTACTS.more, self._bearable)
        if (-there.distance > allowed[there.number]).any():
            return False
        return not passes_through(self.workspace, self._here, self._there, before, after)

    def renew(self, data: Any, bodies: Array) -> Coincide:
        """The inequalities at the posture of the last `measure`, in Pinocchio's data and as bodies (n + 1, 7)."""
        assert self._there is not None
        self._here = self._there
        contacts = self._here.contacts
        if len(self._forced) and not np.isin(self._forced, contacts.number).all():
            contacts = self.workspace.proximity.query(data, FAR + self._largest)
        spare = contacts.distance - self.clearances[contacts.number]
        member = np.zeros(len(self.clearances), dtype=bool)
        member[self.pairs] = True
        keep = (spare < CONTACTS.enter) | (member[contacts.number] & (spare < CONTACTS.leave))
        if len(self._forced):
            keep |= np.isin(contacts.number, self._forced)
        wanted = contacts.number[keep]
        self._forced = self._forced[:0]
        if not np.array_equal(wanted, self.pairs):
            self.pairs, self._labels = wanted, []
            names = self._names
            for a, b in self.workspace.table.pairs[wanted]:
                self._labels += [f"the distance of {names[a]!r} and {names[b]!r}"] * CONTACTS.slots
        return self._rows(contacts, bodies)

    def _rows(self, contacts: Any, bodies: Array) -> Coincide:
        clearance = self.clearances[contacts.number]
        rows = self.workspace.rows.rows(contacts, clearance)
        slot_of = np.full(len(self.clearances) + 1, -1, dtype=np.intp)
        slot_of[self.pairs] = np.arange(len(self.pairs))
        slot = slot_of[contacts.number[rows.contact]]
        order = np.lexsort((rows.gap, slot))
        order = order[slot[order] >= 0]
        rank = np.arange(len(order)) - np.searchsorted(slot[order], slot[order])
        order, rank = order[rank < CONTACTS.slots], rank[rank < CONTACTS.slots]
        at = slot[order] * CONTACTS.slots + rank
        count = len(self.pairs) * CONTACTS.slots
        pair = np.repeat(self._joint[self.pairs], CONTACTS.slots, axis=0)[:, ::-1] - 1
        normal = np.zeros((count, 3))
        normal[:, 2] = 1.0
        place = np.zeros((count, 3))
        gap = np.full(count, FAR)
        wrench = rows.wrench[order]
        normal[at] = wrench[:, :3]
        place[at] = cross(wrench[:, :3], wrench[:, 3:])  # n x (p x n): the point, up to a shift along n
        gap[at] = rows.gap[order] - clearance[rows.contact[order]]
        # a point of both bodies, at the same position now: its gap grows by n . (v_second - v_first)
        first, second = (
            quat.rotate(quat.conjugate(bodies[side, 3:]), place - bodies[side, :3]) for side in (pair[:, 0], pair[:, 1])
        )
        directions, height = normal[:, None], -gap[:, None]
        return Coincide(pair, self._labels, first, second, directions, height)
