"""Sequential quadratic programming over one window: a filter, a trust region, and only the joints that count.

The objective is quadratic in the deviations, so all that a program gets wrong is the bending of contacts. A step is
accepted if the pair of objective and shortfall is not worse in both than one that was there before (Fletcher and
Leyffer 2002, "Nonlinear programming without a penalty function"). Steps along a bent surface are accepted so, which a
merit function refuses.

A degree of freedom joins the programs when it moves a row that is missed or active. The others cannot help: where no
active row has an entry, the deviation that minimises the objective is zero. So this leaves out nothing, and most
programs of a person have ten degrees of freedom a frame instead of 55.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.motion.trajectory.banded_qp import Answer, BandedQP
from wholebody.motion.trajectory.nodes import Node, NodeEvaluator, Rows
from wholebody.motion.trajectory.objective import Objective
from wholebody.motion.trajectory.program import (
    ONE_STEP,
    SOFT,
    Limits,
    active,
    foreseen,
    lay_out,
    likely,
    touched,
    within_reach,
)

RADIUS = 0.25  # rad, m: first trust region; larger = fewer programs on clear ways, more that are refused
LARGEST, SMALLEST = 0.5, 1e-4
WITHIN = 0.1  # m: pairs nearer than this have rows; it is what a radius moves the end of a limb by
MET = 2e-5  # m, rad: a row missed by no more is met; a fifth of what a check allows
HELD = 0.2  # of a missed equality counts: a check allows 1 mm of it, and 0.1 mm of an overlap
STILL = 2e-3  # rad, m: a step no larger ends the iterations where everything is met; larger = rougher optima, faster
GAIN = 5e-3  # share of the objective: a step that brings no more ends them too
PENALTY, HIGHEST = 1e3, 1e6  # 1/m, of a shortfall: first, and most
RAISE = 10.0
HALVED = 0.5  # of a shortfall: a step that leaves more of it than this raises the penalty
SMALL_STEPS = 2  # steps one after the other that bring little and leave as much missed, until the trust region shrinks
STIFFNESS = 1e6  # 1/m^2 and 1/rad^2, of equalities; their multipliers do the rest
EARLY = 10  # steps until an early exit; more = longer where normals mislead, fewer = more other starts
STEPS, STALLED = 3, 0.8  # it also ends where so many steps leave more than this share of the worst shortfall
LOST = 0.01  # m, rad: if it was never less; what was nearer is on the right side, and has contacts that bend
SHRUNK = 0.5  # of its first trust region: a smaller one is an early exit too
FAR = 2e-3  # m, rad: with a shortfall no larger it goes on
ADDED = 2  # solutions of a program by its near rows, before it gets all that are within reach
MARGIN = 1e-2  # of a shortfall: by how much a step must be better than the filter
Cancel = Callable[[int, float], bool]
"""Told the number of steps and the worst shortfall; true ends the iterations."""


class SQPResult(NamedTuple):
    """Deviations that the iterations ended with.

    Attributes:
        x: (n, nv) deviations.
        objective: there, loads beyond their bounds included.
        worst: largest shortfall of any row but of loads, metres or radians.
        met: whether it is at most `MET`.
        programs: how many programs were solved.
        cancelled: whether the caller ended it.
        early: whether it ended early, with much missed still.
        roughly: whether it ended as little was missed, before the objective was least.
    """

    x: Array
    objective: float
    worst: float
    met: bool
    programs: int
    cancelled: bool
    early: bool = False
    roughly: bool = False


class _At(NamedTuple):
    """A point of the iterations."""

    x: Array
    rows: list[Rows]
    objective: float
    total: float
    worst: float


class WindowProgram:
    """One window: what is minimised, what holds, and the iterations.

    Attributes:
        nodes: where rows hold: every frame, and places between frames; more may be added before another `run`.
    """

    def __init__(
        self,
        evaluator: NodeEvaluator,
        objective: Objective,
        limits: Limits,
        solve: Callable[[BandedQP], Answer],
        iterations: int,
    ) -> None:
        """Take what is needed.

        Args:
            evaluator: of the rows at nodes.
            objective: of the window.
            limits: of its deviations.
            solve: solves one program.
            iterations: most steps of one run; a step takes one to three programs.
        """
        self._evaluator, self._objective, self._limits = evaluator, objective, limits
        self._solve, self._iterations = solve, iterations
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
        self,
        x: Array,
        cancel: Cancel,
        radius: float = RADIUS,
        largest: float = LARGEST,
        early_exit: float | None = None,
        rough: bool = False,
    ) -> SQPResult:
        """Iterate from deviations x (n, nv).

        Args:
            x: (n, nv) deviations.
            cancel: told how far it is.
            radius: first trust region.
            largest: largest trust region.
            early_exit: end early where much is missed still and no longer less, or the objective is larger than this,
                for there are other deviations to begin with; None to go on.
            rough: end as soon as little is missed, however much less the objective could be.
        """
        here = self._at(x)
        penalty = PENALTY
        multipliers = [np.zeros(len(one.equal)) for one in here.rows]
        entries: list[tuple[float, float]] = []
        counts = self._counts(here)
        programs, smallest, missed, small_steps = 0, SHRUNK * radius, list[float](), 0
        for number in range(self._iterations):
            missed.append(here.worst)
            if (
                early_exit is not None
                and here.worst > FAR
                and (number >= EARLY or radius < smallest or here.objective > early_exit or _stalled(missed))
            ):
                return SQPResult(here.x, here.objective, here.worst, False, programs, False, True)
            if cancel(number, here.worst):
                return SQPResult(here.x, here.objective, here.worst, here.worst <= MET, programs, True)
            if not counts.any():
                break
            if rough and number and here.worst <= FAR:
                return SQPResult(here.x, here.objective, here.worst, False, programs, False, roughly=True)
            dofs: Indices = np.flatnonzero(counts).astype(np.intp)
            there_x, solved = self._step(here, dofs, radius, penalty, multipliers)
            programs += solved
            step = there_x - here.x
            longest = float(np.abs(step).max(initial=0.0))
            more = self._joined(here, step, counts)
            there = self._at(there_x)
            gained = here.objective - there.objective
            small = longest <= STILL or (abs(gained) <= GAIN * max(here.objective, 1e-9))
            if self._accepted(there, here, entries, gained):
                entries.append(((1.0 - MARGIN) * here.total, here.objective))
                multipliers = [self._shifted(old, one) for old, one in zip(multipliers, there.rows, strict=True)]
                left = there.worst > MET and there.total > HALVED * here.total
                small_steps = small_steps + 1 if left and small else 0
                if left and longest < 0.9 * radius:
                    penalty = min(RAISE * penalty, HIGHEST)
                # nothing is gained and as much is missed, by contacts that bend: shorter steps bend less
                if small_steps >= SMALL_STEPS:
                    radius = 0.5 * min(radius, longest)
                elif longest > 0.9 * radius and not small_steps:
                    radius = min(2.0 * radius, largest)
                here = there
                counts = counts | more | self._counts(here)
                if here.worst <= MET and small and not (more & ~counts).any():
                    break
            elif here.worst <= MET and small and not (more & ~counts).any():
                break  # what a shorter step could bring is less still
            else:
                radius = 0.5 * min(radius, longest)
                if radius < SMALLEST:
                    if here.worst <= MET or penalty >= HIGHEST:
                        break
                    penalty, radius = min(RAISE * penalty, HIGHEST), 0.1 * RADIUS
                    entries.clear()
        return SQPResult(here.x, here.objective, here.worst, here.worst <= MET, programs, False)

    def _step(
        self, here: _At, dofs: Indices, radius: float, penalty: float, multipliers: Sequence[Array]
    ) -> tuple[Array, int]:
        """Deviations (n, nv) after the step of a program, and how many programs were solved for it.

        Most rows within reach stay far from being missed. So a program begins with the near ones. Those that its step
        would miss are added, and it is solved again; the last time it gets all that are within reach.
        """
        possible = [within_reach(one, dofs, radius) for one in here.rows]
        kept = [mask & likely(one, radius) for one, mask in zip(here.rows, possible, strict=True)]
        solved = 0
        while True:
            layout = lay_out(
                self._objective, here.rows, here.x, dofs, self._limits, radius, penalty, multipliers, STIFFNESS, kept
            )
            x, solved = layout.deviations(self._solve(layout.program).z, here.x), solved + 1
            left = [mask & ~keep for mask, keep in zip(possible, kept, strict=True)]
            missed = [
                mask & (foreseen(one, x - here.x) < one.node.room - MET) if mask.any() else mask
                for one, mask in zip(here.rows, left, strict=True)
            ]
            if not any(mask.any() for mask in missed):
                return x, solved
            more = left if solved == ADDED else missed
            kept = [keep | mask for keep, mask in zip(kept, more, strict=True)]

    def _at(self, x: Array) -> _At:
        rows = [self._evaluator.at(node, x, WITHIN) for node in self.nodes]
        shortfalls = [np.concatenate([one.shortfalls, np.abs(one.equal)]) for one in rows if not one.node.soft]
        beyond = SOFT * float(sum(one.shortfalls.sum() for one in rows if one.node.soft))
        past = self._limits.passed(x)
        total = float(sum(one.sum() for one in shortfalls) + past.sum())
        missed = [one.shortfalls for one in rows if not one.node.soft]
        missed += [HELD * np.abs(one.equal) for one in rows]
        worst = max(max((float(one.max(initial=0.0)) for one in missed), default=0.0), float(past.max(initial=0.0)))
        return _At(x, rows, self._objective.value(x) + beyond, total, worst)

    def _accepted(self, there: _At, here: _At, entries: Sequence[tuple[float, float]], gained: float) -> bool:
        """Whether the filter takes a point."""
        if there.worst <= MET:
            return here.worst > MET or gained >= -1e-12 * max(1.0, here.objective)
        known = [*entries, ((1.0 - MARGIN) * here.total, here.objective)]
        return all(
            there.total < total or there.objective < objective - MARGIN * there.total for total, objective in known
        )

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

    def _shifted(self, old: Array, one: Rows) -> Array:
        """Multipliers of equalities, divided by the stiffness."""
        return np.clip(old + one.equal, -0.05, 0.05)


def _stalled(missed: Sequence[float]) -> bool:
    """Whether the last steps brought too little of the worst shortfalls, one for each step; see `STEPS`."""
    if len(missed) <= STEPS or min(missed) <= LOST:
        return False
    before = min(missed[:-STEPS])
    return min(missed[-STEPS:]) > max(STALLED * before, before - ONE_STEP)
