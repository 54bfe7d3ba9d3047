"""Many problems of one chain at once, the first descents in one compiled loop; others are left to solves."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wholebody.assessment.posture import Judged, Numbers, judged_postures
from wholebody.base.arrays import Array, Indices, Mask, with_values
from wholebody.base.errors import InputError
from wholebody.methods.conclusion import assessed_tolerance
from wholebody.methods.control import Control
from wholebody.methods.qp.chain import Descents
from wholebody.methods.qp.chain_goals_kernel import Goals
from wholebody.methods.qp.chain_problem import Asked, Rule, chains_of, distance_of, goal_entries, how_far
from wholebody.methods.qp.plain_chain import FIRST, PlainChain
from wholebody.methods.qp.settings import SEEDS, Settings
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.distance import Displacement, Effort
from wholebody.tasks.frame import Frame, Orientation, Relative
from wholebody.tasks.point import Point
from wholebody.terms.entries import Entry


class Answers(NamedTuple):
    """What came of k problems; rows of those that are not solved mean nothing."""

    solved: Mask  # (k,)
    q: Array  # (k, nq) postures
    iterations: Indices  # (k,)
    judged: Judged
    seconds: float  # on the clock, for all


class Batch(NamedTuple):
    """Problems that are alike but for numbers."""

    places: list[int]  # (k,) of each among the problems that were given
    problem: Problem  # the first of them
    starts: Array  # (k, nq)
    tables: Array  # (k, e, 36) floats of the goals' entries
    numbers: Numbers
    settings: Settings

    def run(self) -> Answers:
        """Solve what descents of the chain lead to an answer of."""
        control, problem = Control(np.inf), self.problem
        entries = goal_entries(problem) or []
        with chains_of(problem).borrow() as chains, problem.borrow() as workspace:
            chain = chains.carrying(entries)
            assert chain is not None
            first = _First.of(self, chain, entries)
            q, iterations, ended = first.ends()
            judgement = judged_postures(problem, self.numbers, q)
            blocked = ended & ~(judgement.clearance_violation <= 0.0)
            # Where the end of least effort is not free, the next one is looked at while no descent can lead to less.
            turn = blocked.copy()
            for rank in range(1, first.order.shape[1]):
                turn &= blocked & first.complete(rank)
                if not len(some := np.flatnonzero(turn)):
                    break
                q[some] = first.postures(some, rank)
                judgement.put(some, judged_postures(problem, self.numbers.of_some(some), q[some]))
                blocked[some] = ~(judgement.clearance_violation[some] <= 0.0)
            left = np.flatnonzero(~ended | blocked)  # one by one
            ended[left] = False
            for k in left.tolist():
                met = first.descents(k, workspace).run(first.found(k))
                if met is not None and met.complete:
                    q[k], iterations[k], ended[k] = met.q, len(met.trace), True
            if len(left):
                judgement.put(left, judged_postures(problem, self.numbers.of_some(left), q[left]))
        solved = ended & judgement.meets(assessed_tolerance(self.settings.tolerance))
        return Answers(solved, q, iterations, judgement, control.seconds)


def batches(problems: Sequence[Problem], settings: Settings, largest: int) -> list[Batch]:
    """The problems that may be solved at once, in batches of at most so many."""
    groups: dict[Hashable, list[int]] = {}
    known: dict[Hashable, PlainChain | None] = {}
    for place, problem in enumerate(problems if settings.restarts else ()):
        form = _form(problem, known)
        if form is not None:
            groups.setdefault(form, []).append(place)
    made = []
    for group in groups.values():
        for first in range(0, len(group), largest):
            places = group[first : first + largest]
            some = [problems[place] for place in places]
            starts, numbers = np.array([problem.start for problem in some]), Numbers.of(some)
            made.append(Batch(places, some[0], starts, _tables(some[0], numbers), numbers, settings))
    return made


def _form(problem: Problem, known: dict[Hashable, PlainChain | None]) -> Hashable | None:
    """What problems of a batch have in common; None for one that no chain answers. `known` has the chains of forms."""
    scene, goals, measures = problem.scene, problem.goals, problem.measures
    if problem.constraints or problem.bounds or problem.left_out or len(measures) != 1:
        return None
    measure: Any = measures[0]
    if type(measure) not in (Effort, Displacement) or any(type(goal) not in _PLACED for goal in goals):
        return None
    try:
        problem.check_fresh()
    except InputError:
        return None
    kinds = tuple([_kind(goal) for goal in goals])
    form = id(scene), scene.built.moves, kinds, type(measure), measure.weight, measure.distance.weights.tobytes()
    if form not in known:
        entries = goal_entries(problem)
        with chains_of(problem).borrow() as chains:
            chain = None if entries is None else chains.carrying(entries)
        known[form] = chain if chain is None or distance_of(problem, chain) is not None else None
    chain = known[form]
    # The measure of other joints than the chain's depends on the start too.
    own = chain is not None and len(chain.idx_v) < scene.model.nv and distance_of(problem, chain) is None
    return None if chain is None or own else form


_PLACED = frozenset((Point, Frame, Orientation, Relative))


def _kind(goal: Any) -> Hashable:
    """What goals have in common that differ in numbers alone."""
    if type(goal) is Point:
        return Point, goal.weight, goal.place[:2]
    residual = goal.residual
    return type(goal), goal.weight, residual.place[:2], residual.base[:2], residual.position, residual.orientation


def _tables(problem: Problem, numbers: Numbers) -> Array:
    """Floats (k, e, 36) of the entries of goals that ask these numbers; the problem is one of them."""
    tables = np.repeat([[entry.floats for entry in goal_entries(problem) or []]], len(numbers.targets), axis=0)
    tables[:, :, 24:27] = numbers.targets
    for g, goal in enumerate(problem.goals):
        if type(goal) is Point:
            at = goal.place.placement
            tables[:, g, 9:12] = numbers.offsets[:, g] @ at.rotation.T + at.translation
        else:
            tables[:, g, 27:] = numbers.undo[:, g].transpose(0, 2, 1).reshape(-1, 9)
    return tables


@dataclass(frozen=True)
class _First:
    """Where the first descents of a batch end."""

    batch: Batch
    chain: PlainChain
    goals: Goals  # of the first problem
    rule: Rule
    at: Array  # (k, nq) starts, within limits
    nearest: Array  # (k, 2, n) see `chain_kernel.reach`
    angles: Array  # (k, m, n) the ends
    known: Array  # (k, m, 4) what was found there, see `chain_kernel.reach`
    counts: Indices  # (k,) how many
    isolated: bool  # whether no joint moves where the goals are met

    @classmethod
    def of(cls, batch: Batch, chain: PlainChain, entries: list[Entry]) -> _First:
        """Descend from the first seeds of each problem."""
        problem, settings = batch.problem, batch.settings
        limits = problem.scene.figure.limits
        at = batch.starts.copy()
        at[:, limits.idx_q] = np.clip(at[:, limits.idx_q], limits.lower, limits.upper)
        nearest = np.zeros((len(at), 2, len(chain.idx_v)))
        nearest[:, 0] = chain.angles(batch.numbers.references if settings.measures else at)
        if settings.measures:
            nearest[:, 1] = distance_of(problem, chain).weights[chain.idx_v]  # type: ignore[union-attr]
        goals = chain.goals(entries)
        rule = Rule.of(chain, goals, settings, settings.measures)
        together = 0 if rule.guided else rule.together
        ends = np.empty((len(at), together or FIRST, nearest.shape[2]))
        for k in range(len(at) if together else 0):
            ends[k] = next(chain.seeds(chain.angles(at[k]), settings.seed, together))
        found, counts = chain.descents(batch.tables, goals, nearest, how_far(settings, rule.enough), ends, together)
        isolated, rows = nearest.shape[2] <= rule.rows, chain.room(rule.rows).jacobian  # at the last end
        if isolated and not rule.guided:  # rows of several terms may be the same
            isolated = bool(np.linalg.matrix_rank(rows, 1e-3) == nearest.shape[2])  # m, rad a rad
        return cls(batch, chain, goals, rule, at, nearest, ends, found, np.maximum(counts, 0), isolated)

    @cached_property
    def effort(self) -> Array:
        """(k, m) of the ends; infinite where the goals are not met."""
        taken = np.arange(self.known.shape[1]) < self.counts[:, None]
        return np.where(taken, self.known[:, :, 1], np.inf)

    @cached_property
    def order(self) -> Indices:
        """(k, m) the ends from the least effort on."""
        return np.argsort(self.effort, axis=1, kind="stable")

    def ends(self) -> tuple[Array, Indices, Mask]:
        """Postures (k, nq) at ends of least effort, descents (k,), and whether (k,) goals are met there for good."""
        rows, least = np.arange(len(self.at)), self.order[:, 0]
        ended = (self.effort[rows, least] < np.inf) & (self.known[rows, least, 2] != 0.0)
        ended &= ~np.array([self.rule.lacks(count) for count in self.counts.tolist()], dtype=bool)
        if self.rule.measured and not self.rule.guided:  # where few seeds lead to the goals more are compared
            taken = np.arange(self.known.shape[1]) < self.counts[:, None]
            met = taken & (self.known[:, :, 0] <= self.batch.settings.tolerance)
            ended &= met.sum(axis=1) >= SEEDS.compared
        q = self.at.copy()
        q[ended] = self.postures(np.flatnonzero(ended), 0)
        counted = (np.arange(self.known.shape[1]) < self.counts[:, None]) & (self.known[:, :, 3] != 0.0)
        return q, counted.sum(axis=1), ended

    def postures(self, some: Indices, rank: int) -> Array:
        """Postures (s, nq) of some problems at the ends with this rank."""
        return np.asarray(self.chain.posture(self.angles[some, self.order[some, rank]], self.at[some]))

    def complete(self, rank: int) -> Mask:
        """Whether (k,) no descent can lead to less than the end with this rank, where those before it are not free."""
        rows, here = np.arange(len(self.at)), self.order[:, rank]
        effort = self.effort[rows, here]
        near = self.isolated | ~(self.effort[rows, self.order[:, 0]] < SEEDS.worth * effort)
        complete: Mask = near & (effort < np.inf) & (self.known[rows, here, 2] != 0.0)
        return complete

    def found(self, k: int) -> tuple[Array, Array]:
        """The ends (m, n) of one problem, and what was found there (m, 4)."""
        count = self.counts[k]
        return self.angles[k, :count], self.known[k, :count]

    def descents(self, k: int, workspace: Workspace) -> Descents:
        """What goes on from there for one problem."""
        batch = self.batch
        goals = with_values(self.goals, tables=batch.tables[k])
        asked = Asked(goals, self.at[k], self.nearest[k], batch.numbers.clearances[k])
        workspace.begin()
        return Descents(asked, self.chain, self.rule, workspace, batch.settings, Control(np.inf))
