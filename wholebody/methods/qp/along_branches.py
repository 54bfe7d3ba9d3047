"""Free postures of an arm of seven joints along the branches of its closed form, where things block the least effort.

The joint that the closed form holds moves along a branch, so what is free are intervals of its values. The least effort
is at an end of one: between a sample that is free and one beside it that is blocked, or where a branch ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.chain_goals_kernel import Goals
from wholebody.methods.qp.closed_form import Branches
from wholebody.methods.qp.plain_chain import PlainChain
from wholebody.methods.qp.settings import SEEDS
from wholebody.scene.workspace import Workspace


class Look(NamedTuple):
    """A posture along a branch."""

    values: Array  # (n,) of the joints
    effort: float
    gap: float  # m: least distance of a pair beyond its clearance, where negative of one pair


class Nearby(NamedTuple):
    """What a problem asks of a chain, of which postures of less effort are sought."""

    chain: PlainChain
    goals: Goals
    at: Array  # (nq,) start
    nearest: Array  # (2, n) see `chain_kernel.reach`
    clearances: Array  # (pairs,) metres
    within: float  # m: the largest of them
    workspace: Workspace
    asked: Array  # (5,) see `chain_kernel.reach`

    def descended(self, goals: Goals, values: Array, radius: float = np.inf) -> tuple[Array, Array]:
        """The end (n,) of a descent from values (n,) to the least effort at goals, and what was found there (4,).

        No joint moves by more than a radius.
        """
        end = values[None, None].copy()
        chain = self.chain if radius == np.inf else self.chain.within(values - radius, values + radius)
        found, _ = chain.descents(goals.tables[None], goals, self.nearest[None], self.asked, end, 1)
        return end[0, 0], found[0, 0]


class Along(Nearby):
    """Branches of an arm of seven joints."""

    __slots__ = ()

    def least(self, branches: Branches, most: float) -> Look | None:
        """The free posture of least effort, if that is less than `most`; the first one where no effort counts."""
        best, measured, held, blocked = None, bool(self.nearest[1].any()), self.chain.held, -1
        order, bottoms = self.chain.downhill(branches, most)
        together = 8  # of which branches are followed at once; more: less time in Python, more for what is not needed
        for begin in range(0, len(order), together):
            some = order[begin : begin + together]
            samples, towards = branches.values[some], bottoms[begin : begin + together, 0].copy()
            ends, efforts = self._along(samples, towards, most)
            for k, (first, last) in enumerate(efforts.tolist()):
                if bottoms[begin + k, 1] >= most:
                    return best
                bottom = towards[k] == samples[k, held]
                least = bottoms[begin + k, 1] if bottom and first < np.inf else min(first, last)
                if least >= most or some[k] == blocked:  # a sample that is alone in its branch comes twice
                    continue
                here = self._look(ends[k, 0], first)
                if here.gap < 0.0:
                    blocked = some[k] if here.values[held] == samples[k, held] else -1
                    continue
                if measured:
                    end, last = self._least_along(here.values) if bottom else (ends[k, 1], last)
                    here = self._to_the_edge(here, end, last, most)
                if here.effort < most:
                    best, most = here, here.effort
        return best

    def _along(self, samples: Array, towards: Array, most: float) -> tuple[Array, Array]:
        asked = SEEDS.gain, most, SEEDS.closer
        return self.chain.along(self.goals, self.nearest, self.asked, samples, towards, asked)

    def _least_along(self, here: Array) -> tuple[Array, float]:
        """The posture (n,) where a branch has its least effort, blocked or not, and that effort."""
        end, found = self.descended(self.goals, here)
        return end, float(found[1])

    def _to_the_edge(self, free: Look, end: Array, last: float, most: float) -> Look:
        """From a free posture on towards an end (n,) of its branch, as far as all is free and less than `most` is left.

        Regula falsi on the least gap (M. Dowell, P. Jarratt, "A modified regula falsi", BIT 11, 1971).
        """
        held, near, far, share = self.chain.held, (0.0, free.gap), (1.0, np.nan), 1.0
        begin, size = free.values[held], end[held] - free.values[held]
        for _ in range(SEEDS.closer):
            if last >= min(most, (1.0 - SEEDS.gain) * free.effort):
                break
            here = self._look(end, last) if last < np.inf else None
            if here is not None and here.gap >= 0.0:
                free, near, far = here, (share, here.gap), (far[0], 0.5 * far[1])
                if share == 1.0 or here.gap <= SEEDS.edge:
                    break
            else:
                near, far = (near[0], 0.5 * near[1]), (share, np.nan if here is None else here.gap)
            bent = near[1] / (near[1] - far[1]) if far[1] < 0.0 else 0.5
            share = near[0] + (far[0] - near[0]) * min(max(bent, 0.05), 0.95)
            end = free.values.copy()
            end[held] = begin + share * size
            ends, efforts = self._along(end[None], end[[held]], most)
            end, last = ends[0, 0], float(efforts[0, 0])
        return free

    def _look(self, values: Array, effort: float) -> Look:
        """A posture (n,), and how much room it has."""
        gap = self.workspace.least_gap(self.chain.posture(values, self.at), self.clearances, self.within + SEEDS.ahead)
        return Look(values, effort, min(gap, SEEDS.ahead))
