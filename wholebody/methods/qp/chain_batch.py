"""Many problems of one chain at once: those whose first descents lead to an answer, in one compiled loop.

What it answers is what `chain.from_seeds` leads to for each problem alone. All others are left to a solve of their own.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np

from wholebody.assessment.postures import Judged, Numbers, judged
from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.errors import InputError
from wholebody.methods.conclusion import assessed_tolerance
from wholebody.methods.qp.chain import chains_of, distance_of, goal_entries, is_free
from wholebody.methods.qp.multistart import Budget
from wholebody.methods.qp.plain_chain import FIRST, PlainChain
from wholebody.methods.qp.settings import SEEDS
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
        """Solve what the first descents lead to an answer of."""
        began = time.perf_counter()
        problem = self.problem
        entries = goal_entries(problem) or []
        with chains_of(problem).borrow() as chains, problem.borrow() as workspace:
            chain = chains.carrying(entries)
            assert chain is not None
            q, iterations, found = _Descents(self, chain, entries).answers(workspace)
        judgement = judged(problem, self.numbers, q)
        solved = found & judgement.meets(assessed_tolerance(self.budget.tolerance))
        return Answers(solved, q, iterations, judgement, time.perf_counter() - began)


def batches(problems: Sequence[Problem], budget: Budget, largest: int) -> list[Batch]:
    """The problems that may be solved at once, in batches of at most so many."""
    groups: dict[Hashable, list[tuple[int, Array]]] = {}
    for place, problem in enumerate(problems):
        found = _form(problem) if budget.restarts else None
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


def _form(problem: Problem) -> tuple[Hashable, Array] | None:
    """What problems of a batch have in common, and the floats (e, 36) of a problem's goals; None without a chain."""
    entries = goal_entries(problem)
    if entries is None or problem.left_out:
        return None
    try:
        problem.check_fresh()
    except InputError:
        return None
    with chains_of(problem).borrow() as chains:
        chain = chains.carrying(entries)
    distance = None if chain is None else distance_of(problem, chain, problem.scene.figure.clamp(problem.start))
    if distance is None:
        return None
    scene, goals = problem.scene, tuple((type(goal), goal.weight) for goal in problem.goals)
    kinds = tuple((entry.integers, entry.rows) for entry in entries)
    key = id(scene), scene.built.moves, goals, kinds, distance.weights.tobytes(), problem.measures[0].weight
    return key, np.array([entry.floats for entry in entries])


class _Descents:
    """The descents of a batch from the first seeds of each problem."""

    def __init__(self, batch: Batch, chain: PlainChain, entries: list[Entry]) -> None:
        self.chain, self.budget, self.clearances = chain, batch.budget, batch.numbers.clearances
        limits = batch.problem.scene.figure.limits
        self.at = batch.starts.copy()
        self.at[:, limits.idx_q] = np.clip(self.at[:, limits.idx_q], limits.lower, limits.upper)
        values = chain.angles(self.at)
        size, measures = values.shape[1], batch.budget.measures
        weights = distance_of(batch.problem, chain, self.at[0]).weights[chain.idx_v]  # type: ignore[union-attr]
        nearest = np.empty((len(values), 2, 2, size))
        nearest[:, 0, 1], nearest[:, 1, 1] = (weights, weights) if measures else (1.0, 0.0)
        nearest[:, 0, 0] = nearest[:, 1, 0] = chain.angles(batch.numbers.references) if measures else values
        goals = chain.goals(entries)
        self.rows, more = sum(entry.rows for entry in entries), 1 + batch.budget.restarts_for_measure
        exact = chain.is_exact(entries)
        together = 0 if exact else SEEDS.together * more
        self.ends = np.empty((len(values), together or FIRST, size))
        for k, start in enumerate(values if together else ()):
            self.ends[k] = next(chain.seeds(start, batch.budget.seed, together))
        enough = 1 if not measures or (exact and chain.held < 0) else SEEDS.compared * more
        steps = min(batch.budget.iterations, SEEDS.steps)
        asked = np.array([batch.budget.tolerance, SEEDS.damping**2, steps, enough, 1.0])
        self.found, self.counts = chain.descents(batch.tables, goals, nearest, asked, self.ends, together)

    def answers(self, workspace: Workspace) -> tuple[Array, Indices, Mask]:
        """Postures (k, nq), descents (k,), and which (k,) are free and of the least effort."""
        q, solved = self.at.copy(), np.zeros(len(self.at), dtype=bool)
        iterations = np.zeros(len(q), dtype=np.intp)
        loose = self.ends.shape[2] > self.rows  # no descent leads out of what blocks an end that is isolated
        for k, count in enumerate(self.counts.tolist()):
            rejected = np.inf
            ends = self.found[k, : max(count, 0)].tolist()
            iterations[k] = sum(end[3] > 0 for end in ends)
            for effort, number in sorted((end[1], j) for j, end in enumerate(ends) if end[1] < np.inf):
                posture = self.chain.posture(self.ends[k, number], self.at[k])
                workspace.begin()
                if is_free(workspace, posture, self.clearances[k]):
                    q[k] = posture
                    solved[k] = ends[number][2] and not (loose and rejected < SEEDS.worth * effort)
                    break
                rejected = min(rejected, effort)
        return q, iterations, solved
