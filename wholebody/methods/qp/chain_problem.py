"""What a problem asks of a chain of plain joints, and how descents from its seeds are led."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.base.pool import Pool
from wholebody.methods.qp.chain_goals_kernel import Goals
from wholebody.methods.qp.plain_chain import WIDTHS, Chains, PlainChain, rows_of
from wholebody.methods.qp.settings import SEEDS, Settings
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Constraint, Goal, Term
from wholebody.tasks.checks import is_equality
from wholebody.tasks.distance import SquaredDistance
from wholebody.terms.entries import MASS_CENTER, PLANE, Entry, entries_of


def chains_of(problem: Problem) -> Pool[Chains]:
    """What runs on problems of a figure borrow: things around it change no chain."""
    figure = problem.scene.figure
    return figure.runs.pool(Chains, lambda: Chains(figure.model, figure.limits))


def goal_entries(problem: Problem) -> list[Entry] | None:
    """Entries of goals and equalities, if a chain takes all of them; None otherwise."""
    if not problem.goals or any(type(one) is not tasks.Freeze for one in problem.bounds):
        return None
    found: list[Entry] = []
    terms: tuple[Goal | Constraint, ...] = (*problem.goals, *filter(is_equality, problem.constraints))
    for term in terms:
        entries = entries_of(term, problem.scene.model)
        if entries is None or any(entry.table not in WIDTHS for entry in entries):
            return None
        found += entries
    return found if _is_of_one_figure(found) else None


def _is_of_one_figure(entries: list[Entry]) -> bool:
    """Whether centres of mass are of the same bodies."""
    return len({entry.integers for entry in entries if entry.table == MASS_CENTER}) < 2


def _sides(problem: Problem, chain: PlainChain, entries: list[Entry]) -> tuple[list[Entry], list[Constraint]]:
    """Entries of inequalities that a chain takes beside those of goals, and the other inequalities."""
    inside, others, model = list[Entry](), list[Constraint](), problem.scene.model
    for one in problem.constraints:
        if is_equality(one):
            continue
        found = entries_of(one, model) or []
        known = found and all(each.table in (PLANE, MASS_CENTER) and chain.carries(each, model) for each in found)
        if known and np.isfinite(one.lower).all() and np.isinf(one.upper).all() and _is_of_one_figure(entries + found):
            for entry, lower in zip(found, np.broadcast_to(one.lower, len(found)).tolist(), strict=True):
                entry.floats[-1] += lower  # the last float is subtracted from the value
            inside += found
        else:
            others.append(one)
    return inside, others


class Asked(NamedTuple):
    """What a problem asks of a chain."""

    goals: Goals
    at: Array  # (nq,) its start, within limits
    nearest: Array  # (2, n) posture from which the measure is a squared distance, and weights; zeros for none
    clearances: Array  # (pairs,) metres
    bounded: tuple[Constraint, ...] = ()  # inequalities that reject ends: those that are not among the goals
    own: tuple[Term, ...] = ()  # terms of one's own, which may be undefined at some postures

    @classmethod
    def by(cls, problem: Problem, chain: PlainChain, entries: list[Entry], distance: SquaredDistance | None) -> Asked:
        """What a problem with these entries asks, whose measure is a squared distance; None where none counts."""
        at = problem.scene.figure.clamp(problem.start)
        nearest = np.zeros((2, len(chain.idx_v)))
        nearest[0] = chain.angles(at if distance is None else distance.reference)
        if distance is not None:
            nearest[1] = distance.weights[chain.idx_v]
        goals, bounded = chain.goals(entries), [one for one in problem.constraints if not is_equality(one)]
        if bounded and not chain.is_finite(goals):  # of isolated postures none is moved
            sides, bounded = _sides(problem, chain, entries)
            goals = chain.goals(entries, sides)
        own = tuple(one for one in (*problem.constraints, *problem.measures) if is_own(one))
        return cls(goals, at, nearest, problem.clearances, tuple(bounded), own)


def how_far(settings: Settings, enough: int, others: bool = False) -> Array:
    """Numbers (5,) of `chain_kernel.reach`; `others`: those too that will take more effort than what is found."""
    return _how_far(settings.tolerance, min(settings.iterations, SEEDS.steps), enough, others)


@lru_cache(maxsize=64)
def _how_far(tolerance: float, steps: int, enough: int, others: bool) -> Array:
    return np.array([tolerance, SEEDS.damping**2, steps, enough, 0.0 if others else 1.0])


class Rule(NamedTuple):
    """How the first batch of seeds is descended from."""

    guided: bool  # whether it is of the branches of a closed form
    held: bool  # with one joint held, so that ends lie along branches
    finite: bool  # whether ends are isolated, and the closed form has all of them
    enough: int  # ends that meet the goals
    rows: int  # of the goals, without those of inequalities
    together: int  # seeds of a batch of random ones
    measured: bool  # whether ends are compared by a measure
    nearly: bool  # whether the closed form is only near to postures, and lacks some of an arm that is stretched

    def lacks(self, count: int) -> bool:
        """Whether so many ends of a closed form are too few to compare."""
        return self.nearly and count < self.enough

    @classmethod
    def of(cls, chain: PlainChain, goals: Goals, settings: Settings, measured: bool) -> Rule:
        """The rule for problems with such goals."""
        guided, more = chain.is_guided(goals), 1 + settings.restarts_for_measure
        held = guided and chain.held >= 0
        finite = guided and not held and chain.arm is not None
        enough = 1 if finite or not measured else SEEDS.compared * more + (chain.first if guided else 0)
        nearly = guided and chain.arm is None and measured
        rows = rows_of(goals) - int(np.count_nonzero(goals.one_sided))
        return cls(guided, held, finite, enough, rows, SEEDS.together * more, measured, nearly)


def is_free(workspace: Workspace, q: Array, clearances: Array, within: float) -> bool:
    """Whether every pair keeps its clearance (pairs,), at most `within` metres, at a posture (nq,)."""
    return workspace.least_gap(q, clearances, within) >= 0.0


def distance_of(problem: Problem, chain: PlainChain) -> SquaredDistance | None:
    """The measure, where it is one squared distance that the other joints cannot reduce; else None."""
    measures = problem.measures
    if len(measures) != 1 or type(measures[0]) not in (tasks.Effort, tasks.Displacement):
        return None
    distance: SquaredDistance = measures[0].distance  # type: ignore[attr-defined]
    if np.count_nonzero(distance.weights[chain.idx_v]) < len(chain.idx_v):
        return None
    if len(chain.idx_v) == len(distance.weights):
        return distance
    weights = distance.weights.copy()
    weights[chain.idx_v] = 0.0
    if not weights.any():
        return distance
    at = problem.scene.figure.clamp(problem.start)
    rest = weights * pin.difference(problem.scene.model, distance.reference, at)
    return None if rest.any() else distance
