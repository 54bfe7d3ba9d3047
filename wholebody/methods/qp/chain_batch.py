"""Many problems of one chain at once, the first descents in one compiled loop; others are left to solves."""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np

from wholebody.assessment.postures import Judged, Numbers, judged
from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.errors import InputError
from wholebody.methods.conclusion import assessed_tolerance
from wholebody.methods.control import Control
from wholebody.methods.qp.chain import Asked, Descents, Rule, chains_of, distance_of, goal_entries, how_far
from wholebody.methods.qp.chain_kernel import Goals
from wholebody.methods.qp.multistart import Budget
from wholebody.methods.qp.plain_chain import FIRST, PlainChain
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
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
    budget: Budget

    def run(self) -> Answers:
        """Solve what descents of the chain lead to an answer of."""
        began = time.perf_counter()
        problem = self.problem
        entries = goal_entries(problem) or []
        with chains_of(problem).borrow() as chains, problem.borrow() as workspace:
            chain = chains.carrying(entries)
            assert chain is not None
            q, iterations, found = _answers(self, chain, entries, workspace)
        judgement = judged(problem, self.numbers, q)
        solved = found & judgement.meets(assessed_tolerance(self.budget.tolerance))
        return Answers(solved, q, iterations, judgement, time.perf_counter() - began)


def batches(problems: Sequence[Problem], budget: Budget, largest: int) -> list[Batch]:
    """The problems that may be solved at once, in batches of at most so many."""
    groups: dict[Hashable, list[tuple[int, Array]]] = {}
    known: dict[Hashable, PlainChain | None] = {}
    for place, problem in enumerate(problems):
        found = _form(problem, known) if budget.restarts else None
        if found is not None:
            groups.setdefault(found[0], []).append((place, found[1]))
    made = []
    for group in groups.values():
        for first in range(0, len(group), largest):
            places, tables = zip(*group[first : first + largest], strict=True)
            some = [problems[place] for place in places]
            starts = np.array([problem.start for problem in some])
            made.append(Batch(list(places), some[0], starts, np.array(tables), Numbers.of(some), budget))
    return made


def _form(problem: Problem, known: dict[Hashable, PlainChain | None]) -> tuple[Hashable, Array] | None:
    """What problems of a batch have in common, and the floats (e, 36) of a problem's goals; None without a chain."""
    entries = goal_entries(problem)
    if entries is None or problem.left_out:
        return None
    try:
        problem.check_fresh()
    except InputError:
        return None
    scene, kinds = problem.scene, tuple([(entry.integers, entry.rows) for entry in entries])
    key: Hashable = id(scene.built), kinds
    if key not in known:
        with chains_of(problem).borrow() as chains:
            known[key] = chains.carrying(entries)
    chain = known[key]
    distance = None if chain is None else distance_of(problem, chain)
    if distance is None:
        return None
    goals = tuple([(type(goal), goal.weight) for goal in problem.goals])
    form = id(scene), scene.built.moves, goals, kinds, distance.weights.tobytes(), problem.measures[0].weight
    return form, np.array([entry.floats for entry in entries])


def _answers(
    batch: Batch, chain: PlainChain, entries: list[Entry], workspace: Workspace
) -> tuple[Array, Indices, Mask]:
    """Postures (k, nq), descents (k,), and which (k,) are free and of the least effort."""
    problem, budget, numbers = batch.problem, batch.budget, batch.numbers
    limits = problem.scene.figure.limits
    at = batch.starts.copy()
    at[:, limits.idx_q] = np.clip(at[:, limits.idx_q], limits.lower, limits.upper)
    nearest = np.zeros((len(at), 2, len(chain.idx_v)))
    nearest[:, 0] = chain.angles(numbers.references if budget.measures else at)
    if budget.measures:
        nearest[:, 1] = distance_of(problem, chain).weights[chain.idx_v]  # type: ignore[union-attr]
    goals = chain.goals(entries)
    rule = Rule.of(chain, goals, budget, budget.measures)
    together = 0 if rule.exact else rule.together
    ends = np.empty((len(at), together or FIRST, nearest.shape[2]))
    for k in range(len(at) if together else 0):
        ends[k] = next(chain.seeds(chain.angles(at[k]), budget.seed, together))
    found, counts = chain.descents(batch.tables, goals, nearest, how_far(budget, rule.enough), ends, together)
    q, iterations, solved = at.copy(), np.zeros(len(at), dtype=np.intp), np.zeros(len(at), dtype=bool)
    control = Control(np.inf)
    for k, count in enumerate(counts.tolist()):
        asked = Asked(Goals(batch.tables[k], goals.entries), at[k], nearest[k], numbers.clearances[k])
        workspace.begin()
        count = max(count, 0)
        met = Descents(asked, chain, rule, workspace, budget, control).run((ends[k, :count], found[k, :count]))
        if met is not None and met.complete:
            q[k], iterations[k], solved[k] = met.q, len(met.trace), True
    return q, iterations, solved
