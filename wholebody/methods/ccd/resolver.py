"""The paper's loop: chain by chain, the penetrating link nearest to the root moves out, until none penetrates."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.geometry.continuous.moved_pairs import QueryResult
from wholebody.methods.ccd.chain import ChainResolver, Overlap, Tracked
from wholebody.methods.ccd.guards import NOTHING_FIXED, Kept
from wholebody.methods.ccd.limbs import movable
from wholebody.methods.control import Control
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace

TOLERANCE = 1e-4  # m: largest overlap that is ignored; coal's own accuracy is a hundredth of it
PERTURBATIONS = (0.02, 0.05, 0.1, 0.2)  # rad: of a posture that things penetrate and that single joints cannot free


@dataclass
class Counts:
    """Counts of the work of a removal; a joint counts once for each goal that moved it."""

    queries: int = 0
    iterations: int = 0
    joints: int = 0
    pairs: set[tuple[int, int]] = field(default_factory=set)
    contact_seconds: float = 0.0
    ik_seconds: float = 0.0

    @property
    def work(self) -> int:
        """Number of queries and goals; each takes some 60 us."""
        return self.queries + self.iterations


class OverlapResolver:
    """Removes overlap from postures of one scene; one object serves many postures.

    Attributes:
        placed: the pieces and pairs at the last query.
        counts: the work since it was last set.
        deepest: largest shortfall of a pair from its clearance in the last query, metres.
        tracked: joint placements whose orientation links that are translated take; None for that which they have.
    """

    def __init__(self, scene: Scene, workspace: Workspace, kept: Kept = NOTHING_FIXED) -> None:
        """Prepare for clearances of zero; `begin` takes others."""
        self.tracked: Tracked | None = None
        self.scene, self.workspace, self._kept = scene, workspace, kept
        self.begin(None, TOLERANCE, Control(np.inf))
        self._data = scene.model.createData()
        self._joints = workspace.table.joint.tolist()
        self.deepest = 0.0

    def begin(self, clearances: Array | None, tolerance: float, control: Control) -> None:
        """Begin a run for clearances (pairs,), None for zero, and a largest overlap that is ignored, metres."""
        self.clearances, self.tolerance, self.control = clearances, tolerance, control
        self._query_distance = 0.0 if clearances is None else float(clearances.max(initial=0.0))
        self.counts = Counts()

    @cached_property
    def chains(self) -> dict[str, ChainResolver]:
        """Name to chain, in the figure's order; made at the first overlap."""
        named = {
            name: ([joint for joint in joints if joint not in self._kept.fixed], tip)
            for name, (joints, tip) in chains_of(self.scene.figure).items()
        }
        everything = frozenset(joint for joints, _ in named.values() for joint in joints)
        return {
            name: ChainResolver(self.scene, self.workspace, joints, everything - set(joints), tip, self._kept)
            for name, (joints, tip) in named.items()
            if joints
        }

    def query(self, q: Array) -> list[Overlap]:
        """The overlaps at a posture q (nq,), the deepest first."""
        began = time.perf_counter()
        self.counts.queries += 1
        pin.forwardKinematics(self.scene.model, self._data, q)
        near = self.workspace.proximity.query(self._data, self._query_distance)
        self.placed = QueryResult(near, self._query_distance)
        depth = -near.distance if self.clearances is None else self.clearances[near.number] - near.distance
        self.deepest = float(depth.max(initial=0.0))
        found: list[Overlap] = []
        if self.deepest > self.tolerance:
            rows = np.flatnonzero(depth > self.tolerance)
            rows = rows[np.argsort(-depth[rows], kind="stable")]
            for pair, size, normal, a, b in zip(
                near.pair[rows].tolist(),
                depth[rows].tolist(),
                near.normal[rows].tolist(),
                near.point_a[rows].tolist(),
                near.point_b[rows].tolist(),
                strict=True,
            ):
                first, second = pair
                joints = self._joints[first], self._joints[second]
                found.append(Overlap(first, second, *joints, size, tuple(normal), tuple(a), tuple(b)))
                self.counts.pairs.add((first, second))
        self.counts.contact_seconds += time.perf_counter() - began
        return found

    def resolve(self, q: Array, rng: np.random.Generator, most_work: float = np.inf) -> tuple[Array, list[Overlap]]:
        """Move links out until nothing overlaps, no step gains, or `most_work` is done; the rest overlaps."""
        q = q.copy()
        overlaps = self.query(q)
        names = list(self.chains)
        deepest = False
        for _ in range(4):
            if not overlaps:
                break
            before = self.deepest
            for k in rng.permutation(len(names)).tolist():
                if self.counts.work > most_work or self.control.over:
                    break
                overlaps = self._leave(self.chains[names[k]], q, overlaps, deepest)
            if overlaps and self.deepest > 0.98 * before:  # the pass gained too little
                if deepest or most_work < np.inf:  # within a frame there is no time for it
                    break
                deepest = True  # a forearm that cannot leave keeps the hand from its turn
        return q, overlaps

    def _leave(self, chain: ChainResolver, q: Array, overlaps: list[Overlap], deepest: bool) -> list[Overlap]:
        """Move one chain out of its overlaps, with a new goal every time; q is changed in place."""
        worst, node = np.inf, -1
        for _ in range(8):
            link = chain.finder.link(overlaps, deepest)
            if link is None or (link.node == node and link.depth > 0.8 * worst):
                break
            worst, node = link.depth, link.node
            began = time.perf_counter()
            chain.read(q, self._data)
            nodes = chain.push(link, self.tracked)
            chain.limbs.write(q)
            self.counts.ik_seconds += time.perf_counter() - began
            self.counts.iterations += 1
            self.counts.joints += len(nodes)
            overlaps = self.query(q)
            if not nodes:
                break
        return overlaps

    def into_cones(self, q: Array) -> Array:
        """Copy of a posture q (nq,) with its limbs turned back into their reach cones."""
        q = q.copy()
        pin.forwardKinematics(self.scene.model, self._data, q)
        for chain in self.chains.values():
            if not chain.in_cones(self._data):
                chain.read(q, self._data)
                chain.keep_ranges()
                chain.limbs.write(q)
                pin.forwardKinematics(self.scene.model, self._data, q)
        return q


def chains_of(figure: Figure) -> Mapping[str, tuple[Sequence[int], int]]:
    """The figure's chains as revolute and prismatic joints, and their tips; if it has none, one for each leaf."""
    model = figure.model
    if figure.chains:
        return {
            name: ([k for k in map(figure.joint_id, chain.joints) if movable(model, k)], figure.frame_id(chain.tip))
            for name, chain in figure.chains.items()
        }
    parents = {int(model.parents[joint]) for joint in range(1, model.njoints)}
    found = {}
    for leaf in range(1, model.njoints):
        if leaf not in parents:
            path = [int(joint) for joint in model.supports[leaf] if joint > 0 and movable(model, int(joint))]
            tips = [k for k, frame in enumerate(model.frames) if frame.parentJoint == leaf]
            tips.sort(key=lambda k: model.frames[k].type != pin.FrameType.JOINT)  # a joint's own frame is no tip
            found[str(model.names[leaf])] = path, tips[-1]
    return found
