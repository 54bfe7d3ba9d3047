"""Postures of least effort where things are in the way: descents of a chain whose contacts are planes.

The pairs that are near a posture count as half-spaces: a point of one piece stays beyond a plane of the other, both as
they are there. A descent leads to the least effort within, where the pairs are taken anew. What stays where it is keeps
every clearance, and nothing near it has less effort.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, with_values
from wholebody.geometry.proximity import Contacts
from wholebody.methods.qp.along_branches import Look, Nearby
from wholebody.methods.qp.chain_goals_kernel import Goals
from wholebody.methods.qp.settings import SEEDS

MARGIN = 1e-6  # m: beyond clearances
SAME = 1e-5  # rad, m: by which postures differ that count as one


class Planes(NamedTuple):
    """Floats and joints of planes as in `Goals`."""

    tables: Array  # (k, 7)
    joints: Indices  # (k, 2) of the point and of the plane


class AtContacts(Nearby):
    """Postures of a chain that touch things."""

    __slots__ = ()

    def least(self, values: Array, most: float) -> tuple[Look, bool] | None:
        """From values (n,) that meet the goals the free ones of least effort nearby; None where they are not found.

        The second is whether they are a minimum. None too where a descent leads to no less effort than `most`.
        """
        planes, fresh = list[Planes](), True
        for _ in range(SEEDS.closer):
            near = self.workspace.near(self.chain.posture(values, self.at), self.within + SEEDS.ahead)
            gaps = near.distance - self.clearances[near.number]
            # Of what touches along a line or a face one point is the witness, then another: both stay.
            planes = [*planes[-2:], self._planes(near, gaps)]
            end, effort = self._descended(values, planes)
            if effort >= most:
                return None
            free = float(gaps.min(initial=SEEDS.ahead))
            if float(np.abs(end - values).max()) < SAME and free >= 0.0:
                end, _ = self._descended(values, planes[-1:])
                settled = float(np.abs(end - values).max()) < SAME
                if settled or not fresh:
                    return Look(values, effort, free), settled
                planes, fresh = [], False  # those of before held it
            values = end
        return None

    def _descended(self, values: Array, planes: list[Planes]) -> tuple[Array, float]:
        """Values (n,) of least effort beyond planes, and that effort, inf where none are found."""
        end, found = self.descended(self._beyond(planes), values)
        return end, float(found[1]) if found[2] > 0.0 else np.inf

    def _beyond(self, planes: list[Planes]) -> Goals:
        """The goals, with planes."""
        tables, entries = (np.concatenate(parts) for parts in zip(*planes, strict=True))
        goals, rows = self.goals, len(self.goals.one_sided) + np.arange(len(tables))
        return with_values(
            goals,
            plane_tables=np.concatenate([goals.plane_tables, tables]),
            plane_entries=np.concatenate([goals.plane_entries, np.column_stack([rows, entries])]),
            one_sided=np.concatenate([goals.one_sided, np.ones(len(rows), dtype=bool)]),
        )

    def _planes(self, near: Contacts, gaps: Array) -> Planes:
        """Planes of the nearest pairs."""
        chain, joints = self.chain, self.workspace.state.joints
        carriers = chain.carriers[self.workspace.table.joint[near.pair]]  # (k, 2)
        first, last = carriers.T
        some = np.flatnonzero(first != last)
        some = some[np.argsort(gaps[some], kind="stable")[:16]]
        swap = last[some] == 0  # the plane is of what stands around
        sign = np.where(swap, -1.0, 1.0)[:, None]
        base, point = np.where(swap, last[some], first[some]), np.where(swap, first[some], last[some])
        on, off = near.point_a[some], near.point_b[some]
        on, off = np.where(swap[:, None], off, on), np.where(swap[:, None], on, off)
        normal = sign * near.normal[some]
        based, placed = joints[chain.joints[base]], joints[chain.joints[point]]  # (k, 4, 3)
        floats = np.empty((len(some), 7))
        floats[:, :3] = np.einsum("kij,kj->ki", placed[:, :3], off - placed[:, 3])
        floats[:, 3:6] = np.einsum("kij,kj->ki", based[:, :3], normal)
        floats[:, 6] = ((on - based[:, 3]) * normal).sum(axis=1) + self.clearances[near.number[some]] + MARGIN
        return Planes(floats, np.column_stack([point, base]))
