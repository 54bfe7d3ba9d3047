"""Inverse kinematics of a chain of plain joints from many seeds, before anything else is tried.

Where all goals are places and rotations and the joints that carry their frames have one degree of freedom each, damped
least squares from seeds meets the goals in tens of microseconds, and a projection leads to the least effort (TRAC-IK:
P. Beeson, B. Ames, "TRAC-IK: An open-source library for improved solving of generic inverse kinematics", Humanoids
2015). Seeds are the branches of the closed form of an arm that has one, else the start and random ones. An end that
keeps every clearance is an answer; the others are rejected.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody import tasks
from wholebody.base.arrays import Array, with_values
from wholebody.base.pool import Pool
from wholebody.figures.figure import Figure
from wholebody.methods.control import Control
from wholebody.methods.qp.chain_kernel import Goals
from wholebody.methods.qp.closed_form import compiled_kernel as closed_form_kernel
from wholebody.methods.qp.closed_form_kernel import BRANCHES
from wholebody.methods.qp.multistart import Budget
from wholebody.methods.qp.plain_chain import FIRST, NEARBY, Chains, PlainChain
from wholebody.methods.qp.settings import SEEDS
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.tasks.distance import SquaredDistance
from wholebody.terms.entries import RESIDUAL, Entry, entries_of, placement_floats

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class Met(NamedTuple):
    """A posture that meets the goals with everything held."""

    q: Array  # (nq,) posture
    trace: tuple[TraceEntry, ...]  # one entry a descent, but for one that ends where it begins
    stationary: bool  # whether the measures are stationary too
    # (nq,) an end of far less effort that does not keep its clearances; None where there is none
    blocked: Array | None = None
    near: tuple[Array, ...] = ()  # where no posture meets the goals: free ones that come near them, q the nearest

    @property
    def complete(self) -> bool:
        """Whether no descent from here can lead to less."""
        return self.stationary and self.blocked is None and not self.near


def chains_of(problem: Problem) -> Pool[Chains]:
    """What runs on a problem's scene borrow."""
    built, limits = problem.scene.built, problem.scene.figure.limits
    return built.pool(Chains, lambda: Chains(built.model, limits))


def branches(figure: Figure, frame: str, placement: pin.SE3, at: Array) -> Array:
    """Postures (k, nq) with a frame at a placement in the world, by the closed form of the arm that carries it.

    They are within limits, as near to a posture as whole turns allow, and sorted by how far from it. With six joints
    they are all that there are; with seven, samples, some of them off by what limits take away. None where the arm has
    no closed form.

    Args:
        figure: with the arm on a fixed base.
        frame: name of a frame.
        placement: of the frame.
        at: (nq,) posture; other joints stay there.
    """
    model = figure.model
    known = model.frames[figure.frame_id(frame)]
    chain = Chains(model, figure.limits).of(frozenset((known.parentJoint,)))
    if chain is None or chain.arm is None:
        return np.zeros((0, model.nq))
    floats = [placement_floats(known.placement), np.zeros(12), placement.translation, placement.rotation.ravel()]
    goals = Goals(np.concatenate(floats)[None], np.zeros((1, 6), dtype=np.int64))
    near = chain.angles(at)
    found = chain.branches(goals, np.array([near, np.ones_like(near)]))
    return np.array([chain.posture(values, at) for values in found.cheaper(np.inf)]).reshape(-1, model.nq)


def goal_entries(problem: Problem) -> list[Entry] | None:
    """Entries of the goals, where they are places and rotations and nothing else must hold; None otherwise."""
    if problem.constraints or problem.bounds or not problem.goals:
        return None
    found: list[Entry] = []
    for goal in problem.goals:
        entries = entries_of(goal, problem.scene.model)
        if entries is None or any(entry.table != RESIDUAL for entry in entries):
            return None
        found += entries
    return found


def from_seeds(problem: Problem, workspace: Workspace, budget: Budget, control: Control) -> Met | None:
    """A posture that meets the goals with everything held: the first that is found, or of the first few the best.

    Args:
        problem: to be solved.
        workspace: of the run.
        budget: of the method.
        control: is told of every descent.

    Returns:
        None where the figure or the terms are others than those of the module's head, or nothing was found.
    """
    entries = goal_entries(problem)
    if entries is None:
        return None
    with chains_of(problem).borrow() as chains:
        chain = chains.carrying(entries)
        return None if chain is None else _Seeded(problem, chain, entries, workspace, budget, control).run()


class _Seeded:
    """Descents of one run from one batch of seeds after the other."""

    def __init__(
        self, problem: Problem, chain: PlainChain, entries: list[Entry], workspace: Workspace, budget: Budget,
        control: Control,
    ) -> None:  # fmt: skip
        self.problem, self.chain, self.workspace, self.budget, self.control = problem, chain, workspace, budget, control
        self.at = problem.scene.figure.clamp(problem.start)
        self.start = chain.angles(self.at)
        self.distance = distance_of(problem, chain, self.at) if budget.measures else None
        self.nearest = np.zeros((2, len(self.start)))
        self.nearest[0] = self.start
        if self.distance is not None:
            self.nearest[0] = chain.angles(self.distance.reference)
            self.nearest[1] = self.distance.weights[chain.idx_v]
        self.goals, self.rows = chain.goals(entries), sum(entry.rows for entry in entries)
        self.exact = chain.is_exact(entries)
        self.finite = self.exact and chain.held < 0  # ends are isolated, and the closed form has all of them
        self.trace: list[TraceEntry] = []
        self.least = np.inf  # effort of an end that does not keep its clearances
        self.blocked: Array | None = None

    def run(self) -> Met | None:
        """The answer of the batches in turn: the closed form's ends, its samples, and ends of random seeds."""
        if not self.budget.restarts:
            return self._ended(self.start[None].copy())
        more, q = 1 + self.budget.restarts_for_measure, None
        if self.exact:
            near = self.nearest
            if self.distance is None:
                near = np.array([self.start, np.ones_like(self.start)])
            enough = 1 if self.finite else SEEDS.compared * more
            met, branches = self._first_ended(near, enough), None
            if met is None and not self.control.over:
                branches = self.chain.branches(self.goals, near)
                met = self._ended(branches.least, enough)
            if met is not None and not met.stationary and self.distance is not None:
                met = self._along(met)
            if met is None and self.finite:
                return self._nearest() if self._is_out_of_reach() else None
            if (met is not None and met.blocked is None) or self.finite or self.control.over:
                return met
            # What blocks an end may leave postures of its branch free. All samples meet the goals.
            branches = branches or self.chain.branches(self.goals, near)
            most = np.inf if met is None else SEEDS.worth * self._effort(met.q)
            samples = (self.chain.posture(each, self.at) for each in branches.cheaper(most))
            q = next((each for each in samples if self._is_free(each)), None)
            if met is not None:
                return with_values(met, blocked=q)
        for seeds in self.chain.seeds(self.start, self.budget.seed, SEEDS.together * more):
            met = self._ended(seeds, SEEDS.compared * more)
            if met is not None and not met.stationary and self.exact and self.distance is not None:
                met = self._along(met)
            if met is not None or self.control.over:
                return met
            if q is not None:
                return Met(q, tuple(self.trace), False)
        return None

    def _is_out_of_reach(self) -> bool:
        """Whether all postures of six joints at the goal and at those nearby are beyond limits or far inside things."""
        chain, problem = self.chain, self.problem
        if self.budget.tolerance > NEARBY:
            return False  # postures farther from the goal would do
        found = chain.loosely_met(self.goals, self.budget.seed)
        if len(found) and problem.scene.model.nv > len(self.start):
            return False  # others may make room
        for values in found:
            near = self.workspace.near_views(chain.posture(values, self.at), float(problem.clearances.max(initial=0.0)))
            if not (near.distance < problem.clearances[near.number] - SEEDS.deep).any():
                return False
        return True

    def _nearest(self) -> Met:
        """Where descents from the first seeds come nearest to the goals with everything held: a few, which differ."""
        seeds = next(self.chain.seeds(self.start, self.budget.seed, SEEDS.together))
        asked = self._asked(1)
        asked[3:] = len(seeds), 0.0  # all of them, although some may meet the goals inside of things
        given = self.goals.tables[None], self.goals, np.array([[self.nearest, self.nearest]]), asked
        found, _ = self.chain.descents(*given, seeds[None], len(seeds))
        values, near = list[Array](), list[Array]()
        for k in found[0, :, 0].argsort():
            differs = all(np.abs(seeds[k] - each).max() > SEEDS.differing for each in values)
            if differs and self._is_free(q := self.chain.posture(seeds[k], self.at)):
                values.append(seeds[k])
                near.append(q)
            if len(near) == SEEDS.near:
                break
        near = near or [self.at]
        return Met(near[0], tuple(self.trace), False, near=tuple(near))

    def _asked(self, enough: int) -> Array:
        """See `chain_kernel.reach`."""
        budget, enough = self.budget, enough if self.distance is not None else 1
        return np.array([budget.tolerance, SEEDS.damping**2, min(budget.iterations, SEEDS.steps), enough, 1.0])

    def _first_ended(self, near: Array, enough: int) -> Met | None:
        """What `_ended` leads to from the first of the closed form's branches, as near to a posture as they go."""
        ends, nearest = np.empty((1, FIRST, len(self.start))), np.array([[near, self.nearest]])
        found, counts = self.chain.descents(self.goals.tables[None], self.goals, nearest, self._asked(enough), ends)
        count = int(counts[0])
        return self._chosen(ends[0, :count], found[0, :count]) if count > 0 else None

    def _ended(self, seeds: Array, enough: int = 1) -> Met | None:
        """The end of least effort that is free, of the first that meet the goals; None where none is."""
        asked, nearest = self._asked(enough), np.array([[self.nearest, self.nearest]])
        given = self.goals.tables[None], self.goals, nearest, asked
        while count := len(seeds):
            found, counts = self.chain.descents(*given, seeds[None], count)
            taken = int(counts[0])
            met = self._chosen(seeds[:taken], found[0, :taken])
            if met is not None or self.control.over:
                return met
            left = found[0, :taken, 2] < 0.0  # they have their turn where no end is free
            seeds, asked[4] = np.concatenate([seeds[:taken][left], seeds[taken:]]), 0.0
        return None

    def _chosen(self, seeds: Array, found: Array) -> Met | None:
        """Of ends (k, n) and what was found there (k, 4) the free one of least effort; None where none is."""
        chain, ends = self.chain, found.tolist()
        for left, _, _, steps in ends:
            if steps and not self.control.reason:
                self.trace.append(TraceEntry(left, 0.0, 0.0, 0.0, "seed"))
                self.control.tell(self.trace[-1])
        for effort, k in sorted((end[1], k) for k, end in enumerate(ends) if end[1] < np.inf):
            q = chain.posture(seeds[k], self.at)
            if self._is_free(q):
                known = bool(ends[k][2]) and (self.distance is not None or not self.budget.measures)
                # Ends of a chain with as many joints as rows are isolated: no descent leads out of what blocks it.
                free = len(self.start) > self.rows and self.least < SEEDS.worth * effort
                return Met(q, tuple(self.trace), known, self.blocked if free else None)
            self.least, self.blocked = (effort, q) if effort < self.least else (self.least, self.blocked)
        return None

    def _along(self, met: Met) -> Met:
        """An end near singular postures, which programs lead to no least effort from, led there along its branch.

        By golden sections over the joint that the closed form holds, between the samples beside it.
        """
        chain = self.chain
        values, spacing = chain.angles(met.q), np.ptp(chain.held_values(self.nearest[0])) / (SEEDS.samples - 1)
        low, high = values[chain.held] + (-spacing, spacing)
        best = values
        inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)]
        found = [self._nearest_branch(at, values) for at in inner]
        while high - low > 1e-6:
            lower = found[0][0] <= found[1][0]
            low, high = (low, inner[1]) if lower else (inner[0], high)
            at = high - GOLDEN * (high - low) if lower else low + GOLDEN * (high - low)
            new = self._nearest_branch(at, values)
            inner, found = ([at, inner[0]], [new, found[0]]) if lower else ([inner[1], at], [found[1], new])
        effort, best = min(found, key=lambda each: each[0])
        ended = self._ended(best[None].copy()) if effort < np.inf else None
        if ended is not None and self._effort(ended.q) <= self._effort(met.q):
            met = with_values(met, q=ended.q)
        # Where not even this is stationary, branches cross; a descent finds hardly less in a hundred times the time.
        return with_values(met, trace=tuple(self.trace), stationary=True)

    def _nearest_branch(self, held: float, near: Array) -> tuple[float, Array]:
        """Effort and values (n,) of the branch nearest to others, with a value of the held joint; inf for none."""
        chain = self.chain
        found, effort = chain.angles_of(self.goals.tables[0], np.array([held])), np.empty((1, BRANCHES))
        order = np.empty(BRANCHES, dtype=np.intp)
        limits = chain.chain.lower, chain.chain.upper
        count = closed_form_kernel().least(found[None], *limits, self.nearest, effort, order)
        away = np.abs(found[order[:count]] - near).max(axis=1, initial=0.0)
        if not count or away.min() > 1.0:
            return np.inf, near
        k = order[away.argmin()]
        return float(effort[0, k]), found[k]

    def _effort(self, q: Array) -> float:
        away = self.chain.angles(q) - self.nearest[0]
        return float(self.nearest[1].dot(away * away))

    def _is_free(self, q: Array) -> bool:
        return is_free(self.workspace, q, self.problem.clearances)


def is_free(workspace: Workspace, q: Array, clearances: Array) -> bool:
    """Whether every pair keeps its clearance (pairs,) at a posture (nq,)."""
    near = workspace.near_views(q, float(np.maximum.reduce(clearances, initial=0.0)))
    return not len(near.number) or not (near.distance < clearances[near.number]).any()


def distance_of(problem: Problem, chain: PlainChain, at: Array) -> SquaredDistance | None:
    """The measure, where it is one squared distance that the other joints cannot reduce; else None."""
    measures = problem.measures
    if len(measures) != 1 or type(measures[0]) not in (tasks.Effort, tasks.Displacement):
        return None
    distance: SquaredDistance = measures[0].distance  # type: ignore[attr-defined]
    if not distance.weights[chain.idx_v].all():
        return None
    weights = distance.weights.copy()
    weights[chain.idx_v] = 0.0
    if not weights.any():
        return distance
    rest = weights * pin.difference(problem.scene.model, distance.reference, at)
    return None if rest.any() else distance
