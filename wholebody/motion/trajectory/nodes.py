"""Where a trajectory is looked at, and the rows that hold there: at every frame, and between frames where it dips.

A node is a frame, or a fraction of the path from a frame to the next. Its rows come from exact shapes: distances of all
near pairs, and `wholebody.geometry.contact_rows`. Inequality constraints give rows like those of contacts. Equality
constraints are kept apart, because they are met by a penalty with multipliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.figures.state import State
from wholebody.motion.trajectory.deviations import Chart
from wholebody.motion.trajectory.loads import WindowLoads
from wholebody.scene.workspace import Workspace
from wholebody.tasks.base import Constraint, Goal

MET = 2e-5  # m, rad: a row missed by no more is met; a fifth of what a check allows
ALLOWED = 4e-5  # m: of an overlap between frames, so that what is met is no dip, nor is what is beside it; `faults.DIP`
NEAREST = 5e-4  # share of a gap: nearer to a frame than this, what the frame keeps is enough

Terms = Sequence[Constraint | Goal]


class Node(NamedTuple):
    """A frame of the window, a fraction (0 to 1) of the path from it to the next, or the loads of a frame."""

    frame: int  # the first frame whose deviation counts
    share: float = 0.0  # of the path to the next one
    # the frame whose loads are looked at, which depend on the frames before and after it; -1 for contacts
    loaded: int = -1

    @classmethod
    def of_loads(cls, frame: int) -> Node:
        """The node of the loads of a frame."""
        return cls(max(frame - 1, 0), 0.0, frame)

    @property
    def soft(self) -> bool:
        """Whether its rows are missed where they must be, for contacts come first."""
        return self.loaded >= 0

    @property
    def room(self) -> float:
        """Metres that programs ask of missed rows beyond what must be met: what is beside a place dips by less."""
        return 1e-4 + ALLOWED if self.share else 0.0


class Rows(NamedTuple):
    """What holds at a node, to first order in the deviations of its frame and of the next ones."""

    node: Node  # where
    gap: Array  # (r,) by how much a row is met, metres and radians; to be at least zero
    # (r, nv) derivatives with respect to the deviations of the node's frame and of those after it that count
    parts: tuple[Array, ...]
    group: Indices  # (r,) rows of one contact share a number; the worst of them counts
    equal: Array  # (e,) values of the equalities; to be zero
    equal_rows: Array  # (e, nv) their derivatives

    @property
    def asked(self) -> Array:
        """(r,) what programs ask of each row: room of a missed one, of another no less of it than it has."""
        # soles sink a little between frames; room of them too would bend the whole body
        room, least = self.node.room, -MET if self.node.share else 0.0
        return np.asarray(np.where(self.gap < least, room, np.minimum(self.gap, room)))

    @property
    def shortfalls(self) -> Array:
        """(groups,) by how much the worst row of each group is missed; 0 where it is met."""
        short = np.zeros(int(self.group.max(initial=-1)) + 1)
        np.maximum.at(short, self.group, -self.gap)
        return short


class NodeEvaluator:
    """Evaluates the rows at nodes of one window, with the workspace of one run.

    Attributes:
        chart: the window's frames.
        clearance: least distance asked of every pair, metres.
        loads: of the window; None where they are not looked at.
        tree: (nv,) the figure of each degree of freedom, from 0.
    """

    def __init__(
        self, workspace: Workspace, chart: Chart, terms: Sequence[Terms], clearance: float,
        loads: WindowLoads | None = None,
    ) -> None:  # fmt: skip
        """Take what is needed; `terms` are the resolved constraints of each frame."""
        self.workspace, self.chart, self.clearance, self._terms = workspace, chart, clearance, terms
        self.loads, self.tree = loads, trees(chart.model)
        self._known: dict[Node, tuple[Array, float, Rows]] = {}  # where each node was looked at last

    def nodes(self) -> list[Node]:
        """Every frame, and its loads if they are looked at."""
        found = [Node(frame) for frame in range(len(self.chart))]
        return found if self.loads is None else sorted([*found, *map(Node.of_loads, self.loads.frames)])

    def at(self, node: Node, x: Array, within: float) -> Rows:
        """The rows of a node at deviations x (n, nv), of pairs `within` metres beyond the clearance."""
        if node.loaded >= 0:
            assert self.loads is not None
            gap, parts = self.loads.rows(node.loaded, x)
            none = np.zeros((0, self.chart.model.nv))
            return Rows(node, gap, parts, np.arange(len(gap), dtype=np.intp), np.zeros(0), none)
        here, known = x[node.frame : node.frame + (2 if node.share else 1)], self._known.get(node)
        if known is None or known[1] != within or not np.array_equal(known[0], here):
            found = self._between(node, x, within) if node.share else self._in_frame(node, x, within)
            known = self._known[node] = here.copy(), within, found
        return known[2]

    def _in_frame(self, node: Node, x: Array, within: float) -> Rows:
        frame = node.frame
        gap, rows, group = self._contacts(self.chart.posture(frame, x[frame]), within)
        equal, equal_rows = np.zeros(0), np.zeros((0, rows.shape[1]))
        if self._terms[frame]:
            state = self.workspace.state
            held = [_split(term, state) for term in self._terms[frame]]
            equal = np.concatenate([part[0] for part in held])
            equal_rows = self.chart.carried(frame, x[frame], np.vstack([part[1] for part in held]))
            more = np.concatenate([part[2] for part in held])
            group = np.concatenate([group, group.max(initial=-1) + 1 + np.arange(len(more), dtype=np.intp)])
            gap, rows = np.concatenate([gap, more]), np.vstack([rows, *(part[3] for part in held)])
        return Rows(node, gap, (self.chart.carried(frame, x[frame], rows),), group, equal, equal_rows)

    def _between(self, node: Node, x: Array, within: float) -> Rows:
        chart, now, then = self.chart, node.frame, node.frame + 1
        q, first, second = chart.between(chart.posture(now, x[now]), chart.posture(then, x[then]), node.share)
        gap, rows, group = self._contacts(q, within)
        gap = gap + ALLOWED
        before, after = chart.carried(now, x[now], rows @ first), chart.carried(then, x[then], rows @ second)
        return Rows(node, gap, (before, after), group, np.zeros(0), np.zeros((0, rows.shape[1])))

    def _contacts(self, q: Array, within: float) -> tuple[Array, Array, Indices]:
        workspace = self.workspace
        contacts = workspace.near(q, within + self.clearance)
        found = workspace.rows.rows(contacts, self.clearance)
        rows = workspace.state.rows(found.wrench, found.second, found.first)
        return found.gap - self.clearance, rows, found.contact


def trees(model: pin.Model) -> Indices:
    """(nv,) of each degree of freedom which of the joints on the world carries it, from 0: of several figures whose."""
    carriers = np.zeros(model.njoints, dtype=np.intp)
    for joint in range(1, model.njoints):
        carriers[joint] = carriers[model.parents[joint]] or joint
    numbers = np.unique(carriers[1:], return_inverse=True)[1]
    return np.repeat(numbers, model.nvs.tolist()[1:]).astype(np.intp)


def _split(term: Constraint | Goal, state: State) -> tuple[Array, Array, Array, Array]:
    """Values and rows of a term's equalities, and of its inequalities as gaps."""
    if isinstance(term, Goal):
        value, low_value, high_value = np.atleast_1d(term.error(state)), np.zeros(()), np.zeros(())
    else:
        value, low_value, high_value = np.atleast_1d(term.value(state)), term.lower, term.upper
    rows = state.dense_jacobian(term.jacobian(state))
    lower, upper = np.broadcast_to(low_value, value.shape), np.broadcast_to(high_value, value.shape)
    equal = lower == upper
    low, high = ~equal & np.isfinite(lower), ~equal & np.isfinite(upper)
    gaps = np.concatenate([value[low] - lower[low], upper[high] - value[high]])
    return value[equal] - lower[equal], rows[equal], gaps, np.vstack([rows[low], -rows[high]])
