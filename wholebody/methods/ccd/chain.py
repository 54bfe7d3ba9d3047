"""One chain: its overlapping link, and cyclic coordinate descent that moves it out (Schmidl and Lin, eqs. 1 to 3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.ccd.guards import Kept, cone_guards, guards
from wholebody.methods.ccd.limbs import Limbs, Vector, rotated, seen_from, three
from wholebody.methods.ccd.sweep import Aims
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace

MARGIN = 2e-4  # m: distance of a goal outside the obstacle, so that the next query finds no overlap
SWEEPS = 5  # for one goal; it is computed anew afterwards, so more sweeps waste time
PARALLEL = 0.26  # sine of 15 degrees: a bone at a smaller angle to the obstacle's surface is nearly parallel to it
LONGER = 3  # motions of a joint's origin for one translation; more take the time of a frame
SHORT = 0.02  # m: a link shorter than this has no meaningful direction


class Overlap(NamedTuple):
    """Two overlapping pieces: their indices and joints, depth [m], normal from a to b, points on a and b."""

    a: int
    b: int
    joint_a: int
    joint_b: int
    depth: float
    normal: Vector
    point_a: Vector
    point_b: Vector


class Link(NamedTuple):
    """A link that overlaps, and its displacement."""

    node: int  # its node in the chain
    nodes: tuple[int, ...]  # the nodes that move it relative to the obstacles
    effector: Vector  # the mean of its contact points
    push: Vector  # the translation that removes the overlap, from PD_g
    depth: float  # depth of its deepest pair, metres


class _Side(NamedTuple):
    """The side of an overlap that moves: its node, whether it is piece a, and the nodes that move it."""

    overlap: Overlap
    node: int
    is_a: bool
    nodes: tuple[int, ...]


class LinkFinder:
    """Finds the overlapping link of one chain."""

    def __init__(self, workspace: Workspace, limbs: Limbs, foreign: frozenset[int]) -> None:
        """Prepare the joints of the chain, links but those of `foreign` joints."""
        self._owners, self._limbs = workspace.owners, limbs
        self._carrier = [limbs.carrier(joint) for joint in range(workspace.model.njoints)]
        self._own = list(self._carrier)
        for joint in range(1, workspace.model.njoints):
            if joint not in limbs.node_of and (joint in foreign or self._own[int(workspace.model.parents[joint])] < 0):
                self._own[joint] = -1

    def link(self, overlaps: Sequence[Overlap], deepest: bool) -> Link | None:
        """The overlapping link nearest to the root, or `deepest` inside; None if no joint can change an overlap."""
        links: dict[int, list[_Side]] = {}
        for overlap in overlaps:
            found = self._side(overlap)
            if found is not None:
                links.setdefault(found.node, []).append(found)
        if not links:
            return None
        if deepest:
            return self._link(max(links.values(), key=lambda sides: max(side.overlap.depth for side in sides)))
        return self._link(links[min(links)])

    def _link(self, sides: list[_Side]) -> Link:
        """The link of these overlaps, moved by the nodes that change the deepest of them."""
        deepest = max(sides, key=lambda item: item.overlap.depth)
        same = [(item.overlap, item.is_a) for item in sides if item.nodes == deepest.nodes]
        points = [overlap.point_a if is_a else overlap.point_b for overlap, is_a in same]
        count = len(points)
        x, y, z = (sum(point[k] for point in points) / count for k in range(3))
        return Link(deepest.node, deepest.nodes, (x, y, z), self._push(same), deepest.overlap.depth)

    def _side(self, overlap: Overlap) -> _Side | None:
        """The side of an overlap that a joint moves against the other, or None."""
        for is_a in (True, False) if self._own[overlap.joint_a] >= self._own[overlap.joint_b] else (False, True):
            mine, other = (overlap.joint_a, overlap.joint_b) if is_a else (overlap.joint_b, overlap.joint_a)
            node, under = self._own[mine], self._carrier[other]
            if node >= 0 and (nodes := self._limbs.between(under, node)):
                return _Side(overlap, node, is_a, nodes)
        return None

    def _push(self, overlaps: Sequence[tuple[Overlap, bool]]) -> Vector:
        """The translation whose component along the PD_g of every obstacle is at least its length."""
        by_owner: dict[str, list[tuple[Overlap, bool]]] = {}
        for overlap, is_a in overlaps:
            by_owner.setdefault(self._owners[overlap.b if is_a else overlap.a], []).append((overlap, is_a))
        pushes = [_global_depth(group) for group in by_owner.values()]
        x, y, z = pushes[0]
        for _ in range(4 if len(pushes) > 1 else 0):  # two walls need one, wedges a few
            for px, py, pz in pushes:
                square = px * px + py * py + pz * pz
                shortfall = 1.0 - (x * px + y * py + z * pz) / square if square > 0.0 else 0.0
                if shortfall > 0.0:
                    x, y, z = x + shortfall * px, y + shortfall * py, z + shortfall * pz
        return x, y, z


def _global_depth(group: Sequence[tuple[Overlap, bool]]) -> Vector:
    """Equation 1 for the link and one obstacle."""
    x = y = z = total = 0.0
    for overlap, is_a in group:
        square = overlap.depth * (-overlap.depth if is_a else overlap.depth)
        x += square * overlap.normal[0]
        y += square * overlap.normal[1]
        z += square * overlap.normal[2]
        total += overlap.depth
    return x / total, y / total, z / total


class Tracked(NamedTuple):
    """Placements of Pinocchio's joints, to be indexed: at the tracked posture, and at the one shown before."""

    placed: Any
    shown: Any


class ChainResolver:
    """A chain of the figure with its links, limits and cones.

    Attributes:
        limbs: its joints.
        finder: of its links that overlap.
        reach: for each node, an upper bound of the distance from its joint to a point of the chain, metres.
        translated: joints that keep the orientation of links that were moved out by translation.
    """

    def __init__(
        self,
        scene: Scene,
        workspace: Workspace,
        joints: Sequence[int],
        foreign: frozenset[int],
        tip: int,
        kept: Kept,
    ) -> None:
        """Prepare a chain; `foreign` are the joints of the other chains, `tip` is the frame at its end."""
        self.translated: set[int] = set()
        self.limbs = Limbs(scene.model, joints)
        self._base = int(scene.model.parents[joints[0]])
        self.finder = LinkFinder(workspace, self.limbs, foreign)
        self._guards = guards(scene.figure, self.limbs, kept)
        self._cones = cone_guards(scene.figure, self.limbs, kept)
        self._tip = three(scene.model.frames[tip].placement.translation)
        carriers = {self.limbs.carrier(int(joint)) for joint in workspace.table.joint}
        self._bearing = sorted(node for node in carriers if node >= 0)  # links with pieces
        self.reach = self._reaches(workspace)

    def _reaches(self, workspace: Workspace) -> list[float]:
        """Lengths of the bones from each joint outwards, and the size of the last link's pieces."""
        last = self.limbs.joints[-1]
        sizes = [
            float(np.linalg.norm(piece.placement.translation)) + float(size)
            for piece, size in zip(workspace.geometry.geometryObjects, workspace.table.reach, strict=True)
            if piece.parentJoint == last
        ]
        reach = max([float(np.linalg.norm(self._tip)), *sizes])
        reaches = []
        for joint in reversed(self.limbs.joints):
            reaches.append(reach)
            reach += float(np.linalg.norm(workspace.model.jointPlacements[joint].translation))
        return reaches[::-1]

    def read(self, q: Array, data: Any) -> None:
        """Read a posture q (nq,), with the joint placements in `data`."""
        self.limbs.read(q, data)
        self.limbs.forward()
        self._guards.read(q, data)

    def in_cones(self, data: Any) -> bool:
        """Whether the limbs are in their reach cones at the joint placements in `data`; `read` is not needed."""
        return all(cone.holds(data) for cone in self._cones)

    def keep_ranges(self) -> None:
        """Bring limbs that have left their reach cones, or joints their ranges of motion, back into them."""
        self._guards.keep()

    def push(self, link: Link, tracked: Tracked | None = None) -> tuple[int, ...]:
        """Move the link out of the obstacle; the nodes that moved. Call `read` first."""
        x, y, z = link.push
        length = (x * x + y * y + z * z) ** 0.5
        if length < 1e-9:
            return ()
        grow = 1.0 + MARGIN / length
        push = (grow * x, grow * y, grow * z)
        inner = self._inner(link)
        there = self._kept(link, push, tracked) if inner else None
        if there is not None:
            self._translate(link, push, inner, there)
            return link.nodes
        self.translated.difference_update(self.limbs.joints[node] for node in link.nodes)
        self._reach_out(link.node, link.nodes, link.effector, push)
        return link.nodes

    def _reach_out(self, node: int, nodes: Sequence[int], effector: Vector, push: Vector) -> None:
        """Cyclic coordinate descent that moves a point of a node by a vector."""
        frame = self.limbs.frame(node)
        goal = (effector[0] + push[0], effector[1] + push[1], effector[2] + push[2])
        local = seen_from(frame, effector[0] - frame[9], effector[1] - frame[10], effector[2] - frame[11])
        aims = Aims(self.limbs, [node], [local], [goal], [True])
        plan, left = aims.plan(nodes), aims.distance
        for _ in range(SWEEPS):
            aims.sweep(plan)
            self.limbs.forward()
            self.keep_ranges()
            aims.carry()
            before, left = left, aims.distance
            if left < 1e-4 or left > 0.9 * before:  # m: reached; or slow
                return

    def _kept(self, link: Link, push: Vector, tracked: Tracked | None) -> Array | None:
        """(3, 3) axes, one a row, that a translated link keeps; None for a link that rotates."""
        # A link is translated if parallel to the surface, or near its tracked direction and parallel there or held.
        there, bone = self.limbs.frames[link.node, :9].reshape(3, 3).T.copy(), self._bone(link)
        if tracked is not None:
            wanted = np.ascontiguousarray(tracked.placed[self.limbs.joints[link.node]].rotation.T)
            turned = float(np.abs(wanted - there).max())
            most = 2.0 * PARALLEL if turned < 0.02 else PARALLEL  # wider for a link in its tracked direction
            parallel = _parallel(wanted.T @ (there @ bone), push, most)
            if turned < PARALLEL and (parallel or self._held(link, tracked)):
                self.translated.update(self.limbs.joints[node] for node in link.nodes)
                return wanted
        return there if _parallel(bone, push, PARALLEL) else None

    def _held(self, link: Link, tracked: Tracked) -> bool:
        """Whether a link was moved out by translation before, in this step or as shown; it stays so at any angle."""
        joint, base = self.limbs.joints[link.node], self._base
        if joint in self.translated:
            return True
        now, before = tracked.placed, tracked.shown
        if float(np.abs(now[joint].rotation - before[joint].rotation).max()) > 0.02:
            return False
        moved = now[base].actInv(now[joint]).translation - before[base].actInv(before[joint]).translation
        return float(np.abs(moved).max()) > 1e-3  # m

    def _translate(self, link: Link, push: Vector, inner: Sequence[int], there: Array) -> None:
        """Move the link by pure translation: its joint's origin moves, and its axes become `there` (3, 3)."""
        # The rotation of an upper arm cannot move its own elbow. An elbow moves on a sphere, so it also moves aside.
        limbs = self.limbs
        own = tuple(node for node in link.nodes if node not in inner)
        own_origin = own[-1]
        first = limbs.frame(own_origin)
        own += tuple(node for node in inner if self._passes(node, first[9:]))
        scale, square, done, gain = 1.0, sum(part * part for part in push), 0.0, 1.0
        for _ in range(LONGER):
            origin = three(limbs.frames[own_origin, 9:])
            self._reach_out(inner[0], inner, origin, (scale * push[0], scale * push[1], scale * push[2]))
            moved = np.subtract(limbs.frame(own_origin)[9:], first[9:])
            before, done = done, float(moved @ push) / square
            gain = (done - before) / scale
            if done > 0.9 or gain < 0.05:
                break
            scale = (1.0 - done) / gain
        aims = Aims(limbs, [link.node] * 3, np.eye(3), there, [False] * 3)
        plan = aims.plan(own)
        for _ in range(SWEEPS):
            change = aims.sweep(plan)
            limbs.forward()
            if change < 1e-4:  # rad
                break
            aims.carry()
        self.keep_ranges()

    def _passes(self, node: int, point: Sequence[float]) -> bool:
        """Whether the axis of a node passes through a point (3,)."""
        ux, uy, uz, px, py, pz = self.limbs.lines[node].tolist()
        x, y, z = point[0] - px, point[1] - py, point[2] - pz
        along = ux * x + uy * y + uz * z
        return not self.limbs.slides[node] and x * x + y * y + z * z - along * along < SHORT * SHORT

    def _inner(self, link: Link) -> tuple[int, ...]:
        """The nodes inwards of the link's own: those that move the previous link."""
        before = [node for node in self._bearing if node < link.node and node in link.nodes]
        return tuple(node for node in link.nodes if node <= before[-1]) if before else ()

    def _bone(self, link: Link) -> Array:
        """(3,) from the link's joint to the next link, or to the chain's tip, in the world, metres."""
        here = self.limbs.frame(link.node)
        after = [node for node in self._bearing if node > link.node]
        if after:
            return np.subtract(self.limbs.frame(after[0])[9:], here[9:])
        return np.array(rotated(here, *self._tip))


def _parallel(bone: Array, push: Vector, most: float) -> bool:
    """Whether a bone (3,) is at less than an angle, by its sine, to the surface that pushes it out."""
    length = float(np.linalg.norm(bone))
    return length > SHORT and abs(float(bone @ push)) < most * length * float(np.linalg.norm(push))
