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

    def least(self, values: Array, most: float, radius: float = np.inf) -> tuple[Look, bool] | None:
        """From values (n,) that meet the goals the free ones of least effort nearby; None where they are not found.

        The second is whether they are a minimum. None too where a descent leads to no less effort than `most`.
        No joint moves by more than `radius` [rad, m] before pairs are taken anew: a free posture stays in its place.
        """
        planes, fresh, moved, here = list[Planes](), True, np.inf, np.inf
        least: Look | None = None
        for _ in range(SEEDS.closer):
            near = self.workspace.near(self.chain.posture(values, self.at), self.within + SEEDS.ahead)
            gaps = near.distance - self.clearances[near.number]
            free = float(gaps.min(initial=SEEDS.ahead))
            if free >= 0.0 and here < most:
                least, most = Look(values, here, free), here
            # Of what touches along a line or a face one point is the witness, then another: both stay.
            known = planes[-2:] if moved < SEEDS.differing or radius == np.inf else []
            planes = [*known, self._planes(near, gaps)]
            end, effort = self._descended(values, planes, radius)
            if effort == np.inf and known:
                planes = planes[-1:]
                end, effort = self._descended(values, planes, radius)
            moved = float(np.abs(end - values).max())
            if effort == np.inf or (effort >= most and moved < 0.9 * radius and least is None):
                break
            if moved < SAME and free >= 0.0:
                end, _ = self._descended(values, planes[-1:], radius)
                settled = float(np.abs(end - values).max()) < SAME
                if effort > (1.0 + SAME) * most:
                    break
                if settled or not fresh:
                    return Look(values, effort, free), settled
                planes, fresh = [], False  # those of before held it
            values, here = end, effort
            radius = max(1.5 * moved, SEEDS.differing) if radius < np.inf else radius
        return None if least is None else (least, False)

    def _descended(self, values: Array, planes: list[Planes], radius: float) -> tuple[Array, float]:
        """Values (n,) of least effort beyond planes, within a radius, and that effort, inf where none are found."""
        end, found = self.descended(self._beyond(planes), values, radius)
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
        some = (carriers[:, 0] != carriers[:, 1]).nonzero()[0]
        some = some[gaps[some].argsort(kind="stable")[:16]]
        two, swap = carriers[some], (carriers[some, 1] == 0).astype(np.intp)  # the plane is of what stands around
        ends, normal = np.stack((near.point_a, near.point_b)), (1 - 2 * swap)[:, None] * near.normal[some]
        rows, point = np.arange(len(some)), 1 - swap
        on, off, base, point = ends[swap, some], ends[point, some], two[rows, swap], two[rows, point]
        based, placed = joints[chain.joints[base]], joints[chain.joints[point]]  # (k, 4, 3)
        floats = np.empty((len(some), 7))
        floats[:, :3] = (placed[:, :3] @ (off - placed[:, 3])[:, :, None])[:, :, 0]
        floats[:, 3:6] = (based[:, :3] @ normal[:, :, None])[:, :, 0]
        floats[:, 6] = ((on - based[:, 3]) * normal).sum(axis=1) + self.clearances[near.number[some]] + MARGIN
        return Planes(floats, np.stack((point, base), axis=1))
