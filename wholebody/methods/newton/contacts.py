"""Contacts as inequalities between bodies: a small active set with hysteresis (B3), in slots of fixed pattern."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.geometry.continuous.passing_through import passes_through
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import Coincide
from wholebody.methods.newton.settings import CONTACTS
from wholebody.scene.workspace import Workspace

FAR = 1.0  # m: gap of an unused slot


class ContactSet:
    """The pairs that are inequalities at present, and their rows at a posture.

    Attributes:
        pairs: (k,) indices among the collision pairs.
    """

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
        place[at] = quat.cross(wrench[:, :3], wrench[:, 3:])  # n x (p x n): the point, up to a shift along n
        gap[at] = rows.gap[order] - clearance[rows.contact[order]]
        # a point of both bodies, at the same position now: its gap grows by n . (v_second - v_first)
        first, second = (
            quat.rotate(quat.conjugate(bodies[side, 3:]), place - bodies[side, :3]) for side in (pair[:, 0], pair[:, 1])
        )
        directions, height = normal[:, None], -gap[:, None]
        return Coincide(pair, self._labels, first, second, directions, height)
