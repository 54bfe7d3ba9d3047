"""Contacts as inequalities between bodies: a small active set with hysteresis (B3), in slots of fixed pattern."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import Coincide
from wholebody.problem import Problem

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ENTER = 0.03  # m beyond the clearance: nearer pairs become inequalities; larger = more rows, fewer steps made anew
LEAVE = 0.06  # m beyond the clearance: farther pairs are let go; the difference keeps the structure still
SLOTS = 4  # rows a pair: its witness points and the ends of its contact patch
FAR = 1.0  # m: gap of a slot that has no row
OVERLAP = 1e-3  # m: deeper than this a pair that was no inequality sends the step back


class ContactSet:
    """Pairs that are inequalities now, and their rows at a posture.

    Attributes:
        pairs: (k,) places among the collision pairs.
        structures: how often the set has changed.
    """

    def __init__(self, problem: Problem) -> None:
        """Begin without any."""
        self.scene, self.clearances = problem.scene, problem.clearances
        self.pairs: Indices = np.zeros(0, dtype=np.intp)
        self.structures = 0
        self._forced: Indices = np.zeros(0, dtype=np.intp)
        self._largest = float(problem.clearances.max(initial=0.0))
        proximity = problem.scene.proximity
        self._names = problem.scene.piece_names
        self._labels: list[str] = []
        self._joint = proximity.joint[proximity.pairs].reshape(-1, 2)

    def renew(self, data: Any, bodies: Array, world: int) -> tuple[Coincide, bool]:
        """The inequalities at the joints' places in `data` and the bodies (n + 1, 7); whether the pairs changed.

        Args:
            data: Pinocchio's, with joint placements.
            bodies: the same as variables.
            world: index of the world among the bodies.
        """
        contacts = self.scene.proximity.near(data, (FAR if len(self._forced) else LEAVE) + self._largest)
        spare = contacts.distance - self.clearances[contacts.number]
        member = np.zeros(len(self.clearances), dtype=bool)
        member[self.pairs] = True
        keep = (spare < ENTER) | (member[contacts.number] & (spare < LEAVE))
        if len(self._forced):
            keep |= np.isin(contacts.number, self._forced)
        wanted = contacts.number[keep]
        self._forced = self._forced[:0]
        changed = not np.array_equal(wanted, self.pairs)
        if changed:
            self.pairs, self._labels = wanted, []
            self.structures += 1
            names = self._names
            for a, b in self.scene.proximity.pairs[wanted]:
                self._labels += [f"the distance of {names[a]!r} and {names[b]!r}"] * SLOTS
        return self._rows(contacts, bodies, world), changed

    def runs_into(self, data: Any) -> bool:
        """Whether a pair that is no inequality overlaps; the nearest are inequalities from now on."""
        contacts = self.scene.proximity.near(data, self._largest)
        lack = self.clearances[contacts.number] - contacts.distance
        new = contacts.number[lack > OVERLAP]
        if len(new):
            new = np.setdiff1d(new, self.pairs)
        if not len(new):
            return False
        self._forced = new
        return True

    def _rows(self, contacts: Any, bodies: Array, world: int) -> Coincide:
        clearance = self.clearances[contacts.number]
        rows = self.scene.row_builder.rows(contacts, clearance)
        slot_of = np.full(len(self.clearances) + 1, -1, dtype=np.intp)
        slot_of[self.pairs] = np.arange(len(self.pairs))
        slot = slot_of[contacts.number[rows.contact]]
        order = np.lexsort((rows.gap, slot))
        order = order[slot[order] >= 0]
        rank = np.arange(len(order)) - np.searchsorted(slot[order], slot[order])
        order, rank = order[rank < SLOTS], rank[rank < SLOTS]
        at = slot[order] * SLOTS + rank
        count = len(self.pairs) * SLOTS
        joints = np.repeat(self._joint[self.pairs], SLOTS, axis=0)
        pair = np.where(joints == 0, world, joints - 1)[:, ::-1]
        normal = np.zeros((count, 3))
        normal[:, 2] = 1.0
        place = np.zeros((count, 3))
        gap = np.full(count, FAR)
        wrench = rows.wrench[order]
        normal[at] = wrench[:, :3]
        place[at] = quat.cross(wrench[:, :3], wrench[:, 3:])  # n x (p x n): the point, up to a shift along n
        gap[at] = rows.gap[order] - clearance[rows.contact[order]]
        # a point of both bodies, now at the same place: its gap grows by n . (v_second - v_first)
        first, second = (
            quat.rotate(quat.conjugate(bodies[side, 3:]), place - bodies[side, :3]) for side in (pair[:, 0], pair[:, 1])
        )
        directions, height = normal[:, None], -gap[:, None]
        return Coincide(pair, self._labels, first, second, directions, height)
