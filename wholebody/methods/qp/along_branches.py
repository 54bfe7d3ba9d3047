"""Free postures of an arm of seven joints along the branches of its closed form, where things block the least effort.

The joint that the closed form holds moves along a branch, so what is free are intervals of its values. The least effort
is at an end of one: between a sample that is free and one beside it that is blocked, or where a branch ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.qp.chain_kernel import Goals
from wholebody.methods.qp.closed_form import Branches
from wholebody.methods.qp.plain_chain import PlainChain
from wholebody.methods.qp.settings import SEEDS
from wholebody.scene.workspace import Workspace


class Look(NamedTuple):
    """A posture along a branch."""

    values: Array  # (n,) of the joints
    effort: float
    gap: float  # m: least distance of a pair beyond its clearance


class Along(NamedTuple):
    """What a problem asks of an arm of seven joints."""

    chain: PlainChain
    goals: Goals
    at: Array  # (nq,) start
    nearest: Array  # (2, n) see `chain_kernel.reach`
    clearances: Array  # (pairs,) metres
    workspace: Workspace
    asked: Array  # (5,) see `chain_kernel.reach`

    def least(self, branches: Branches, most: float) -> Look | None:
        """The free posture of least effort, if that is less than `most`; the first one where no effort counts."""
        best, held, measured = None, self.chain.held, bool(self.nearest[1].any())
        for values, towards, effort in branches.downhill(held):
            if effort >= most:
                break
            here, share = self._look(values, values[held]), 1.0
            while here is None and share > 0.05:  # the branch begins between the samples
                share *= 0.5
                here = self._look(values, towards + share * (values[held] - towards))
            if here is None or here.gap < 0.0:
                continue
            if measured:
                bottom = towards == values[held]
                here = self._to_the_edge(here, self._least_along(here) if bottom else towards, most)
            if here.effort < most:
                best, most = here, here.effort
        return best

    def _least_along(self, here: Look) -> float:
        """The value of the held joint where the branch has its least effort, blocked or not."""
        end = here.values[None, None].copy()
        self.chain.descents(self.goals.tables[None], self.goals, self.nearest[None], self.asked, end, 1)
        return float(end[0, 0, self.chain.held])

    def _to_the_edge(self, free: Look, end: float, most: float) -> Look:
        """From a free posture on towards a value of the held joint, as far as all is free and less than `most` is left.

        Regula falsi on the least gap (M. Dowell, P. Jarratt, "A modified regula falsi", BIT 11, 1971).
        """
        begin, near, far = free.values[self.chain.held], (0.0, free.gap), (1.0, np.nan)
        for count in range(SEEDS.closer):
            bent = near[1] / (near[1] - far[1]) if far[1] < 0.0 else 0.5
            share = near[0] + (far[0] - near[0]) * min(max(bent, 0.05), 0.95) if count else 1.0
            here, before = self._look(free.values, begin + share * (end - begin)), free.effort
            if here is not None and here.gap >= 0.0:
                free = here if here.effort < before else free
                near, far, gained = (share, here.gap), (far[0], 0.5 * far[1]), before - free.effort
                # halves of the way to where a branch ends gain 0.7 of those before, or less
                last = far[1] != far[1] and gained < max(SEEDS.gain * before, 0.25 * (free.effort - most))
                if share == 1.0 or here.gap <= SEEDS.edge or last:
                    break
            else:
                near, far = (near[0], 0.5 * near[1]), (share, np.nan if here is None else here.gap)
                if here is not None and here.effort >= min(most, (1.0 - SEEDS.gain) * before):
                    break
        return free

    def _look(self, values: Array, held: float) -> Look | None:
        """The posture of a branch near values (n,) with one of the held joint; None where there is none."""
        values = values.copy()
        values[self.chain.held] = held
        # samples are only near to the goals, or were a little beyond limits and clamped to them
        found = self.chain.beside(self.goals, self.nearest, values, self.asked)
        if found is None:
            return None
        within = float(np.maximum.reduce(self.clearances, initial=0.0)) + SEEDS.ahead
        near = self.workspace.near_views(self.chain.posture(found, self.at), within)
        gaps, away = near.distance - self.clearances[near.number], found - self.nearest[0]
        effort = float(self.nearest[1].dot(away * away))
        return Look(found, effort, float(np.minimum.reduce(gaps, initial=SEEDS.ahead)))
