"""The overlapping link of a chain nearest to the root, its contact points, and its displacement.

Equations 1 to 3 of Schmidl and Lin: the end effector is the mean of the contact points on the link, and the goal is
that point moved by the global penetration depth PD_g of the link in the obstacle. Each obstacle has its own PD_g; in a
corner the link moves by a translation whose component along each of them is at least its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.geometry.penetration import least_separation
from wholebody.methods.ccd.limbs import Limbs, Vector
from wholebody.scene.workspace import Workspace


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

    def __init__(self, workspace: Workspace, limbs: Limbs, foreign: frozenset[int], exact: bool = True) -> None:
        """Prepare the joints of the chain, links but those of `foreign` joints; `exact`: where PD_g cancels."""
        self._exact = exact
        self._workspace, self._limbs = workspace, limbs
        self._carrier = [limbs.carrier(joint) for joint in range(workspace.model.njoints)]
        self._own = list(self._carrier)
        for joint in range(1, workspace.model.njoints):
            if joint not in limbs.node_of and (joint in foreign or self._own[int(workspace.model.parents[joint])] < 0):
                self._own[joint] = -1
        self._paths = [frozenset(path) for path in limbs.paths]
        self._masks: dict[tuple[tuple[int, ...], str], tuple[list[int], NDArray[np.bool_]]] = {}

    def nearest_root(self, overlaps: Sequence[Overlap]) -> Link | None:
        """The overlapping link nearest to the root; None if no joint can change an overlap."""
        links = self._links(overlaps)
        return self._link(links[min(links)]) if links else None

    def deepest(self, overlaps: Sequence[Overlap]) -> Link | None:
        """The link that is deepest inside; None if no joint can change an overlap."""
        links = self._links(overlaps).values()
        return self._link(max(links, key=lambda found: max(item.overlap.depth for item in found))) if links else None

    def _links(self, overlaps: Sequence[Overlap]) -> dict[int, list[_Side]]:
        """The overlaps that a joint can change, by the node of their link."""
        links: dict[int, list[_Side]] = {}
        for overlap in overlaps:
            found = self._side(overlap)
            if found is not None:
                links.setdefault(found.node, []).append(found)
        return links

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
            if node >= 0:
                common = self._paths[under] if under >= 0 else frozenset()
                nodes = tuple(k for k in self._limbs.paths[node] if k not in common)
                if nodes:
                    return _Side(overlap, node, is_a, nodes)
        return None

    def _push(self, overlaps: Sequence[tuple[Overlap, bool]]) -> Vector:
        """The translation whose component along the PD_g of every obstacle is at least its length."""
        owners = self._workspace.owners
        by_owner: dict[str, list[tuple[Overlap, bool]]] = {}
        for overlap, is_a in overlaps:
            by_owner.setdefault(owners[overlap.b if is_a else overlap.a], []).append((overlap, is_a))
        pushes = [self._global_depth(owner, group) for owner, group in by_owner.items()]
        x, y, z = pushes[0]
        for _ in range(4 if len(pushes) > 1 else 0):  # two walls need one, wedges a few
            for px, py, pz in pushes:
                square = px * px + py * py + pz * pz
                shortfall = 1.0 - (x * px + y * py + z * pz) / square if square > 0.0 else 0.0
                if shortfall > 0.0:
                    x, y, z = x + shortfall * px, y + shortfall * py, z + shortfall * pz
        return x, y, z

    def _global_depth(self, owner: str, group: Sequence[tuple[Overlap, bool]]) -> Vector:
        """Equation 1 for the link and one obstacle; the exact separation if the normals cancel."""
        if len(group) == 1:
            overlap, is_a = group[0]
            size = -overlap.depth if is_a else overlap.depth
            return size * overlap.normal[0], size * overlap.normal[1], size * overlap.normal[2]
        x = y = z = total = 0.0
        for overlap, is_a in group:
            square = overlap.depth * (-overlap.depth if is_a else overlap.depth)
            x += square * overlap.normal[0]
            y += square * overlap.normal[1]
            z += square * overlap.normal[2]
            total += overlap.depth
        x, y, z = x / total, y / total, z / total
        deepest = max(overlap.depth for overlap, _ in group)
        # a short PD_g says that normals cancel, as in figure 4b of the paper
        if not self._exact or (x * x + y * y + z * z) ** 0.5 >= 0.3 * deepest:
            return x, y, z
        return self._separation(owner, group) or (x, y, z)

    def _separation(self, owner: str, group: Sequence[tuple[Overlap, bool]]) -> Vector | None:
        """Least translation of the link's pieces out of all pieces of the obstacle; None if there is none."""
        workspace = self._workspace
        mine = tuple(sorted({overlap.a if is_a else overlap.b for overlap, is_a in group}))
        if (mine, owner) not in self._masks:
            theirs = [k for k, name in enumerate(workspace.owners) if name == owner]
            tested = {frozenset(pair) for pair in workspace.table.pairs.tolist()}
            mask = np.array([[frozenset((i, j)) in tested for j in theirs] for i in mine])
            self._masks[mine, owner] = theirs, mask
        theirs, mask = self._masks[mine, owner]
        placed, pieces = workspace.proximity.results.oMg, workspace.geometry.geometryObjects
        way = least_separation(
            [(pieces[k].geometry, placed[k]) for k in mine], [(pieces[k].geometry, placed[k]) for k in theirs], mask
        )
        if not way.separated:
            return None
        x, y, z = way.translation.tolist()
        return x, y, z
