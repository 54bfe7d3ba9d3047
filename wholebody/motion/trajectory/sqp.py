"""Sequential quadratic programming over one window: a filter, a trust region, and only the joints that count.

A step is accepted if the pair of objective and shortfall is not worse in both than one that was there before (Fletcher
and Leyffer 2002, "Nonlinear programming without a penalty function"): so are steps along bent contacts.

A degree of freedom joins the programs when it moves a row that is missed or active. The others cannot help: where no
active row has an entry, the deviation that minimises the objective is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.motion.trajectory.deviations import Objective
from wholebody.motion.trajectory.interior_point import minimise
from wholebody.motion.trajectory.nodes import MET, Node, NodeEvaluator, Rows
from wholebody.motion.trajectory.program import (
    ONE_STEP,
    SOFT,
    Limits,
    Step,
    active,
    lay_out,
    likely,
    predicted,
    touched,
    within_reach,
)

FAR = 2e-3  # m, rad: with a shortfall no larger, a run that may end early goes on

Cancel = Callable[[int, float], bool]
"""Called with the number of steps and the worst shortfall; true ends the iterations."""


RADIUS = 0.25  # rad, m: first trust region; larger = fewer programs on clear paths, more that are refused
HIGHEST = 1e6  # 1/m: penalty of a shortfall, at most


class End(Enum):
    """Why iterations ended: at an optimum or at their last step, in vain, or by the caller."""

    LAST = "last"
    EARLY = "early"
    CANCELLED = "cancelled"


class SQPResult(NamedTuple):
    """Deviations that the iterations ended with."""

    x: Array  # (n, nv) deviations
    objective: float  # there, loads beyond their bounds included
    worst: float  # largest shortfall of any row but of loads, metres or radians
    programs: int  # how many programs were solved
    end: End = End.LAST  # why they ended

    @property
    def met(self) -> bool:
        """Whether all rows are met."""
        return self.worst <= MET


class _At(NamedTuple):
    x: Array
    rows: list[Rows]
    objective: float
    total: float
    worst: float


class _Filter:
    """Which points are accepted, and the trust region and penalty that follow from this."""

    def __init__(self, radius: float | None, largest: float | None) -> None:
        self.radius = RADIUS if radius is None else radius
        self._largest = 0.5 if largest is None else largest
        # 1/m; it is raised tenfold where a step leaves more than half of a shortfall
        self.penalty = 1e3
        self._entries: list[tuple[float, float]] = []

    def takes(self, there: _At, here: _At) -> bool:
        """Whether the filter takes a point."""
        if there.worst <= MET:
            gained = here.objective - there.objective
            return here.worst > MET or gained >= -1e-12 * max(1.0, here.objective)
        known = [*self._entries, (0.99 * here.total, here.objective)]
        return all(there.total < total or there.objective < least - 1e-2 * there.total for total, least in known)

    def accept(self, here: _At, there: _At, longest: float) -> None:
        """Adapt to a step that was taken."""
        self._entries.append((0.99 * here.total, here.objective))
        if there.worst > MET and there.total > 0.5 * here.total and longest < 0.9 * self.radius:
            self.penalty = min(10.0 * self.penalty, HIGHEST)
        if longest > 0.9 * self.radius:
            self.radius = min(2.0 * self.radius, self._largest)

    def refuse(self, longest: float) -> bool:
        """Shorten steps after one that was not taken; whether there is another one to try."""
        self.radius = 0.5 * min(self.radius, longest)
        return self.radius >= 1e-4  # rad, m


class WindowProgram:
    """One window: what is minimised, the `nodes` where rows hold, to which more may be added, and the iterations."""

    def __init__(self, evaluator: NodeEvaluator, objective: Objective, limits: Limits, iterations: int) -> None:
        """Take what is needed; a run has at most so many steps, of one to three programs each."""
        self._evaluator, self._objective, self._limits = evaluator, objective, limits
        self._iterations = iterations
        self.nodes = evaluator.nodes()
        self._free = (limits.lower < limits.upper).any(axis=0)

    @property
    def between(self) -> tuple[Node, ...]:
        """The places between frames."""
        return tuple(node for node in self.nodes if node.share)

    def add(self, nodes: Sequence[Node]) -> None:
        """More places to look at."""
        self.nodes = sorted({*self.nodes, *nodes})

    def run(
        self, x: Array, cancel: Cancel, radius: float | None = None, largest: float | None = None,
        early: bool = False,
    ) -> SQPResult:  # fmt: skip
        """Iterate from x (n, nv) in trust regions; `early` ends where ten steps leave much missed."""
        here, filter_, programs, missed = self._at(x), _Filter(radius, largest), 0, list[float]()
        multipliers = [np.zeros(len(one.equal)) for one in here.rows]
        counts, smallest = self._counts(here), 0.5 * filter_.radius
        for number in range(self._iterations):
            missed.append(here.worst)
            vain = number >= 10 or filter_.radius < smallest or _stalled(missed)
            if early and here.worst > FAR and vain:
                return SQPResult(here.x, here.objective, here.worst, programs, End.EARLY)
            if cancel(number, here.worst):
                return SQPResult(here.x, here.objective, here.worst, programs, End.CANCELLED)
            if not counts.any():
                break
            dofs: Indices = np.flatnonzero(counts).astype(np.intp)
            there_x, solved = self._step(here, dofs, filter_, multipliers)
            programs += solved
            step = there_x - here.x
            longest = float(np.abs(step).max(initial=0.0))
            more, there = self._joined(here, step, counts), self._at(there_x)
            gained = abs(here.objective - there.objective)
            # rad and m, and a share of the objective, that are no gain: larger = rougher optima, faster
            small = longest <= 2e-3 or gained <= 5e-3 * max(here.objective, 1e-9)
            taken = filter_.takes(there, here)
            if taken:
                filter_.accept(here, there, longest)
                multipliers = [
                    np.clip(old + one.equal, -0.05, 0.05) for old, one in zip(multipliers, there.rows, strict=True)
                ]
                here = there
                counts = counts | more | self._counts(here)
            if here.worst <= MET and small and not (more & ~counts).any():
                break  # what another step could bring is less still
            if not taken and not filter_.refuse(longest):
                break
        return SQPResult(here.x, here.objective, here.worst, programs)

    def _step(self, here: _At, dofs: Indices, filter_: _Filter, multipliers: Sequence[Array]) -> tuple[Array, int]:
        """Deviations (n, nv) after the step of a program, and how many programs were solved for it."""
        # It begins with the near rows; those that its step would miss are added, the third time all within reach.
        possible = [within_reach(one, dofs, filter_.radius) for one in here.rows]
        kept = [mask & likely(one, filter_.radius) for one, mask in zip(here.rows, possible, strict=True)]
        solved = 0
        while True:
            step = Step(
                here.x, here.rows, dofs, filter_.radius, filter_.penalty, multipliers, kept, self._evaluator.tree
            )
            layout = lay_out(self._objective, self._limits, step)
            x, solved = layout.deviations(minimise(layout.program).z, here.x), solved + 1
            left = [mask & ~keep for mask, keep in zip(possible, kept, strict=True)]
            missed = [
                mask & (predicted(one, x - here.x) < one.asked - MET) if mask.any() else mask
                for one, mask in zip(here.rows, left, strict=True)
            ]
            if not any(mask.any() for mask in missed):
                return x, solved
            more = left if solved == 2 else missed
            kept = [keep | mask for keep, mask in zip(kept, more, strict=True)]

    def _at(self, x: Array) -> _At:
        """The rows at deviations, the objective and the shortfalls; a fifth of what an equality misses counts."""
        rows = [self._evaluator.at(node, x, 0.1) for node in self.nodes]  # m: what a radius moves the end of a limb by
        beyond = SOFT * float(sum(one.shortfalls.sum() for one in rows if one.node.soft))
        past, hard = self._limits.passed(x), [one for one in rows if not one.node.soft]
        total = float(sum(one.shortfalls.sum() + np.abs(one.equal).sum() for one in hard) + past.sum())
        # a check allows 1 mm of an equality, and 0.1 mm of an overlap
        missed = [past, *(one.shortfalls for one in hard), *(0.2 * np.abs(one.equal) for one in rows)]
        worst = max(float(one.max(initial=0.0)) for one in missed)
        return _At(x, rows, self._objective.value(x) + beyond, total, worst)

    def _counts(self, here: _At) -> Mask:
        """(nv,) degrees of freedom that move what is missed, or are away from zero."""
        missed = [one.gap < 0.0 for one in here.rows]
        found = touched(here.rows, missed) | (here.x != 0.0).any(axis=0)
        found |= (self._limits.passed(here.x) > 0.0).any(axis=0)
        return self._with_equalities(here.rows, found & self._free)

    def _joined(self, here: _At, step: Array, counts: Mask) -> Mask:
        """(nv,) degrees of freedom that move what a step makes active by those that count already."""
        tight = [
            mask & np.any([(part[:, counts] != 0.0).any(axis=1) for part in one.parts], axis=0)
            for one, mask in zip(here.rows, active(here.rows, step), strict=True)
        ]
        return self._with_equalities(here.rows, touched(here.rows, tight) & self._free)

    def _with_equalities(self, rows: Sequence[Rows], found: Mask) -> Mask:
        """The same with the degrees of freedom of equalities that some of them move."""
        while True:
            more = found.copy()
            for one in rows:
                if len(one.equal):
                    moved = (one.equal_rows[:, found] != 0.0).any(axis=1) | (np.abs(one.equal) > MET)
                    more |= (one.equal_rows[moved] != 0.0).any(axis=0) & self._free
            if (more == found).all():
                return found
            found = more


def _stalled(missed: Sequence[float]) -> bool:
    """Whether the last three steps left more than 80 % of the worst shortfall, and brought less than they asked for."""
    if len(missed) <= 3 or min(missed) <= 0.01:
        return False
    before = min(missed[:-3])
    return min(missed[-3:]) > max(0.8 * before, before - ONE_STEP)
