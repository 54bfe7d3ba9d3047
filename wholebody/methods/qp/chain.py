"""Inverse kinematics of a chain of plain joints from many seeds, before anything else is tried.

Where all goals are places and rotations and the joints that carry their frames have one degree of freedom each, damped
least squares from the start and from random seeds meets the goals in tens of microseconds, and a projection leads to
the least effort (TRAC-IK: P. Beeson, B. Ames, "TRAC-IK: An open-source library for improved solving of generic inverse
kinematics", Humanoids 2015). An end that keeps every clearance is an answer; the others are rejected.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.figures.description import Limits
from wholebody.methods.control import Control
from wholebody.methods.qp.chain_kernel import Chain, Goals, Room
from wholebody.methods.qp.multistart import Budget
from wholebody.methods.qp.settings import SEEDS
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.tasks.distance import SquaredDistance
from wholebody.terms.entries import RESIDUAL, Entry, entries_of


class Met(NamedTuple):
    """A posture that meets the goals with everything held."""

    q: Array  # (nq,) posture
    trace: tuple[TraceEntry, ...]  # one entry a descent, but for one that ends where it begins
    stationary: bool  # whether the measures are stationary too
    # (nq,) an end of far less effort that does not keep its clearances; None where there is none
    blocked: Array | None = None

    @property
    def complete(self) -> bool:
        """Whether no descent from here can lead to less."""
        return self.stationary and self.blocked is None


class PlainChain:
    """The joints of a model that carry some frames, as arrays, with room for one descent.

    Attributes:
        chain: the arrays.
        idx_v: (n,) place of each joint in the tangent.
    """

    def __init__(self, model: pin.Model, limits: Limits, joints: tuple[int, ...]) -> None:
        """Read joints, ordered, with all that carry them; each has one degree of freedom."""
        kinds, number = [model.joints[joint] for joint in joints], {0: 0}
        number |= {joint: k + 1 for k, joint in enumerate(joints)}
        subspaces = np.array([np.asarray(kind.createData().S).ravel() for kind in kinds], dtype=float)
        placements = [model.jointPlacements[joint] for joint in joints]
        self._number = number
        self._idx_q = np.array([kind.idx_q for kind in kinds], dtype=np.intp)
        self._round = np.flatnonzero([kind.nq == 2 for kind in kinds])
        self.idx_v = np.array([kind.idx_v for kind in kinds], dtype=np.intp)
        lower, upper = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
        lower[limits.idx_v], upper[limits.idx_v] = limits.lower, limits.upper
        self.chain = Chain(
            parents=np.array([number[model.parents[joint]] for joint in joints], dtype=np.intp),
            places=np.array([[*place.rotation.T, place.translation] for place in placements], dtype=float),
            turns=subspaces[:, 3:].copy(),
            slides=subspaces[:, :3].copy(),
            support=_support([number[model.parents[joint]] for joint in joints]),
            lower=lower[self.idx_v],
            upper=upper[self.idx_v],
        )
        limited = np.isfinite(self.chain.upper - self.chain.lower)
        self._far = np.where(self.chain.turns.any(axis=1), np.pi, np.where(limited, np.inf, 1.0))
        self._rooms: dict[int, Room] = {}

    def angles(self, q: Array) -> Array:
        """Values (n,) of the joints at a posture (nq,)."""
        values: Array = q[self._idx_q]
        if len(self._round):
            values[self._round] = np.arctan2(q[self._idx_q[self._round] + 1], values[self._round])
        return values

    def posture(self, values: Array, at: Array) -> Array:
        """A posture (nq,) with values (n,) of the joints."""
        q: Array = at.copy()
        q[self._idx_q] = values
        if len(self._round):
            turned = values[self._round]
            q[self._idx_q[self._round]], q[self._idx_q[self._round] + 1] = np.cos(turned), np.sin(turned)
        return q

    def goals(self, entries: list[Entry]) -> Goals:
        """Entries of goals with the numbers of these joints."""
        integers, row = [], 0
        for entry in entries:
            joint, base, *kinds = entry.integers
            integers.append((row, self._number[joint], self._number[base], *kinds))
            row += entry.rows
        return Goals(np.array([entry.floats for entry in entries]), np.array(integers, dtype=np.int64))

    def room(self, rows: int) -> Room:
        """Room for descents with so many rows: the same for the same number."""
        if rows not in self._rooms:
            size = len(self.idx_v)
            joints = np.zeros((size + 1, 4, 3))
            joints[0, :3] = np.eye(3)
            self._rooms[rows] = Room(
                joints, np.empty((size, 6)), np.empty((rows, 6)), np.empty(rows), np.empty((rows, size)),
                np.empty(size, dtype=np.bool_),
            )  # fmt: skip
        return self._rooms[rows]

    def seeds(self, start: Array, seed: int, count: int) -> Iterator[Array]:
        """Batches (count, n) of values all over the limits, but not farther from a start (n,) than half a turn.

        The first batch has the start, and values half as far from it, where ends of little effort are. Joints that
        slide without limits begin within a metre.
        """
        lower, upper = np.maximum(self.chain.lower - start, -self._far), np.minimum(self.chain.upper - start, self._far)
        for batch in range(SEEDS.batches):
            directions = _directions(seed, batch, count, len(start))
            values = start + (0.5 if batch == 0 else 1.0) * np.where(directions < 0.0, -lower, upper) * directions
            if batch == 0:
                values[0] = start
            yield values


class Chains:
    """The chains of a model that were asked for; one run uses it at a time."""

    def __init__(self, model: pin.Model, limits: Limits) -> None:
        self._model, self._limits = model, limits
        self._chains: dict[frozenset[int], PlainChain | None] = {}

    def of(self, joints: frozenset[int]) -> PlainChain | None:
        """The chain that carries joints; None where one of it has several degrees of freedom or follows another."""
        if joints not in self._chains:
            model = self._model
            path = sorted({above for joint in joints for above in list(model.supports[joint])} - {0})
            plain = bool(path) and all(_is_plain(model.joints[joint]) for joint in path)
            self._chains[joints] = PlainChain(model, self._limits, tuple(path)) if plain else None
        return self._chains[joints]


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
    entries, built = goal_entries(problem), problem.scene.built
    if entries is None:
        return None
    limits = problem.scene.figure.limits
    with built.pool(Chains, lambda: Chains(built.model, limits)).borrow() as chains:
        chain = chains.of(frozenset(joint for entry in entries for joint in entry.integers[:2]))
        return None if chain is None else _from_seeds(problem, chain, entries, workspace, budget, control)


def _from_seeds(
    problem: Problem, chain: PlainChain, entries: list[Entry], workspace: Workspace, budget: Budget,
    control: Control,
) -> Met | None:  # fmt: skip
    at = problem.scene.figure.clamp(problem.start)
    start = chain.angles(at)
    distance = _distance(problem, chain, at) if budget.measures else None
    nearest = np.zeros((2, len(start)))
    nearest[0] = start
    if distance is not None:
        nearest[0], nearest[1] = chain.angles(distance.reference), distance.weights[chain.idx_v]
    more = 1 + budget.restarts_for_measure
    enough = 1 if distance is None else SEEDS.compared * more
    asked = np.array([budget.tolerance, SEEDS.damping**2, min(budget.iterations, SEEDS.steps), enough])
    goals, room, reach = chain.goals(entries), chain.room(sum(entry.rows for entry in entries)), compiled_kernel().reach
    trace, least, blocked = list[TraceEntry](), np.inf, None
    alone = [start[None].copy()]
    for seeds in chain.seeds(start, budget.seed, SEEDS.together * more) if budget.restarts else alone:
        while len(seeds):
            if control.over:
                return None
            found = np.empty((len(seeds), 4))
            taken = reach(chain.chain, goals, room, seeds, nearest, asked, found)
            ends = found[:taken].tolist()
            for left, _, _, steps in ends:
                if steps and not control.over:
                    trace.append(TraceEntry(left, 0.0, 0.0, 0.0, "seed"))
                    control.tell(trace[-1])
            for effort, k in sorted((end[1], k) for k, end in enumerate(ends) if end[1] < np.inf):
                q = chain.posture(seeds[k], at)
                if _is_free(problem, workspace, q):
                    known = bool(ends[k][2]) and (distance is not None or not budget.measures)
                    # Ends of a chain with as many joints as rows are isolated: no descent leads out of what blocks it.
                    free = len(start) > len(room.value) and least < SEEDS.worth * effort
                    return Met(q, tuple(trace), known, blocked if free else None)
                least, blocked = (effort, q) if effort < least else (least, blocked)
            seeds = seeds[taken:]
    return None


def _is_free(problem: Problem, workspace: Workspace, q: Array) -> bool:
    """Whether every pair keeps its clearance at a posture (nq,)."""
    near = workspace.near_views(q, float(np.maximum.reduce(problem.clearances, initial=0.0)))
    return not len(near.number) or not (near.distance < problem.clearances[near.number]).any()


def _distance(problem: Problem, chain: PlainChain, at: Array) -> SquaredDistance | None:
    """The measure, where it is one squared distance that the other joints cannot reduce; else None."""
    measures = problem.measures
    if len(measures) != 1 or type(measures[0]) not in (tasks.Effort, tasks.Displacement):
        return None
    distance: SquaredDistance = measures[0].distance  # type: ignore[attr-defined]
    weights = distance.weights.copy()
    weights[chain.idx_v] = 0.0
    rest = weights * pin.difference(problem.scene.model, distance.reference, at)
    return distance if (distance.weights[chain.idx_v] > 0.0).all() and not rest.any() else None


@lru_cache(maxsize=64)
def _directions(seed: int, batch: int, count: int, size: int) -> Array:
    """(count, size) numbers between -1 and 1."""
    return np.random.default_rng([seed, batch]).uniform(-1.0, 1.0, (count, size))


def _support(parents: list[int]) -> NDArray[np.int8]:
    """(n + 1, n) 1 where a column moves a joint; the first row is the world's."""
    support = np.zeros((len(parents) + 1, len(parents)), dtype=np.int8)
    for k, parent in enumerate(parents):
        support[k + 1] = support[parent]
        support[k + 1, k] = 1
    return support


def _is_plain(joint: pin.JointModel) -> bool:
    return bool(joint.nv == 1) and str(joint.shortname()).startswith(("JointModelR", "JointModelP"))


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import chain_kernel

    joint, one, axis = np.zeros(1, dtype=np.intp), np.zeros(1), np.zeros((1, 3))
    chain = Chain(joint, np.zeros((1, 4, 3)), axis, axis, np.zeros((2, 1), dtype=np.int8), one, one)
    room = Room(
        np.zeros((2, 4, 3)), np.zeros((1, 6)), np.zeros((0, 6)), np.zeros(0), np.zeros((0, 1)), np.zeros(1, np.bool_)
    )
    goals = Goals(np.zeros((0, 36)), np.zeros((0, 6), dtype=np.int64))
    chain_kernel.reach(chain, goals, room, np.zeros((1, 1)), np.zeros((2, 1)), np.zeros(4), np.zeros((1, 4)))
    return chain_kernel
