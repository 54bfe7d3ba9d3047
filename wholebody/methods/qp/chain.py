"""Inverse kinematics of a chain of plain joints from many seeds, before anything else is tried.

Where all goals are places and rotations and the joints that carry their frames have one degree of freedom each, damped
least squares from seeds meets the goals in tens of microseconds, and a projection leads to the least effort (TRAC-IK:
P. Beeson, B. Ames, "TRAC-IK: An open-source library for improved solving of generic inverse kinematics", Humanoids
2015). Seeds are the branches of the closed form of an arm that has one, else the start and random ones. An end that
keeps every clearance is an answer; the others are rejected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.base.pool import Pool
from wholebody.base.records import with_values
from wholebody.figures.description import Limits
from wholebody.figures.figure import Figure
from wholebody.methods.control import Control
from wholebody.methods.qp.chain_kernel import Chain, Goals, Room
from wholebody.methods.qp.closed_form import Branches, closed_form
from wholebody.methods.qp.closed_form import compiled_kernel as closed_form_kernel
from wholebody.methods.qp.closed_form_kernel import BRANCHES
from wholebody.methods.qp.multistart import Budget
from wholebody.methods.qp.settings import SEEDS
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.tasks.distance import SquaredDistance
from wholebody.terms.entries import RESIDUAL, Entry, entries_of, placement_floats

_ONE = np.zeros(1)
_SHARES = np.linspace(0.0, 1.0, SEEDS.samples)


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
        self.arm = closed_form(self.chain)
        self.held = -1 if self.arm is None or self.arm.held < 0 else int(self.arm.joints[self.arm.held])

    def angles(self, q: Array) -> Array:
        """Values (..., n) of the joints at postures (..., nq)."""
        values: Array = q[..., self._idx_q]
        if len(self._round):
            values[..., self._round] = np.arctan2(q[..., self._idx_q[self._round] + 1], values[..., self._round])
        return values

    def posture(self, values: Array, at: Array) -> Array:
        """Postures (..., nq) with values (..., n) of the joints."""
        q: Array = at.copy()
        q[..., self._idx_q] = values
        if len(self._round):
            turned = values[..., self._round]
            q[..., self._idx_q[self._round]], q[..., self._idx_q[self._round] + 1] = np.cos(turned), np.sin(turned)
        return q

    def goals(self, entries: list[Entry]) -> Goals:
        """Entries of goals with the numbers of these joints."""
        integers, row = np.empty((len(entries), 6), dtype=np.int64), 0
        for k, entry in enumerate(entries):
            joint, base, *kinds = entry.integers
            integers[k] = row, self._number[joint], self._number[base], *kinds
            row += entry.rows
        return Goals(np.array([entry.floats for entry in entries]), integers)

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

    def branches(self, goals: Goals, nearest: Array) -> Branches:
        """The branches of the closed form for the placement of one frame; `nearest` as in `chain_kernel.reach`.

        With six joints these are all postures. With seven they are samples, where one joint has values all over its
        limits, but not farther than half a turn from the nearest posture.
        """
        assert self.arm is not None
        lower, upper, values = self.chain.lower, self.chain.upper, self.held_values(nearest[0])
        found, effort = self.angles_of(goals.tables[0], values), np.empty((len(values), BRANCHES))
        order = np.empty(effort.size, dtype=np.intp)
        count = closed_form_kernel().least(found.reshape(*effort.shape, -1), lower, upper, nearest, effort, order)
        return Branches(found, effort.ravel(), found[order[:count]])

    def is_exact(self, entries: Sequence[Entry]) -> bool:
        """Whether the goals are one placement of a frame that the closed form has the postures of."""
        return self.arm is not None and [entry.integers[1:] for entry in entries] == [(0, 1, 1, 0)]

    def held_values(self, nearest: Array) -> Array:
        """Values (v,) of the joint that the closed form holds, not farther than half a turn from values (n,)."""
        if (held := self.held) < 0:
            return _ONE
        near = nearest[held]
        low, high = max(self.chain.lower[held], near - np.pi), min(self.chain.upper[held], near + np.pi)
        values: Array = low + (high - low) * _SHARES
        return values

    def angles_of(self, goal: Array, held: Array | None = None) -> Array:
        """Values (8 v, n) of all branches for a goal (36,), NaN for none, with (v,) values of a joint that is held."""
        values = _ONE if held is None else held
        found = np.empty((len(values), BRANCHES, len(self.idx_v)))
        closed_form_kernel().branches(self.arm, goal, values, found)
        return found.reshape(-1, len(self.idx_v))

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

    def carrying(self, entries: Sequence[Entry]) -> PlainChain | None:
        """The chain that carries the frames of goals."""
        return self.of(frozenset(joint for entry in entries for joint in entry.integers[:2]))


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
        self.goals, self.room = chain.goals(entries), chain.room(sum(entry.rows for entry in entries))
        self.exact = chain.is_exact(entries)
        self.finite = self.exact and chain.held < 0  # ends are isolated, and the closed form has all of them
        self.trace: list[TraceEntry] = []
        self.least = np.inf  # effort of an end that does not keep its clearances
        self.blocked: Array | None = None

    def run(self) -> Met | None:
        """The answer of the batches in turn: the closed form's ends, its samples, and ends of random seeds."""
        if not self.budget.restarts:
            return self._ended(self.start[None].copy())
        more = 1 + self.budget.restarts_for_measure
        if self.exact:
            near = self.nearest
            if self.distance is None:
                near = np.array([self.start, np.ones_like(self.start)])
            branches = self.chain.branches(self.goals, near)
            met = self._ended(branches.least, 1 if self.finite else SEEDS.compared * more)
            if (met is not None and met.blocked is None) or self.finite or self.control.over:
                return met
            # What blocks an end may leave postures of its branch free. All samples meet the goals.
            most = np.inf if met is None else SEEDS.worth * self._effort(met.q)
            samples = (self.chain.posture(each, self.at) for each in branches.cheaper(most))
            q = next((each for each in samples if self._is_free(each)), None)
            if met is not None:
                return with_values(met, blocked=q)
            if q is not None:
                return Met(q, tuple(self.trace), False)
        for seeds in self.chain.seeds(self.start, self.budget.seed, SEEDS.together * more):
            met = self._ended(seeds, SEEDS.compared * more)
            if met is not None or self.control.over:
                return met
        return None

    def _ended(self, seeds: Array, enough: int = 1) -> Met | None:
        """The end of least effort that is free, of the first that meet the goals; None where none is."""
        budget, chain = self.budget, self.chain
        enough = enough if self.distance is not None else 1
        asked = np.array([budget.tolerance, SEEDS.damping**2, min(budget.iterations, SEEDS.steps), enough])
        reach = compiled_kernel().reach
        while len(seeds):
            found = np.empty((len(seeds), 4))
            taken = reach(chain.chain, self.goals, self.room, seeds, self.nearest, asked, found)
            ends = found[:taken].tolist()
            for left, _, _, steps in ends:
                if steps and not self.control.reason:
                    self.trace.append(TraceEntry(left, 0.0, 0.0, 0.0, "seed"))
                    self.control.tell(self.trace[-1])
            for effort, k in sorted((end[1], k) for k, end in enumerate(ends) if end[1] < np.inf):
                q = chain.posture(seeds[k], self.at)
                if self._is_free(q):
                    known = bool(ends[k][2]) and (self.distance is not None or not budget.measures)
                    # Ends of a chain with as many joints as rows are isolated: no descent leads out of what blocks it.
                    free = len(self.start) > len(self.room.value) and self.least < SEEDS.worth * effort
                    return Met(q, tuple(self.trace), known, self.blocked if free else None)
                self.least, self.blocked = (effort, q) if effort < self.least else (self.least, self.blocked)
            seeds = seeds[taken:]
            if self.control.over:
                break
        return None

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
