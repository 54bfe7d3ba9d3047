"""Inverse kinematics of a chain of plain joints from many seeds, before anything else is tried (TRAC-IK, 2015).

Seeds are the branches of the closed form of an arm that has one, else the start and random ones: docs/theory/qp.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain as joined
from itertools import islice
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.methods.control import Control
from wholebody.methods.qp.along_branches import Along
from wholebody.methods.qp.at_contacts import AtContacts
from wholebody.methods.qp.chain_problem import Asked, Rule, chains_of, distance_of, goal_entries, how_far, is_free
from wholebody.methods.qp.closed_form import Branches
from wholebody.methods.qp.plain_chain import FIRST, NEARBY, PlainChain, rows_of
from wholebody.methods.qp.settings import SEARCH, SEEDS, Settings
from wholebody.methods.simplification import still_dofs
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.tasks.checks import undefined


class Met(NamedTuple):
    """A posture that meets the goals with everything held."""

    q: Array  # (nq,) posture
    trace: tuple[TraceEntry, ...]  # one entry a descent, but for one that ends where it begins
    stationary: bool  # whether the measures are stationary too
    # (nq,) an end of far less effort that does not keep its clearances; None where there is none
    blocked: Array | None = None
    free: Array | None = None  # (nq,) a posture that does, where q is the start instead, as all ends were blocked
    through: Array | None = None  # (nq,) the end of least effort that does not keep its clearances, where known
    near: tuple[Array, ...] = ()  # where no posture meets the goals: free ones that come near them, q the nearest
    rest: float = 0.0  # least norm of the goals' errors [m, rad] at which descents through things rest then

    @property
    def begins(self) -> tuple[Array, ...]:
        """Postures (nq,) from which descents begin, one after the other until one meets everything."""
        return (self.q,) if self.free is None else (self.q, self.free)

    @property
    def complete(self) -> bool:
        """Whether no descent from here can lead to less."""
        return self.stationary and self.blocked is None and not self.near


def from_seeds(problem: Problem, workspace: Workspace, settings: Settings, control: Control) -> Met | None:
    """A posture that meets the goals with everything held, the best of the first few; None for other terms."""
    entries = goal_entries(problem)
    if entries is None:
        return None
    with chains_of(problem).borrow() as chains:
        chain = chains.carrying(entries)
        if chain is None:
            return None
        chain = chain.still(problem.scene.figure.clamp(problem.start), still_dofs(problem))
        distance = distance_of(problem, chain) if settings.measures else None
        asked = Asked.by(problem, chain, entries, distance)
        rule = Rule.of(chain, asked.goals, settings, distance is not None)
        return Descents(asked, chain, rule, workspace, settings, control).run()


def closed_form_postures(problem: Problem, most: int) -> tuple[Array, bool]:
    """Postures (k, nq) of closed forms that meet placements or nearly do, free or not, and whether they are all.

    Of several arms they are the `most` combinations of least effort, whose number is the product of those of each arm.
    Of seven joints they are those of the least effort along each branch; none where an arm has no closed form.
    """
    entries, none = goal_entries(problem), np.zeros((0, problem.scene.model.nq))
    with chains_of(problem).borrow() as chains:
        whole = None if entries is None else chains.carrying(entries)
        if entries is None or whole is None or problem.bounds or len(whole.idx_v) < problem.scene.model.nv:
            return none, False
        distance = distance_of(problem, whole)
        found, effort, every = problem.scene.figure.clamp(problem.start)[None], np.zeros(1), True
        for chain, own in chains.apart(entries):
            asked = Asked.by(problem, chain, own, distance)
            if not chain.is_guided(asked.goals):
                return none, False
            values = chain.branches(asked.goals, asked.nearest).least
            total = (effort[:, None] + (values - asked.nearest[0]) ** 2 @ asked.nearest[1]).ravel()
            first, branch = np.divmod(total.argsort(kind="stable")[:most], max(len(values), 1))
            every = every and chain.arm is not None and chain.held < 0 and len(first) == len(total)
            found, effort = chain.posture(values[branch], found[first]), total[first * len(values) + branch]
        return found, every


def takes_seeds(problem: Problem) -> bool:
    """Whether the goals and equalities of a problem are those of a chain, which is searched from seeds."""
    entries = goal_entries(problem)
    if entries is None:
        return False
    with chains_of(problem).borrow() as chains:
        return chains.carrying(entries) is not None


class Descents:
    """Descents of one problem from one batch of seeds after the other."""

    def __init__(
        self, asked: Asked, chain: PlainChain, rule: Rule, workspace: Workspace, settings: Settings, control: Control
    ) -> None:  # fmt: skip
        self.asked, self.chain, self.workspace, self.settings, self.control = asked, chain, workspace, settings, control
        self.start, self.rule, self.measured = chain.angles(asked.at), rule, rule.measured
        self.within = float(np.maximum.reduce(asked.clearances, initial=0.0))
        self.trace: list[TraceEntry] = []
        self.met = 0  # ends that meet the goals
        self.least = np.inf  # effort of an end that does not keep its clearances
        self.blocked: Array | None = None
        self.ends: list[tuple[float, Array]] = []  # effort and values (n,) of such ends
        self.tried: list[Array] = []  # those (n,) that were led to contacts
        self.left = np.inf  # least effort of those that are led to no contacts

    def run(self, first: tuple[Array, Array] | None = None) -> Met | None:
        """The answer of the batches in turn: the closed form's ends, its samples, random seeds; `first`: ends known."""
        if not self.settings.restarts:
            return self._ended(self.start[None].copy(), 1)
        guided, held, finite, enough = self.rule[:4]
        if guided:
            ends, found = first or self._first_ended()
            met, branches = self._chosen(ends, found), None
            if self.rule.lacks(len(ends)) or (finite and not len(ends)):  # a singular placement may have no branch
                met = self._or_from_random(met)
            if met is None and not self.control.over:
                branches = self._branches()
                others = branches.least[max(len(ends) - self.chain.first, 0) :]
                met = self._ended(np.concatenate([ends[found[:, 2] < 0.0], others]), enough, others=True)
            if met is None and finite:
                others = self.chain.singular(self.asked.goals, self.asked.nearest)
                if len(others) and (met := self._of_singular(others)) is not None:
                    return met
                loosely = self.chain.loosely_met(self.asked.goals, self.settings.seed)
                return self._nearest(np.concatenate([others, loosely]))
            unsettled = met is not None and self.measured and not met.stationary  # as limits are near
            if (met is not None and met.blocked is None and not unsettled) or finite or self.control.over:
                return met
            # What blocks an end may leave postures of its branch free.
            most = np.inf if met is None else (1.0 if unsettled else SEEDS.worth) * self._effort(met.q)
            q = self._along_branches(branches or self._branches(), most) if held else None
            if q is not None:
                return Met(q, tuple(self.trace), self.measured or not self.settings.measures)
            if met is not None:
                # What a bent arm misses in its effort, descents of the whole problem find.
                # An end of an exact arm that did not come to rest at its limits takes at most a per cent more.
                settled = self.chain.arm is not None and not self.asked.bounded and not self.asked.goals.one_sided.any()
                return with_values(met, blocked=None, stationary=self.measured) if settled else met
            first = None
        best, batches = None, self.chain.seeds(self.start, self.settings.seed, self.rule.together)
        for number, seeds in enumerate(batches, 1):
            if self.measured < self.rule.measured:
                met = self._from_free(seeds)
            elif first is None:
                met = self._ended(seeds, enough)
            else:
                (ends, found), first = first, None
                met = self._chosen(ends, found)
                if met is None and not self.control.over:
                    left = np.concatenate([ends[found[:, 2] < 0.0], seeds[len(ends) :]])
                    met = self._ended(left, enough, others=True)
            met = self._at_contacts(met)
            if met is not None and (best is None or self._effort(met.q) < self._effort(best.q)):
                best = met
            # Where few seeds lead to the goals, the next ones may lead to less effort.
            few = self.measured and self.met < SEEDS.compared and number < SEEDS.sparse
            if (best is not None and not few) or self.control.over:
                return self._lower(best, batches)
            redundant = self.measured and len(self.start) > self.rule.rows
            if number == SEEDS.weighed and redundant and self.blocked is not None:
                self.measured = False  # ends of least effort gather at the same places: of others more are free
        if best is None and guided:
            branches = self._branches()
            return self._nearest(branches.values[branches.effort < np.inf])
        return best

    def _or_from_random(self, met: Met | None) -> Met | None:
        """An end, or one of less effort from the first random seeds."""
        seeds = next(self.chain.seeds(self.start, self.settings.seed, self.rule.together))
        other = self._ended(seeds, max(self.rule.enough, SEEDS.compared))
        if met is None or (other is not None and self._effort(other.q) < self._effort(met.q)):
            return other
        return with_values(met, trace=tuple(self.trace))

    def _along_branches(self, branches: Branches, most: float) -> Array | None:
        """The free posture (nq,) of less effort than `most`, and the least, along the branches; None where none is."""
        goals, at, nearest, clearances, bounded, _ = self.asked
        if bounded or goals.one_sided.any():
            return None  # intervals of branches end where things are in the way, and not where inequalities do
        asked = how_far(self.settings, 1, others=True)
        along = Along(self.chain, goals, at, nearest, clearances, self.within, self.workspace, asked)
        found = along.least(branches, most)
        return None if found is None else self.chain.posture(found.values, at)

    def _at_contacts(self, met: Met | None) -> Met | None:
        """An end, or one of less effort where blocked ends are led to contacts."""
        if not self.measured or self.asked.bounded or self.asked.own or not self.ends or not self._is_redundant():
            return met
        contacts, at = self._contacts(), self.asked.at
        best, most = met, np.inf if met is None else self._effort(met.q)
        before = len(self.tried)
        for effort, values in sorted(self.ends, key=lambda each: each[0]):
            if effort >= SEEDS.worth * most or len(self.tried) == before + SEEDS.near:
                break
            if any(np.abs(values - each).max() < SEEDS.differing for each in self.tried):
                continue
            self.tried.append(values)
            if (found := contacts.least(values, most)) is None:
                self.left = min(self.left, effort)
            else:
                best, most = Met(self.chain.posture(found[0].values, at), tuple(self.trace), found[1]), found[0].effort
        self.ends = []
        if best is None:
            return None
        blocked = self.blocked if self.left < SEEDS.worth * most else None
        return with_values(best, blocked=blocked, through=self.blocked)

    def _lower(self, met: Met | None, batches: Iterator[Array]) -> Met | None:
        """An end, or one of less effort where free postures of more batches are led to contacts."""
        if met is None or met.complete or met.through is None or self.asked.bounded or self.asked.own:
            return met
        contacts, at, tried = self._contacts(), self.asked.at, 0
        most, other = self._effort(met.q if met.free is None else met.free), self.blocked if met.free is None else at
        ends = (values for seeds in islice(batches, SEEDS.sparse) for values in self._free_ends(seeds))
        while tried < (int(SEARCH.dear * np.log(most / self.least)) if self.least > 0.0 else SEEDS.together):
            if (values := next(ends, None)) is None:
                break
            tried += 1
            if (found := contacts.least(values, SEARCH.less * most, SEEDS.radius)) is not None:
                most = found[0].effort
                blocked = other if self.least < SEEDS.worth * most else None
                q = self.chain.posture(found[0].values, at)
                met = Met(q, met.trace, found[1], blocked, through=self.blocked)
        return met

    def _free_ends(self, seeds: Array) -> Iterator[Array]:
        """Values (n,) of free ends of descents without measure from seeds, those of least effort first."""
        goals, at, nearest, *_ = self.asked
        known, asked = (nearest * [[1.0], [0.0]])[None], how_far(self.settings, len(seeds), others=True)
        found, _ = self.chain.descents(goals.tables[None], goals, known, asked, seeds[None], len(seeds))
        effort = np.where(found[0, :, 1] < np.inf, (seeds - nearest[0]) ** 2 @ nearest[1], np.inf)
        for k in effort.argsort()[: np.count_nonzero(effort < np.inf)]:
            if self._is_free(self.chain.posture(seeds[k], at)):
                yield seeds[k]

    def _contacts(self) -> AtContacts:
        goals, at, nearest, clearances, *_ = self.asked
        asked = how_far(self.settings, 1, others=True)
        return AtContacts(self.chain, goals, at, nearest, clearances, self.within, self.workspace, asked)

    def _from_free(self, seeds: Array) -> Met | None:
        """The least effort at contacts from the first free ends of descents without it; None where none is free."""
        (goals, at, nearest, *_), asked = self.asked, how_far(self.settings, len(seeds), others=True)
        known = (nearest * [[1.0], [0.0]])[None]
        found, _ = self.chain.descents(goals.tables[None], goals, known, asked, seeds[None], len(seeds))
        contacts, best, most, tried = self._contacts(), None, np.inf, 0
        for values in seeds[found[0, :, 1] < np.inf]:
            if not self._is_free(q := self.chain.posture(values, at)):
                continue
            tried += 1
            look = None if self.asked.bounded or self.asked.own else contacts.least(values, most)
            if look is not None:
                q = self.chain.posture(look[0].values, at)
                if self.least >= SEEDS.worth * look[0].effort:
                    return Met(q, tuple(self.trace), look[1], through=self.blocked)
            if self._effort(q) < most:
                best, most = Met(at, tuple(self.trace), False, free=q, through=self.blocked), self._effort(q)
            if tried == SEEDS.compared:
                break
        return best

    def _branches(self) -> Branches:
        return self.chain.branches(self.asked.goals, self.asked.nearest)

    def _of_singular(self, others: Array) -> Met | None:
        """A free posture of a singular placement: one of samples (k, n), else beside one that hardly overlaps."""
        at, gaps = self.asked.at, list[float]()
        for values in others:
            if self._is_free(q := self.chain.posture(values, at)):
                return Met(q, tuple(self.trace), False)  # a descent goes on along the others
            gaps.append(self._gaps(q)[0])
        contacts = self._contacts()
        for values in others[np.argsort(gaps)[: -SEEDS.together : -1]]:
            found = None if self.control.over else contacts.least(values, np.inf, SEEDS.radius)
            if found is not None and self._is_free(q := self.chain.posture(found[0].values, at)):
                return Met(q, tuple(self.trace), False)
        return None

    def _nearest(self, inside: Array) -> Met | None:
        """The closest posture where all at the goals overlap, as samples `inside` (k, n) do; None: others may do.

        It is sought from the sample that overlaps least, and from ends of the first seeds that are free.
        """
        # inequalities and terms of one's own reject what is nearest; with such a tolerance farther postures would do
        if self.asked.bounded or self.asked.own or self.settings.tolerance > NEARBY:
            return None
        gaps = np.array([self._gaps(self.chain.posture(each, self.asked.at)) for each in inside]).reshape(-1, 2)
        if self.workspace.model.nv > len(self.start) and (gaps[:, 1] >= 0.0).any():
            return None  # other joints may make room
        seeds, at = next(self.chain.seeds(self.start, self.settings.seed, SEEDS.together)), self.asked.at
        # All of them, although some may meet the goals inside of things.
        found, _ = self._descended(seeds, how_far(self.settings, len(seeds), others=True))
        near, values = [inside[gaps[:, 0].argmax()]] if len(gaps) else [], list[Array]()
        free = (seeds[k] for k in found[:, 0].argsort() if self._is_free(self.chain.posture(seeds[k], at)))
        for each in joined(near, free):
            if all(np.abs(each - other).max() > SEEDS.differing for other in values):
                values.append(each)
            if len(values) == SEEDS.near:
                break
        begins = tuple([self.chain.posture(each, at) for each in values]) or (at,)
        return Met(begins[0], tuple(self.trace), False, near=begins, rest=float(found[:, 0].min()))

    def _descended(self, seeds: Array, asked: Array) -> tuple[Array, int]:
        """What is found (k, 4) from seeds (k, n), which become ends, and how many were taken."""
        goals, _, nearest, *_ = self.asked
        found, counts = self.chain.descents(goals.tables[None], goals, nearest[None], asked, seeds[None], len(seeds))
        return found[0, : counts[0]], int(counts[0])

    def _first_ended(self) -> tuple[Array, Array]:
        """Ends (k, n) of the closed form's branches, and what was found there (k, 4); empty for more than `FIRST`."""
        goals, _, nearest, *_ = self.asked
        ends, asked = np.empty((1, FIRST, len(self.start))), how_far(self.settings, self.rule.enough)
        found, counts = self.chain.descents(goals.tables[None], goals, nearest[None], asked, ends)
        count = max(int(counts[0]), 0)
        return ends[0, :count], found[0, :count]

    def _ended(self, seeds: Array, enough: int, others: bool = False) -> Met | None:
        """The end of least effort that is free, of the first that meet the goals; None where none is."""
        while len(seeds):
            found, taken = self._descended(seeds, how_far(self.settings, enough, others))
            met = self._chosen(seeds[:taken], found)
            if met is not None or self.control.over:
                return met
            left = found[:, 2] < 0.0  # they have their turn where no end is free
            seeds, others = np.concatenate([seeds[:taken][left], seeds[taken:]]), True
        return None

    def _chosen(self, seeds: Array, found: Array) -> Met | None:
        """Of ends (k, n) and what was found there (k, 4) the free one of least effort; None where none is."""
        chain, ends = self.chain, found.tolist()
        for left, _, _, steps in ends:
            self.met += left <= self.settings.tolerance
            if steps and not self.control.reason:
                self.trace.append(TraceEntry(left, 0.0, 0.0, 0.0, "seed"))
                self.control.tell(self.trace[-1])
        for effort, k in sorted((end[1], k) for k, end in enumerate(ends) if end[1] < np.inf):
            q = chain.posture(seeds[k], self.asked.at)
            if self._is_free(q):
                known = bool(ends[k][2]) and (self.measured or not self.settings.measures)
                # Where goals leave no joint free ends are isolated: no descent leads out of what blocks it.
                free = self.least < SEEDS.worth * effort and self._is_redundant()
                return Met(q, tuple(self.trace), known, self.blocked if free else None, through=self.blocked)
            if not self._is_defined(q):
                return Met(self.asked.at, tuple(self.trace), False)  # descents from the start end at the edge
            self.ends.append((effort, seeds[k].copy()))
            self.least, self.blocked = (effort, q) if effort < self.least else (self.least, self.blocked)
        return None

    def _effort(self, q: Array) -> float:
        away = self.chain.angles(q) - self.asked.nearest[0]
        return float(self.asked.nearest[1].dot(away * away))

    def _gaps(self, q: Array) -> tuple[float, float]:
        """The least distance less its clearance at q (nq,) of pairs, and of those no other joint moves; at most 0 m."""
        near = self.workspace.near(q, self.within)
        gaps = near.distance - self.asked.clearances[near.number]
        own = self.chain.alone[self.workspace.table.joint[near.pair]].all(axis=1)
        return float(gaps.min(initial=0.0)), float(gaps[own].min(initial=0.0))

    def _is_free(self, q: Array) -> bool:
        if not (is_free(self.workspace, q, self.asked.clearances, self.within) and self._is_defined(q)):
            return False
        if not self.asked.bounded:
            return True
        state, slack = self.workspace.state.update(q), self.settings.tolerance
        values = ((one, one.value(state)) for one in self.asked.bounded)
        return all(np.all((one.lower - slack <= at) & (at <= one.upper + slack)) for one, at in values)

    def _is_redundant(self) -> bool:
        """Whether joints move where the goals are met: rows of several terms may be the same."""
        goals = self.asked.goals
        rows = self.chain.room(rows_of(goals)).jacobian[~goals.one_sided]  # at the last end
        return len(self.start) > len(rows) or bool(np.linalg.matrix_rank(rows, 1e-3) < len(self.start))  # m, rad a rad

    def _is_defined(self, q: Array) -> bool:
        own = self.asked.own
        return not own or undefined(own, self.workspace.state.update(q)) is None
