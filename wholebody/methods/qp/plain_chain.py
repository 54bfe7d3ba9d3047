"""Chains of joints of one degree of freedom each, as arrays, with their closed form where they have one."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from copy import copy
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices, with_values
from wholebody.base.compiled import with_loops
from wholebody.figures.description import Limits
from wholebody.methods.qp import branch_kernel, chain_kernel
from wholebody.methods.qp.chain_goals_kernel import Chain, Goals, Room
from wholebody.methods.qp.closed_form import NEARLY, Branches, closed_form
from wholebody.methods.qp.closed_form import compiled_kernel as closed_form_kernel
from wholebody.methods.qp.closed_form_kernel import BRANCHES, CROSSING, SLACK, Arm
from wholebody.methods.qp.settings import SEEDS
from wholebody.terms.entries import AXIS, MASS_CENTER, PLANE, RESIDUAL, Entry

LOOSE = 1e-2  # a share of lengths, and rad
NEARBY = 1e-3  # m, rad
FIRST = 16  # ends of a closed form's branches that the compiled loop has room for
WIDTHS = {RESIDUAL: (36, 6), AXIS: (24, 3), PLANE: (7, 3), MASS_CENTER: (4, 1)}  # floats, integers
_NO_FLOATS = {width: np.zeros((0, width)) for width, _ in WIDTHS.values()}
_NO_ARM = Arm(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.intp), -1, CROSSING, 0, np.zeros((4, 3)), SLACK)
_ONE = np.zeros(1)


class PlainChain:
    """The joints of a model that carry some frames, as arrays, with room for one descent.

    Attributes:
        chain: the arrays.
        idx_v: (n,) place of each joint in the tangent.
        joints: (n + 1,) their numbers in the model, the world first.
        carriers: (njoints,) the joint of the chain, or the world, that carries each of the model.
        alone: (njoints,) whether no joint beside the chain moves each.
        arm: the arm that they are, None where it has no closed form.
        guide: the same, or an arm that they nearly are.
        held: the joint that the closed form of the guide holds; -1 for none.
        samples: how many values of it are looked at, and how many where none of these is within limits.
        first: how many seeds come before its branches: the posture of least effort, where the closed form is not exact.
    """

    def __init__(self, model: pin.Model, limits: Limits, joints: tuple[int, ...]) -> None:
        """Read joints, ordered, with all that carry them; each has one degree of freedom."""
        kinds, number = [model.joints[joint] for joint in joints], {0: 0}
        number |= {joint: k + 1 for k, joint in enumerate(joints)}
        subspaces = np.array([np.asarray(kind.createData().S).ravel() for kind in kinds], dtype=float)
        placements = [model.jointPlacements[joint] for joint in joints]
        self._number = number
        self._known: dict[Hashable, tuple[Any, ...]] = {}  # see `goals`
        inertias = [model.inertias[joint] for joint in joints]
        self.joints, self._bodies = np.array([0, *joints]), np.zeros((len(joints) + 1, 4))
        above = [
            [number[one] for one in list(model.supports[joint]) if one in number] for joint in range(model.njoints)
        ]
        self.carriers = np.array([every[-1] for every in above])
        self.alone = np.array([len(every) == len(model.supports[joint]) for joint, every in enumerate(above)])
        self._bodies[1:] = [[inertia.mass, *(inertia.mass * inertia.lever)] for inertia in inertias]
        self._idx_q = np.array([kind.idx_q for kind in kinds], dtype=np.intp)
        self._round = np.flatnonzero([kind.nq == 2 for kind in kinds])
        first, last = int(self._idx_q[0]), int(self._idx_q[-1]) + 1
        alone = not len(self._round) and (self._idx_q == np.arange(first, first + len(kinds))).all()
        self._places = slice(first, last) if alone else self._idx_q  # a slice is read in a fifth of the time
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
        self.guide = self.arm or closed_form(self.chain, NEARLY)
        self.held = -1 if self.guide is None or self.guide.held < 0 else int(self.guide.joints[self.guide.held])
        self.samples = (1, 1) if self.held < 0 else (SEEDS.samples, SEEDS.finer)
        self.first = int(self.held >= 0 or (self.arm is None and self.guide is not None))

    def still(self, q: Array, frozen: list[int]) -> PlainChain:
        """The chain whose joints among `frozen` (tangent) stay as at a posture (nq,), then without a closed form."""
        if not frozen:
            return self
        held = np.isin(self.idx_v, frozen)
        if not held.any():
            return self
        values = self.angles(q)
        made = self.within(np.where(held, values, -np.inf), np.where(held, values, np.inf))
        made.arm, made.guide, made.held, made.samples, made.first = None, None, -1, (1, 1), 0
        return made

    def within(self, lower: Array, upper: Array) -> PlainChain:
        """The chain whose joints keep these limits (n,) too."""
        made, own = copy(self), self.chain
        made.chain = with_values(own, lower=np.maximum(own.lower, lower), upper=np.minimum(own.upper, upper))
        return made

    def angles(self, q: Array) -> Array:
        """Values (..., n) of the joints at postures (..., nq); may be a view of these."""
        values: Array = q[..., self._places]
        if len(self._round):
            values[..., self._round] = np.arctan2(q[..., self._idx_q[self._round] + 1], values[..., self._round])
        return values

    def posture(self, values: Array, at: Array) -> Array:
        """Postures (..., nq) with values (..., n) of the joints."""
        q: Array = at.copy()
        q[..., self._places] = values
        if len(self._round):
            turned = values[..., self._round]
            q[..., self._idx_q[self._round]], q[..., self._idx_q[self._round] + 1] = np.cos(turned), np.sin(turned)
        return q

    def goals(self, entries: Sequence[Entry], sides: Sequence[Entry] = ()) -> Goals:
        """Entries of goals, and of inequalities, with the numbers of these joints."""
        every = [*entries, *sides]
        kinds = len(sides), tuple([(entry.table, *entry.integers) for entry in every])
        if kinds not in self._known:
            self._known[kinds] = self._read(entries, sides)
        known, floats = self._known[kinds], list[Array]()
        for table, (width, _) in WIDTHS.items():
            some = [entry.floats for entry in every if entry.table == table]
            floats.append(np.array(some) if some else _NO_FLOATS[width])
        return Goals(floats[0], known[0], floats[1], known[1], floats[2], known[2], floats[3], *known[3:])

    def _read(self, entries: Sequence[Entry], sides: Sequence[Entry]) -> tuple[Any, ...]:
        """What `Goals` has of entries but for floats."""
        written: dict[int, list[tuple[int, ...]]] = {table: [] for table in WIDTHS}
        row, bodies = 0, self._bodies
        for entry in (*entries, *sides):
            joint, *kind = entry.integers
            if entry.table == RESIDUAL:
                written[RESIDUAL].append((row, self._number[joint], self._number[kind[0]], *kind[1:]))
            elif entry.table == MASS_CENTER:
                counts = (self.joints >= joint) & (self.joints < kind[0])
                bodies = self._bodies * counts[:, None] / (self._bodies[:, 0] @ counts)
                written[MASS_CENTER].append((row,))
            else:
                written[entry.table].append((row, self._number[joint], *kind, 0)[:3])  # a plane is of the world
            row += entry.rows
        integers = [np.array(written[t], dtype=np.int64).reshape(-1, width) for t, (_, width) in WIDTHS.items()]
        return *integers, bodies, np.arange(row) >= row - sum(entry.rows for entry in sides)

    def carries(self, entry: Entry, model: pin.Model) -> bool:
        """Whether all joints that an entry depends on are of this chain."""
        return all(joint in self._number for joint in joints_of(entry, model))

    def room(self, rows: int) -> Room:
        """Room for descents with so many rows: the same for the same number."""
        if rows not in self._rooms:
            size = len(self.idx_v)
            joints = np.zeros((size + 1, 4, 3))
            joints[0, :3] = np.eye(3)
            self._rooms[rows] = Room(
                joints, np.empty((size, 6)), np.empty((rows, 6)), np.empty(rows), np.empty((rows, size)),
                np.empty(size, dtype=np.bool_), np.empty(rows, dtype=np.bool_), np.zeros((size + 1, 4)),
            )  # fmt: skip
        return self._rooms[rows]

    def branches(self, goals: Goals, nearest: Array) -> Branches:
        """The branches of the closed form for one frame's placement; `nearest` as in `closed_form_kernel.sampled`."""
        # With six joints these are all postures; with seven samples of one joint.
        for samples in self.samples:
            found, effort, order = self._sampled(goals, nearest, samples)
            if len(order):
                break
        values = found.reshape(-1, len(self.idx_v))
        return Branches(values, effort.ravel(), values[order])

    def _sampled(self, goals: Goals, nearest: Array, samples: int) -> tuple[Array, Array, Indices]:
        """See `closed_form_kernel.sampled`."""
        found, effort = np.empty((samples, BRANCHES, len(self.idx_v))), np.empty((samples, BRANCHES))
        limits, order = (self.chain.lower, self.chain.upper), np.empty(effort.size, dtype=np.intp)
        count = closed_form_kernel().sampled(self.guide, goals.tables[0], limits, nearest, found, effort, order)
        return found, effort, order[:count]

    def downhill(self, branches: Branches, most: float) -> tuple[Indices, Array]:
        """Samples (k,) from which branches fall below an effort, and bottoms (k, 2): see `branch_kernel.downhill`."""
        effort, count = branches.effort.reshape(-1, BRANCHES), 2 * branches.effort.size
        order, bottoms = np.empty(count, dtype=np.intp), np.empty((count, 2))
        held = branches.values[:, self.held].copy().reshape(-1, BRANCHES)
        count = branch_kernel.downhill(effort, held, most, order, bottoms)
        return order[:count], bottoms[:count]

    def along(
        self, goals: Goals, nearest: Array, asked: Array, samples: Array, towards: Array,
        most: tuple[float, float, int],
    ) -> tuple[Array, Array]:  # fmt: skip
        """Where branches of samples (k, n) begin and end on the way to values (k,): see `branch_kernel.along`."""
        assert self.guide is not None
        ends, efforts = np.empty((len(samples), 2, samples.shape[1])), np.empty((len(samples), 2))
        bodies = self.chain, self.guide, self.room(rows_of(goals)), self.arm is not None
        branch_kernel.along(bodies, asked, goals, nearest, most, samples, towards, (ends, efforts))
        return ends, efforts

    def singular(self, goals: Goals, nearest: Array) -> Array:
        """Postures (k, n) all over those that six joints meet a singular placement with, the least effort first."""
        # Where axes line up postures are not isolated: of each continuum the closed form's branches have one.
        values, effort = self._sampled(goals, nearest, SEEDS.spread)[:2]
        alike = np.abs(values - values[0]).max(axis=2) <= NEARBY  # not for NaN
        some = np.flatnonzero((effort < np.inf) & ~alike)
        found: Array = values.reshape(-1, len(self.idx_v))[some[effort.ravel()[some].argsort(kind="stable")]]
        return found

    def loosely_met(self, goals: Goals, seed: int) -> Array:
        """Postures (k, n) that six joints meet a placement or one nearby with, or nearly so; none is a proof."""
        # Limits and links are longer by a hundredth, and singular placements moved by a hundred times a solve's error.
        assert self.arm is not None
        arm, rng, found = with_values(self.arm, slack=LOOSE), np.random.default_rng(seed), list[Array]()
        lower, upper = self.chain.lower, self.chain.upper
        limited = np.isfinite(lower) & np.isfinite(upper)  # the others turn all around
        lower, upper = np.where(limited, lower, -np.pi), np.where(limited, upper, np.pi)
        half, middle = 0.5 * (upper - lower), 0.5 * (upper + lower)
        for shift in np.vstack([np.zeros(6), rng.uniform(-NEARBY, NEARBY, (12, 6))]):
            table, angles = goals.tables[0].copy(), np.empty((1, BRANCHES, len(half)))
            table[24:27] += shift[:3]
            table[27:] = (pin.exp3(shift[3:]) @ table[27:].reshape(3, 3)).ravel()
            closed_form_kernel().branches(arm, table, _ONE, angles)
            away = np.remainder(angles[0] - middle + np.pi, 2.0 * np.pi) - np.pi
            within = (np.abs(away) <= half + LOOSE).all(axis=1)  # not for NaN
            found.append(middle + np.clip(away[within], -half, half))
        return np.concatenate(found)

    def is_guided(self, goals: Goals) -> bool:
        """Whether the goals are one placement of a frame that the guide has postures of."""
        alone = self.guide is not None and len(goals.one_sided) - np.count_nonzero(goals.one_sided) == 6
        return alone and goals.entries[:, 2:].tolist() == [[0, 1, 1, 0]]

    def is_finite(self, goals: Goals) -> bool:
        """Whether the closed form has all postures of the goals, and these are isolated."""
        return self.arm is not None and self.held < 0 and self.is_guided(goals)

    def descents(
        self, tables: Array, goals: Goals, nearest: Array, asked: Array, ends: Array, seeds: int = 0
    ) -> tuple[Array, Indices]:
        """Descend for k problems from branches of the closed form, or `seeds` given ones; writes `ends` (k, m, n)."""
        # `tables` (k, e, 36) of goals. What was found (k, m, 4), how many (k,); -1 for more than there is room for.
        room, found, counts = self.room(rows_of(goals)), np.empty((*ends.shape[:2], 4)), np.array([seeds] * len(ends))
        arm = _NO_ARM if seeds or self.guide is None else self.guide
        if self.first and not seeds:
            ends[:, 0], counts[:] = np.clip(nearest[:, 0], self.chain.lower, self.chain.upper), self.first
        compiled_kernel().reach_all(
            (self.chain, arm, room), asked, (tables, goals), self.samples, nearest, ends, found, counts
        )
        return found, counts

    def seeds(self, start: Array, seed: int, count: int) -> Iterator[Array]:
        """Batches (count, n) of values all over the limits, or over a whole turn of them about a start (n,)."""
        # The first has the start, and values half as far, where ends of little effort are. Slides begin within a metre.
        lower, upper = self.chain.lower - start, self.chain.upper - start
        lower = np.clip(-self._far, lower, np.maximum(upper - 2.0 * self._far, lower))
        upper = np.minimum(lower + 2.0 * self._far, upper)
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
            kinds = [model.joints[joint] for joint in path]
            plain = all(one.nv == 1 and one.shortname().startswith(("JointModelR", "JointModelP")) for one in kinds)
            self._chains[joints] = PlainChain(model, self._limits, tuple(path)) if path and plain else None
        return self._chains[joints]

    def carrying(self, entries: Sequence[Entry]) -> PlainChain | None:
        """The chain that carries the frames of goals."""
        return self.of(frozenset(joint for entry in entries for joint in joints_of(entry, self._model)))

    def apart(self, entries: Sequence[Entry]) -> list[tuple[PlainChain, list[Entry]]]:
        """The chains that carry the frames of goals and have no joint in common, each with its entries."""
        groups = list[tuple[set[int], list[Entry]]]()
        for entry in entries:
            joints = {above for joint in joints_of(entry, self._model) for above in self._model.supports[joint]} - {0}
            own, others = [entry], list[tuple[set[int], list[Entry]]]()
            for known, theirs in groups:
                if known & joints:
                    joints, own = joints | known, theirs + own
                else:
                    others.append((known, theirs))
            groups = [*others, (joints, own)]
        found = [(self.of(frozenset(joints)), own) for joints, own in groups]
        return [(chain, own) for chain, own in found if chain is not None]


def joints_of(entry: Entry, model: pin.Model) -> tuple[int, ...]:
    """The joints of a frame, and of the frame that its goal is relative to, or those that carry a mass that counts."""
    if entry.table == MASS_CENTER:
        return tuple(joint for joint in range(*entry.integers) if model.inertias[joint].mass > 0.0)
    return entry.integers[: 2 if entry.table == RESIDUAL else 1]


def rows_of(goals: Goals) -> int:
    """How many rows the goals have."""
    return len(goals.one_sided)


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


@with_loops("wholebody.methods.qp.chain_kernel")
def compiled_kernel(_: Any) -> None:
    """The module of the compiled loop, compiled or read back: not in the middle of a solve."""
    closed_form_kernel()
    joint, one, axis = np.zeros(1, dtype=np.intp), np.zeros(1), np.zeros((1, 3))
    room = Room(
        np.zeros((2, 4, 3)), np.zeros((1, 6)), np.zeros((0, 6)), np.zeros(0), np.zeros((0, 1)), np.zeros(1, np.bool_),
        np.zeros(0, np.bool_), np.zeros((2, 4)),
    )  # fmt: skip
    chain = Chain(joint, np.zeros((1, 4, 3)), axis, axis, np.zeros((2, 1), dtype=np.int8), one, one)
    bodies, near, efforts = (chain, _NO_ARM, room), np.zeros((0, 2, 1)), np.empty((0, 2))
    tables: Any = [
        np.zeros((0, width), kind)
        for widths in WIDTHS.values()
        for width, kind in zip(widths, (float, np.int64), strict=True)
    ]
    goals = Goals(*(*tables, np.zeros((2, 4)), np.zeros(0, np.bool_)))
    chain_kernel.reach_all(
        bodies, np.zeros(5), (np.zeros((0, 0, 36)), goals), (1, 1), near, np.zeros((0, 1, 1)), np.zeros((0, 1, 4)),
        np.zeros(0, dtype=np.intp),
    )  # fmt: skip
    one_arm = with_values(_NO_ARM, axes=axis, points=axis, joints=joint, held=0)
    branch_kernel.downhill(np.zeros((2, BRANCHES)), np.zeros((2, BRANCHES)), 0.0, joint, efforts)
    branch_kernel.along(
        (chain, one_arm, room, True), np.zeros(5), goals, np.zeros((2, 1)), (0.0, 0.0, 0), axis[:0, :1].copy(),
        _ONE[:0], (np.empty((0, 2, 1)), efforts),
    )  # fmt: skip
